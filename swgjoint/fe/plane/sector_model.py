"""The flexspline as a ring of sectors between wave generator and circular spline.

All positions are in a global frame that does not turn. Its origin is the axis of the
circular spline, whose rotation in this frame is part of the state; it is zero if the
circular spline is fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.common.cyclic import shift_rows
from swgjoint.fe.common.friction import CoulombFriction
from swgjoint.fe.common.indentation import Indentation
from swgjoint.fe.plane.bore_contact import POINTS, BoreStations
from swgjoint.fe.plane.circular_spline import CircularSpline
from swgjoint.fe.plane.compiled_tangent import find_frames
from swgjoint.fe.plane.corotation import Frames, rotate, rotate_right_angle
from swgjoint.fe.plane.race import NODE, PlaneRace
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.gear.wave_generators.wave_generator import WaveGenerator
from swgjoint.typing import Array, Index

AT_LOBE = 0.9
"""Cosine of twice the angle from the major axis above which bore nodes touch the race
at the start of a search [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorModel:
    """Flexspline ring, wave generator and circular spline of a drive."""

    element: Superelement
    """Condensed sector of the flexspline."""
    wave_generator: WaveGenerator
    """Outline of the wave generator."""
    circular_spline: CircularSpline
    """Teeth of the circular spline, elastic or rigid."""
    lobe_height: float
    """Radial deflection of the rim at the lobes [m]."""
    lobes: int = 2
    """Number of lobes of the wave generator."""
    half: bool = False
    """Whether the model is half of the ring, which a rotation by 180 deg completes."""
    nonlinear: bool = True
    """Whether sectors undergo large rotations."""
    friction: CoulombFriction | None = None
    """Friction between the flanks; None for frictionless flanks."""
    indentation: Indentation | None = None
    """Indentation of the flanks; None uses the compliance of the contact patch only."""
    tooth_shift: Array | None = None
    """Shifts of the flexspline's teeth by manufacturing errors, in the frames of the
    teeth (N, 2) [m]; None without errors."""
    circular_spline_tooth_shift: Array | None = None
    """Shifts of the circular spline's teeth by manufacturing errors, in the frames of
    the teeth (N_c, 2) [m]; only for an elastic circular spline."""
    wave_generator_offset: Array | None = None
    """Centre of the outline in the wave generator's frame (2,) [m]; None for zero."""
    layer: float = 0.0
    """Young's modulus times width of the contact layer between the bore and a rigid
    wave generator [N/m]."""
    points: int = POINTS
    """Number of bore stations between neighbouring nodes."""
    race: PlaneRace | None = None
    """Outer race on balls below the bore; None for a rigid wave generator."""

    @property
    def sectors(self) -> int:
        """Number of sectors in the model."""
        return self.element.sectors // (2 if self.half else 1)

    @property
    def circular_spline_teeth(self) -> int:
        """Number of teeth of the circular spline in the model."""
        return self.circular_spline.profile.teeth // self.copies

    @property
    def copies(self) -> int:
        """Number of copies of the model in the drive."""
        return 2 if self.half else 1

    @property
    def closure(self) -> float:
        """Factor on vectors where the ring closes: -1 for a half model, otherwise 1."""
        return -1.0 if self.half else 1.0

    @cached_property
    def place(self) -> Array:
        """Angles of the sectors in the undeformed ring (N,) [rad]."""
        return np.asarray(
            2.0 * pi / self.element.sectors * np.arange(self.sectors), float
        )

    @cached_property
    def reference(self) -> Array:
        """Undeformed skeleton nodes in the global frame (N, n_a, 2) [m]."""
        skeleton = np.broadcast_to(
            self.element.skeleton, (self.sectors, *self.element.skeleton.shape)
        )
        return rotate(skeleton, self.place[:, None])

    @cached_property
    def bore_nodes(self) -> NDArray[np.int64]:
        """Skeleton nodes of a sector on the bore, without its last corner."""
        size = self.element.face_size
        return np.arange(size - 1, size + self.element.bore_size)

    @cached_property
    def stations(self) -> BoreStations:
        """Contact stations of the bore: between its nodes or, with a race, at them."""
        if self.race is not None:
            return BoreStations.from_nodes(self.race.press)
        skeleton = self.element.skeleton
        bore = skeleton[np.append(self.bore_nodes, len(skeleton) - 1)]
        pitch = 2.0 * pi / self.element.sectors
        before, after = rotate(bore[-2], -pitch), rotate(bore[1], pitch)
        return BoreStations.subdivide(
            np.stack([before, *bore, after]), layer=self.layer, points=self.points
        )

    @cached_property
    def contact_dofs(self) -> Index:
        """Degrees of freedom of a sector that move the gaps of its stations."""
        nodes = self.bore_nodes
        if self.race is not None:
            return np.concatenate([self.dofs[_pairs(nodes)], self.race_dofs])
        # the first and the last node belong to the neighbours; the node before the
        # last one is the last corner, which ends the skeleton
        last = len(self.element.skeleton)
        return _pairs(np.concatenate([[0], nodes + 1, [last, last + 1]]))

    def station_nodes(self, skeleton: Array) -> Array:
        """Nodes that stations follow (N, m, 2) [m], from skeletons (N, n_a, 2) [m]."""
        nodes = skeleton[:, self.bore_nodes]
        if self.race is not None:
            return nodes
        before, after = self._of_last(nodes[:, -1:]), self._of_next(nodes[:, 1:2])
        return np.concatenate([before, nodes, skeleton[:, -1:], after], axis=1)

    def bore_points(self, state: State) -> Array:
        """Positions of the stations of the bore (N, q, 2) [m]."""
        return self.stations.positions(self.station_nodes(self.skeleton(state)))

    @property
    def face_dofs(self) -> int:
        """Number of degrees of freedom that neighbouring sectors share.

        They belong to the nodes of a face and to the two bore nodes next to its corner
        or, with a race, to the race node at the face.
        """
        if self.race is None:
            return 2 * (self.element.face_size + 2)
        return 2 * self.element.face_size + NODE

    @cached_property
    def dofs(self) -> Index:
        """Degrees of freedom of a sector that belong to its skeleton (2 n_a,)."""
        size, face = 2 * len(self.element.skeleton), 2 * self.element.face_size
        if self.race is None:
            return 2 + np.arange(size)
        inside = self.race.size - 2 * NODE
        return np.concatenate(
            [
                np.arange(size - face) + NODE * (np.arange(size - face) >= face),
                np.arange(size - face, size) + NODE + inside,
            ]
        )

    @property
    def sector_dofs(self) -> int:
        """Number of degrees of freedom n of a sector.

        They belong to its skeleton and to one bore node of each neighbour or, with a
        race, to the race below it.
        """
        beside = 2 * 2 if self.race is None else self.race.size
        return 2 * len(self.element.skeleton) + beside

    @cached_property
    def signs(self) -> Array:
        """Signs (N, n): -1 at the end of a half ring, which joins its start; else 1."""
        signs = np.ones((self.sectors, self.sector_dofs))
        signs[-1, -self.face_dofs :] = self.closure
        return signs

    @cached_property
    def race_dofs(self) -> Index:
        """Degrees of freedom of the race nodes in a sector; empty without a race."""
        if self.race is None:
            return np.zeros(0, dtype=np.int64)
        return np.setdiff1d(np.arange(self.sector_dofs), self.dofs)

    def skeleton(self, state: State) -> Array:
        """Positions of all skeleton nodes per sector (N, n_a, 2) [m]."""
        last = self._of_next(state.faces)
        return np.concatenate([state.faces, state.bores, last], axis=1)

    def _of_next(self, vectors: Array) -> Array:
        """Vectors (N, k, 2) of the next sector in each sector."""
        return np.concatenate([vectors[1:], self.closure * vectors[:1]])

    def _of_last(self, vectors: Array) -> Array:
        """Vectors (N, k, 2) of the preceding sector in each sector."""
        return np.concatenate([self.closure * vectors[-1:], vectors[:-1]])

    def frames(self, state: State) -> Frames:
        """Sector frames; in a linear model all turn by the flexspline's rotation."""
        fixed = None
        if not self.nonlinear:
            fixed = np.full(self.sectors, state.rotation)
        return find_frames(self.element, self.skeleton(state), self.place, fixed=fixed)

    def initial_guess(self, alpha: float = 0.0, rotation: float = 0.0) -> State:
        """Start of a search: the inextensional shape of a thin ring on n lobes.

        With the angle phi from the major axis, the radial displacement is w0 cos n phi,
        the tangential one is -w0/n sin n phi, and cross-sections rotate by
        (n - 1/n) w0 sin n phi/r.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Rotation of the flexspline [rad].
        """
        element = self.element
        x = self.reference
        radius = np.hypot(x[..., 0], x[..., 1])
        bore = float(radius.min())
        phi = np.arctan2(-x[..., 0], x[..., 1]) - (alpha - rotation)
        w0, n = self.lobe_height, self.lobes
        turn = (n - 1 / n) * w0 * np.sin(n * phi) / bore
        radial = w0 * np.cos(n * phi)
        tangential = -w0 / n * np.sin(n * phi) + (radius - bore) * turn
        unit = x / radius[..., None]
        moved = x + radial[..., None] * unit
        moved += tangential[..., None] * rotate_right_angle(unit)
        moved = rotate(moved, rotation)
        size, inside = element.face_size, element.bore_size
        race = None
        if self.race is None:
            points = self.stations.positions(self.station_nodes(moved))
            gap, _, _ = self.wave_generator_gap(points, alpha)
            touching = gap < 0.01 * w0
        else:
            race = self.race.initial_guess(alpha, rotation)
            # only the rim presses the race on its balls: start in contact at the lobes
            touching = np.cos(n * phi[:, self.bore_nodes]) > AT_LOBE
        return State(
            race=race,
            faces=moved[:, :size],
            bores=moved[:, size : size + inside],
            pressure=np.zeros(touching.shape),
            touching=touching,
            flank_force=np.zeros((self.sectors, 4 * element.flank_size)),
            circular_spline_force=np.zeros(
                (self.circular_spline_teeth, self.circular_spline.flank_dofs)
            ),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

    def wave_generator_gap(
        self, nodes: Array, alpha: float
    ) -> tuple[Array, Array, Array]:
        """Gap between points and wave generator, with its normal and curvature.

        Args:
            nodes: Positions (..., 2) [m].
            alpha: Wave-generator angle [rad].

        Returns:
            Gap (...) [m], outward normal of the outline (..., 2), and curvature of the
            parallel curve of the outline through each point (...) [1/m].
        """
        flat = rotate(nodes.reshape(-1, 2), -alpha)
        if self.wave_generator_offset is not None:
            flat = flat - self.wave_generator_offset
        gap, normal, curvature = self.wave_generator.signed_distance(flat)
        return (
            gap.reshape(nodes.shape[:-1]),
            rotate(normal, alpha).reshape(nodes.shape),
            (curvature / (1.0 + curvature * gap)).reshape(nodes.shape[:-1]),
        )

    def wave_generator_normal(self, state: State) -> Array:
        """Outward normal of wave generator or race at the bore stations (N, q, 2)."""
        points, alpha = self.bore_points(state), state.wave_generator_angle
        if self.race is None or state.race is None:
            return self.wave_generator_gap(points, alpha)[1]
        return self.race.forces(state.race, alpha, points, state.touching).normal

    def wave_generator_force(self, state: State) -> Array:
        """Force of a rigid wave generator on the bore nodes (N, n_bore + 1, 2) [N]."""
        vectors = state.pressure[..., None] * self.wave_generator_normal(state)
        nodal = self.stations.forces_of(vectors)
        # stations also exert forces on neighbouring sectors: on the last inner node of
        # the previous one, the shared corner and the first inner node of the next one
        force = nodal[:, 1:-2].copy()
        force[:, -1:] += self._of_next(nodal[:, :1])
        force[:, :2] += self._of_last(nodal[:, -2:])
        return np.asarray(force)

    @cached_property
    def _undeformed_bore(self) -> tuple[Array, Array]:
        """Undeformed bore nodes, and turned by a right angle (N, n_bore + 1, 2) [m]."""
        nodes = self.reference[:, self.bore_nodes]
        return nodes, rotate_right_angle(nodes)

    def best_fit_rotation(self, nodes: Array) -> tuple[float, Array]:
        """Best-fit rotation of bore nodes (N, n_bore + 1, 2) [rad] and its gradient."""
        along, across = self._undeformed_bore
        sine = float(np.vdot(across, nodes))
        cosine = float(np.vdot(along, nodes))
        size = sine**2 + cosine**2
        gradient = (cosine / size) * across - (sine / size) * along
        return float(np.arctan2(sine, cosine)), gradient

    def predict_field(
        self,
        state: State,
        alpha: float,
        rotation: float,
        circular_spline_rotation: float,
    ) -> State:
        """Predicted state after rotations of the wave generator and the members.

        The flexspline turns rigidly, while the displacements in the tooth frames travel
        with the wave generator from tooth to tooth, interpolated between sectors.

        Args:
            state: State to start from.
            alpha: New wave-generator angle [rad].
            rotation: New rotation of the flexspline [rad].
            circular_spline_rotation: New rotation of the circular spline [rad].
        """
        pitch = 2.0 * pi / self.element.sectors
        circular_spline_pitch = 2.0 * pi / self.circular_spline.profile.teeth
        d_alpha = alpha - state.wave_generator_angle
        shift = (d_alpha - (rotation - state.rotation)) / pitch
        size, inside = self.element.face_size, self.element.bore_size
        local = rotate(
            np.concatenate([state.faces, state.bores], axis=1),
            -(self.place + state.rotation)[:, None],
        )
        # displacements in the sector frames repeat after half a turn, without a sign
        still = self.element.skeleton[: size + inside]
        x = rotate(
            still + shift_rows(local - still, shift),
            (self.place + rotation)[:, None],
        )
        race = state.race
        if self.race is not None and race is not None:
            race = shift_rows(self.race.displacements(race, state.rotation), shift)
            race = self.race.coordinates(race, rotation)
        return replace(
            state,
            race=race,
            faces=x[:, :size],
            bores=x[:, size:],
            pressure=shift_rows(state.pressure, shift),
            touching=np.roll(state.touching, round(shift), axis=0),
            flank_force=shift_rows(state.flank_force, shift),
            circular_spline_force=shift_rows(
                state.circular_spline_force,
                (d_alpha - (circular_spline_rotation - state.circular_spline_rotation))
                / circular_spline_pitch,
            ),
            wave_generator_angle=alpha,
            rotation=rotation,
            circular_spline_rotation=circular_spline_rotation,
        )

    def shift_flank(self, flank: Array, shift: Array | None) -> Array:
        """Flank displacements including the shifts of the teeth by errors (N, 2 n) [m].

        Args:
            flank: Displacements of the flank nodes (N, 2 n) [m].
            shift: Shift of each tooth in its frame (N, 2) [m]; None without errors.
        """
        if shift is None:
            return flank
        return flank + np.tile(shift, flank.shape[1] // 2)

    def circular_spline_displacement(self, state: State) -> Array:
        """Elastic displacement of the circular spline's flanks (N_c, 2 n_c) [m]."""
        compliance = self.circular_spline.compliance
        if compliance is None:
            return state.circular_spline_force
        return compliance.displacement(state.circular_spline_force)


def _pairs(nodes: Index) -> Index:
    """Degrees of freedom of nodes: x and y of the first node, then of the next."""
    return np.asarray((2 * nodes[:, None] + np.arange(2)).ravel())

"""Flexspline of identical strips on the wave generator: coordinates and frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, about_z, segment_frames
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.strip.strip import Strip
from swgjoint.fe.solid.teeth import SolidTeeth
from swgjoint.fe.solid.wave_generator.race import NODE, SIGN, SolidRace
from swgjoint.fe.solid.wave_generator.surface import WaveGeneratorSurface
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidSectorModel:
    """The strips of the flexspline around the wave generator, with tooth contact.

    The model has N sectors with n masters each. Neighbouring sectors share the masters
    on their common face.
    """

    strip: Strip
    wave_generator: WaveGeneratorSurface
    teeth: SolidTeeth
    lobe_height: float
    """Radial deflection of the flexspline at the lobes [m]."""
    lobes: int = 2
    """Number of lobes of the wave generator."""
    half: bool = False
    """Whether the model is half of the ring; the other half is a copy rotated by
    180 deg."""
    nonlinear: bool = True
    """Whether segments may rotate by large angles; if not, their frames rotate only
    with the bore of the diaphragm."""
    race: SolidRace | None = None
    """Outer race on balls that replaces the rigid wave generator; None without."""

    def dofs(self, masters: Index) -> Index:
        """Degrees of freedom x, y, z of the given masters within a sector.

        With a race, its coordinates at the first face follow the masters of that face,
        and its coordinates at the last face are at the end.
        """
        first = 3 * masters
        if self.race is not None:
            first = first + NODE * (masters >= self.strip.masters.face_size)
        return np.asarray((first[:, None] + np.arange(3)).ravel())

    @cached_property
    def race_dofs(self) -> Index:
        """Degrees of freedom of the race at both faces; empty without a race."""
        if self.race is None:
            return np.zeros(0, dtype=np.int64)
        ends = 3 * self.strip.masters.face_size, self.size - NODE
        return np.concatenate([end + np.arange(NODE) for end in ends])

    @cached_property
    def bore_places(self) -> Array:
        """Positions of the bore nodes between both faces of the undeformed sector (b,).

        They range from 0 to 1 and are initial guesses of the parameters at which the
        nodes face the elements of a race.
        """
        x, y, _ = self.strip.bore.T
        return np.asarray(0.5 + np.arctan2(-x, y) * self.strip.sectors / (2.0 * pi))

    @cached_property
    def contact_dofs(self) -> Index:
        """Degrees of freedom on which the gaps of the bore depend.

        Those of the toothed segment come first, then those of a race.
        """
        return np.concatenate([self.dofs(self.strip.teeth.masters), self.race_dofs])

    @property
    def size(self) -> int:
        """Number of degrees of freedom of a sector, those of both faces included."""
        return 3 * self.strip.masters.size + (0 if self.race is None else 2 * NODE)

    @property
    def face_closure(self) -> Array:
        """Factors on the degrees of freedom of a face where the ring closes.

        They convert the first face of the model to the last face of its last sector.
        """
        of_masters = np.tile(self.closure, self.strip.masters.face_size)
        if self.race is None:
            return of_masters
        return np.concatenate([of_masters, SIGN if self.half else np.ones(NODE)])

    @property
    def copies(self) -> int:
        """Number of copies of the model that make up the drive."""
        return 2 if self.half else 1

    @property
    def sectors(self) -> int:
        """Number of sectors in the model."""
        return self.strip.sectors // self.copies

    @cached_property
    def closure(self) -> Array:
        """Factors on x, y, z where the ring closes (3,).

        A half model continues as its first sector rotated by 180 deg.
        """
        sign = -1.0 if self.half else 1.0
        return np.array([sign, sign, 1.0])

    @cached_property
    def place(self) -> Array:
        """Rotations from the sectors' frames to the global frame at rest (N, 3, 3)."""
        return about_z(
            2.0 * pi / self.strip.sectors * np.arange(self.sectors, dtype=float)
        )

    @cached_property
    def reference(self) -> Array:
        """Positions of the undeformed masters in the global frame (N, n, 3) [m]."""
        position = self.strip.masters.position
        return np.asarray(np.einsum("sij,aj->sai", self.place, position))

    def masters(self, state: SolidState) -> Array:
        """Positions of the masters by sector in the global frame (N, n, 3) [m]."""
        last = np.roll(state.faces, -1, axis=0)
        last[-1] *= self.closure
        return np.concatenate([state.faces, state.inside, last], axis=1)

    def loads(self, state: SolidState) -> Array:
        """Forces at the loaded degrees of freedom of the toothed segments (N, n_b) [N].

        Those on the flanks come first, then those on the bore.
        """
        return np.concatenate([state.flank_force, state.bore_force], axis=1)

    def frames(self, state: SolidState) -> tuple[SolidFrames, ...]:
        """Frames of all segments, in the order of the strip."""
        x, place = self.masters(state), self.place
        if not self.nonlinear:
            place = about_z(np.array(state.rotation)) @ place
        return tuple(
            segment_frames(segment, x[:, segment.masters], place, fitted=self.nonlinear)
            for segment in self.strip.segments
        )

    def bore_positions(self, frames: SolidFrames, state: SolidState) -> Array:
        """Positions of the bore nodes in the frames of the teeth (N, n_bore, 3) [m].

        Args:
            frames: Frames of the toothed segments.
            state: The state.
        """
        teeth, first = self.strip.teeth, self.strip.flank_dofs
        moved = frames.displacement @ teeth.loaded_from_masters[first:].T
        moved += self.loads(state) @ teeth.compliance[:, first:]
        return self.strip.bore + moved.reshape(len(moved), -1, 3)

    def initial_guess(self, alpha: float = 0.0, rotation: float = 0.0) -> SolidState:
        """Approximate state of the deflected cup, from which a search can start.

        The generatrices of the wall remain straight, and the wall does not stretch.
        With n lobes, at the angle phi from the major axis, the radial displacement is
        w0 s cos n phi and the tangential one is -(w0 s/n) sin n phi. The factor s
        decreases linearly along the axis; it is one at mid-face and zero at the closed
        end. Without a cup it is one everywhere. The axial displacement follows from
        zero shear strain in the wall.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Rotation of the flexspline [rad].
        """
        # dimensions of the cup, and the angle phi of every master
        x = self.reference
        strip, w0, n = self.strip, self.lobe_height, self.lobes
        bore = float(np.hypot(strip.bore[:, 0], strip.bore[:, 1]).min())
        closed = float(strip.masters.position[:, 2].max())
        held = strip.masters.position[strip.masters.held]
        boss = float(np.hypot(held[:, 0], held[:, 1]).mean())
        radius = np.hypot(x[..., 0], x[..., 1])
        phi = np.arctan2(-x[..., 0], x[..., 1]) - (alpha - rotation)
        # factors s and ds/dz; in the diaphragm the motion vanishes towards the boss
        has_cup = len(strip.segments) > 1
        s, ds, disc = np.ones_like(phi), 0.0, np.ones_like(phi)
        if has_cup:
            ds = -1.0 / closed
            s = np.clip(1.0 - x[..., 2] / closed, 0.0, None)
            disc = np.clip((radius - boss) / (bore - boss), 0.0, 1.0)
        # inextensional displacements; points outside the bore also turn with it
        off = radius - bore
        turn = (n - 1 / n) * w0 * s * np.sin(n * phi) / bore
        radial = w0 * s * np.cos(n * phi)
        around = -w0 / n * s * np.sin(n * phi) + off * turn
        slope = bore * disc / n**2 + off * (disc == 1.0)
        axial = -slope * w0 * ds * np.cos(n * phi)
        out = np.stack([x[..., 0], x[..., 1], 0.0 * radius], -1) / radius[..., None]
        side = np.stack([-out[..., 1], out[..., 0], 0.0 * radius], axis=-1)
        moved = x + (radial * disc)[..., None] * out + (around * disc)[..., None] * side
        moved[..., 2] += axial
        moved = np.einsum("ij,saj->sai", about_z(np.array(rotation)), moved)
        # start without contact forces
        size, n_bore = strip.masters.face_size, len(strip.bore)
        points = n_bore + 2 * (n_bore // strip.planes)
        last = strip.masters.size - size
        race, touching = None, np.zeros((self.sectors, points), bool)
        if self.race is not None:
            race = self.race.initial_guess(alpha, rotation, closed)
            # without this initial contact nothing would press the race on its balls
            along = np.arange(self.sectors) * 2.0 * pi / strip.sectors
            at_lobe = np.cos(n * (along + rotation - alpha)) > 0.9
            touching[:, :n_bore] = at_lobe[:, None] & self.race.covers(strip.bore[:, 2])
        return SolidState(
            faces=moved[:, :size],
            inside=moved[:, size:last],
            race=race,
            pressure=np.zeros((self.sectors, points)),
            touching=touching,
            shared=np.zeros((self.sectors, n_bore // strip.planes), bool),
            bore_force=np.zeros((self.sectors, 3 * n_bore)),
            flank_force=np.zeros((self.sectors, strip.flank_dofs)),
            circular_spline_force=np.zeros(
                (self.teeth.circular_spline_teeth, self.teeth.circular_spline_dofs)
            ),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

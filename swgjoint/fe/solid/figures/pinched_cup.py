r"""A cup with a clamped boss between two opposite radial loads.

The loads act outward on the bore of two opposite tooth sectors, each over one pitch,
and keep their direction. On ever finer meshes the local indentation of a solid under a
point load grows without limit. The deflection is therefore defined as the mean over the
wall above the load, from the bore to the root circle, in which the indentation is
negligible.

The potential of a load F is exact; its point moves with the corotational segment:

.. math:: \Pi = \sum\tfrac12 d^T\hat K d - F\cdot x_p, \quad
    x_p = R\,(X_p + A d + C R^T F)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from swgjoint.errors import ComputationError, DesignError, Outcome
from swgjoint.fe.solid.cholesky_cyclic import factorise_ring
from swgjoint.fe.solid.corotation import (
    SolidFrames,
    about_z,
    energies,
    matrices_in_global,
    project_to_frames,
    rotate_to_global,
    segment_frames,
    spin,
    tangent,
)
from swgjoint.fe.solid.memory import require_solid_memory, required_memory
from swgjoint.fe.solid.sector_matrices import SectorMatrices, SupportedSectors
from swgjoint.fe.solid.stress import average_faces
from swgjoint.fe.solid.strip.masters import Masters, Orders, strip_masters
from swgjoint.fe.solid.strip.mesh import StripMesh, flexspline_strip
from swgjoint.fe.solid.strip.segment import StripSegment, condense_segment
from swgjoint.fe.solid.strip.smooth_strip import smooth_strip
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.typing import Array, Index
from swgjoint.units import mm

PLACES = ("mid_face", "open_edge", "face_width")
"""Axial positions of the load; ``face_width`` spreads it evenly over the face width."""
MAX_ITERATIONS = 40
"""Largest number of iterations of Newton's method."""
STEP_TOLERANCE = 1e-10
"""Largest displacement increment of a converged iteration [m]."""
CLOSURE = np.array([-1.0, -1.0, 1.0])
"""Factors on x, y, z where the half model closes, see
:attr:`swgjoint.fe.solid.sector_model.SolidSectorModel.closure`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pinched:
    """Equilibrium of a cup between two opposite loads."""

    force: float
    """Outward force of each load [N]."""
    deflection: float
    """Mean outward displacement of the wall above the load [m]."""
    under_load: float
    """Mean outward displacement of the loaded points, indentation included [m]."""
    of_planes: Array
    """Mean outward displacement of the wall in the loaded sector by plane, starting at
    the open edge (n_planes,) [m]."""
    masters: Array
    """Positions of the masters in the global frame (N, n, 3) [m]."""
    load: Array
    """Forces at the loaded points of the first sector, in its frame (3 p,) [N]."""
    energy: float
    """Strain energy of the whole cup [J]."""
    iterations: int
    """Number of iterations of Newton's method."""

    @property
    def stiffness(self) -> float:
        """Secant stiffness: force of a load divided by the deflection [N/m]."""
        return self.force / self.deflection


@dataclass(frozen=True, kw_only=True, eq=False)
class PinchedCup:
    """Half of a flexspline with loads at points of its toothed segments.

    The other half is a copy rotated by 180 deg.
    """

    name: str
    """Name of the drive."""
    sectors: int
    """Number of sectors in the half model."""
    strip: StripMesh
    """Mesh of a sector."""
    masters: Masters
    """Masters of a sector."""
    segments: tuple[StripSegment, ...]
    """Condensed segments of a sector, the toothed one first."""
    root: float
    """Radius of the root circle, the outside of the wall below the teeth [m]."""
    bore: int
    """Number of loaded points on the bore, which are listed plane after plane."""
    first: int = 0
    """Number of loaded points that precede those on the bore; others may follow."""

    @cached_property
    def reference(self) -> Array:
        """Positions of the undeformed masters in the global frame (N, n, 3) [m]."""
        return np.asarray(np.einsum("sij,aj->sai", self._place, self.masters.position))

    @cached_property
    def _place(self) -> Array:
        return about_z(pi / self.sectors * np.arange(self.sectors, dtype=float))

    @cached_property
    def _held(self) -> Index:
        """Degrees of freedom at the boss; empty for a ring without one."""
        held = 3 * self.masters.held[:, None] + np.arange(3)
        size = 0 if len(self.segments) == 1 else held.size
        return np.asarray(held.ravel()[:size], dtype=np.int64)

    @property
    def _on_bore(self) -> slice:
        return slice(self.first, self.first + self.bore)

    def share(self, place: str) -> Array:
        """Share of a load at one of :data:`PLACES` in every plane (n_planes,) [-]."""
        z = self.strip.teeth.z
        share = np.zeros(len(z))
        if place == "mid_face":
            # two planes if none is in the middle
            near = np.abs(z) <= np.abs(z).min() + 1e-9 * np.ptp(z)
            share[near] = 1.0 / near.sum()
        elif place == "open_edge":
            share[0] = 1.0
        else:
            share[:-1] += 0.5 * np.diff(z) / np.ptp(z)
            share[1:] += 0.5 * np.diff(z) / np.ptp(z)
        return share

    def pull(
        self,
        force: float,
        place: str = "mid_face",
        *,
        nonlinear: bool = False,
    ) -> Pinched:
        """Equilibrium under two opposite loads.

        Args:
            force: Outward force of each load [N].
            place: Axial position of the loads, one of :data:`PLACES`.
            nonlinear: Whether segments may rotate by large angles.

        Raises:
            ComputationError: If Newton's method does not converge.
        """
        share = self.share(place)
        count = self.bore // len(share)
        weight = np.zeros(len(self.segments[0].loaded) // 3)
        weight[self._on_bore] = np.repeat(share / count, count)
        x, last = self.reference.copy(), np.inf
        for iteration in range(1, MAX_ITERATIONS + 1):
            frames = self.frames(x, nonlinear=nonlinear)
            row, load = self._row(frames[0], weight, force)
            step = self._step(frames, load[None], force * row[None])
            x += step.reshape(x.shape)
            last = float(np.abs(step).max())
            if last < STEP_TOLERANCE or not nonlinear:
                return self._found(x, weight, force, nonlinear, iteration)
            if not last < self.root:
                break
        raise ComputationError(
            f"{self.name}: two loads of {force:g} N: {Outcome.MAX_ITERATIONS.value}"
        )

    def frames(self, x: Array, *, nonlinear: bool) -> tuple[SolidFrames, ...]:
        """Frames of all segments, in the order of the strip.

        Args:
            x: Positions of the masters in the global frame (N, n, 3) [m].
            nonlinear: Whether segments may rotate by large angles.
        """
        return tuple(
            segment_frames(
                segment, x[:, segment.masters], self._place, fitted=nonlinear
            )
            for segment in self.segments
        )

    def _points(self, frame: SolidFrames, load: Array) -> Array:
        """Displaced loaded points of the first sector in its frame (p, 3) [m]."""
        teeth = self.segments[0]
        rest = np.asarray(teeth.mesh.mesh.p).T[teeth.loaded[::3] // 3]
        moved = teeth.loaded_from_masters @ frame.displacement[0]
        moved += teeth.compliance @ load
        return np.asarray(rest + moved.reshape(-1, 3))

    def _row(
        self, frame: SolidFrames, weight: Array, force: float
    ) -> tuple[Array, Array]:
        """Derivative of the mean outward motion of the loaded points, and their forces.

        Returns:
            Derivative by the masters of the toothed segment of the first sector, in the
            global frame (3 m,) [-], and forces in the frame of this segment (3 p,) [N].
        """
        teeth = self.segments[0]
        outward = frame.turn[0, 1]  # the global y axis in the frame
        load = force * (weight[:, None] * outward).ravel()
        arm = weight @ self._points(frame, load)
        arm -= frame.centre[0] + teeth.position.mean(axis=0)
        carried = (weight[:, None] * outward).ravel() @ teeth.loaded_from_masters
        lever = -spin(frame.position[0]).reshape(-1, 3)
        turning = np.cross(arm, outward) - carried @ lever
        row = carried + turning @ frame.gradient[0]
        return (row.reshape(-1, 3) @ frame.turn[0].T).ravel(), load

    def _step(
        self, frames: tuple[SolidFrames, ...], loads: Array, pushed: Array
    ) -> Array:
        """Newton increment of the masters (N, 3 n) [m].

        Args:
            frames: Frames of all segments.
            loads: Forces at the loaded points of the first k sectors, in their frames
                (k, 3 p) [N].
            pushed: The same forces transferred to the masters of the toothed segments,
                in the global frame (k, 3 m) [N].
        """
        n, few = 3 * self.masters.size, len(loads)
        out, terms = np.zeros((self.sectors, n)), list[tuple[Index, Array]]()
        for number, (segment, frame) in enumerate(
            zip(self.segments, frames, strict=True)
        ):
            dofs = (3 * segment.masters[:, None] + np.arange(3)).ravel()
            elastic = frame.deformation @ segment.stiffness
            total = elastic.copy()
            if number == 0:
                total[:few] -= loads @ segment.loaded_from_masters
                out[:few, dofs] += pushed
            out[:, dofs] -= rotate_to_global(frame, project_to_frames(frame, elastic))
            local = matrices_in_global(frame, tangent(segment, frame, total))
            terms.append((dofs, local))
        matrices, held = SectorMatrices(size=n, terms=tuple(terms)), self._held
        scale = matrices.mean_diagonal
        out[:, held] = 0.0
        if not len(held):
            # springs against rigid motion carry no force, because the loads balance
            springs = np.multiply.outer(np.arange(self.sectors) == 0, scale * np.eye(2))
            terms.append((np.array([0, 2]), springs))
            matrices = SectorMatrices(size=n, terms=tuple(terms))
        # the half model closes with the factors of its last face
        size = 3 * self.masters.face_size
        sign = np.tile(CLOSURE, self.masters.face_size)
        out[-1, -size:] *= sign
        blocks = SupportedSectors(
            matrices=matrices, held=held, fixed=None, sign=sign, scale=scale
        )
        solved = factorise_ring(blocks, size).solve(out[..., None])[..., 0]
        solved[-1, -size:] *= sign
        return np.asarray(solved)

    def respond(self, loads: Array) -> tuple[Array, dict[str, Array]]:
        """Linear response to forces at the loaded points of all sectors.

        Args:
            loads: Forces in the frames of the teeth (N, 3 p) [N].

        Returns:
            Displacements of the nodes of the toothed segments (N, n_nodes, 3) [m], and
            stress xx, yy, zz, xy, yz, zx at the nodes by segment (N, n_nodes, 6) [Pa],
            both in the frames of the teeth.
        """
        frames = self.frames(self.reference, nonlinear=False)
        carried = loads @ self.segments[0].loaded_from_masters
        step = self._step(frames, loads, rotate_to_global(frames[0], carried))
        x = self.reference + step.reshape(self.reference.shape)
        moved = self.frames(x, nonlinear=False)
        displacements, stresses = [], {}
        for number, (segment, frame) in enumerate(
            zip(self.segments, moved, strict=True)
        ):
            force = None if number else loads
            u = segment.displacement(frame.displacement, force)
            stress = segment.stresses(u)
            faces = segment.mesh.first, segment.mesh.last
            average_faces(stress, frame.turn, *faces, CLOSURE)
            displacements.append(u)
            stresses[segment.name] = stress
        return displacements[0], stresses

    def _found(
        self, x: Array, weight: Array, force: float, nonlinear: bool, iterations: int
    ) -> Pinched:
        frames = self.frames(x, nonlinear=nonlinear)
        frame, teeth = frames[0], self.segments[0]
        _, load = self._row(frame, weight, force)
        energy = sum(
            float(energies(segment, of).sum())
            for segment, of in zip(self.segments, frames, strict=True)
        )
        energy += 0.5 * float(load @ teeth.compliance @ load)
        # outward is the global y axis of the first sector
        moved = teeth.displacement(frame.displacement[:1], load[None])[0]
        rest = np.asarray(teeth.mesh.mesh.p).T
        out = (rest + moved) @ frame.turn[0, 1] - rest[:, 1]
        nodes = self.strip.teeth.nodes
        plane = np.asarray(self.strip.teeth.plane.mesh.p)
        wall = np.hypot(*plane) < self.root * (1.0 + 1e-9)
        of_planes = out[nodes[:, wall]].mean(axis=1)
        of_load = weight[self._on_bore].reshape(len(of_planes), -1).sum(axis=1)
        return Pinched(
            force=force,
            deflection=float(of_load @ of_planes),
            under_load=float(weight @ out[teeth.loaded[::3] // 3]),
            of_planes=of_planes,
            masters=x,
            load=load,
            energy=2.0 * energy,
            iterations=iterations,
        )


def pinched_cup(
    design: Design, *, toothless: bool = False, orders: Orders | None = None
) -> PinchedCup:
    """Condense the flexspline of a design to a half model with loads on its bore.

    Args:
        design: The drive; without a ``[cup]`` its flexspline is a free ring.
        toothless: Whether to omit the teeth and keep only the rim.
        orders: Polynomial degrees of the displacements of faces and sections; None for
            the default degrees.

    Raises:
        DesignError: If the design cannot be meshed or has an odd number of teeth, so
            that no two of them are opposite.
        ComputationError: If the model does not fit in the memory of the machine.
    """
    name, teeth = design.drive.name, design.drive.teeth_flexspline
    if teeth % 2:
        raise DesignError(
            f"{name}: drive.teeth_flexspline = {teeth}: the radial stiffness needs"
            " opposite teeth; expected an even number"
        )
    profile = tooth_profile(design, "flexspline")
    strip = smooth_strip(design) if toothless else flexspline_strip(design, profile)
    orders = orders or Orders()
    require_solid_memory(name, required_memory(strip, None, teeth // 2, orders))
    masters = strip_masters(strip, orders)
    material = design.material_of("flexspline")
    bore = strip.teeth.bore.ravel()
    points = bore if toothless else np.concatenate([bore, pitch_points(strip, profile)])
    loaded = (3 * points[:, None] + np.arange(3)).ravel()
    segments = tuple(
        condense_segment(
            segment,
            follow,
            masters.position,
            youngs_modulus=material.youngs_modulus,
            poisson_ratio=material.poisson_ratio,
            loaded=None if number else loaded,
        )
        for number, (segment, follow) in enumerate(
            zip(strip.segments, masters.segments, strict=True)
        )
    )
    inner, rim = design.flexspline_inner_radius, design.flexspline.rim_mm * mm
    return PinchedCup(
        name=name,
        sectors=teeth // 2,
        strip=strip,
        masters=masters,
        segments=segments,
        root=inner + rim,
        bore=len(bore),
    )


def pitch_points(strip: StripMesh, profile: ToothProfile) -> Index:
    """Nodes of both flanks closest to the pitch circle, plane after plane.

    Args:
        strip: Mesh of the flexspline's strip.
        profile: Tooth profile of the flexspline.
    """
    plane = strip.teeth.plane
    points = np.asarray(plane.mesh.p)
    pair = []
    for side in (plane.flank_right, plane.flank_left):
        away = np.abs(np.hypot(*points[:, side]) - profile.pitch_radius)
        pair.append(side[np.argmin(away)])
    return np.asarray(strip.teeth.nodes[:, pair].ravel(), dtype=np.int64)

r"""Tangent of the ring with the wave generator's contact eliminated in every sector.

The contact points of a sector are the bore nodes and one vertex in every line of bore
nodes along the axis. They are coupled to each other and to the masters only through the
compliance C of the toothed segment, so their forces are condensed sector by sector:

.. math:: \lambda = -W^{-1}(g + B\,\delta q + D F), \quad W = n^T C n,

where g are the gaps without the previous forces, B is their derivative by the masters,
D their derivative by the tooth forces, and F are the tooth forces. The result is a ring
of small matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.plane.race import RaceForces
from swgjoint.fe.solid.across import FLAT, WIDE, crown_bend, vertices
from swgjoint.fe.solid.corotation import (
    SolidFrames,
    matrices_in_global,
    project_to_frames,
    rotate_to_global,
    spin,
    tangent,
)
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.typing import Array, Index, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class BoreContact:
    """Contact points on the bore at one state; p of them in each sector.

    The first b points are the bore nodes, plane after plane. The vertices of the gap
    over the face width follow, one for every line of nodes along the axis, and then the
    slopes of the gap at the vertices. The rows of the slopes are active while a vertex
    carries force, and do no work at equilibrium.
    """

    gap: Array
    """Gaps (N, p) [m]."""
    normal: Array
    """Gradient of the gap at the nodes in the frames of the teeth (N, b, 3)."""
    vertex: Array
    """Weights of the nodes in the vertices and in their slopes (N, p - b, b)."""
    found: Mask
    """Mask of the lines that have a vertex (N, L)."""
    present: Mask
    """Mask of the points that can open and close (N, p)."""
    active: Mask
    """Mask of the points that touch (N, p)."""
    rows: Array
    """Derivative B of the gaps by the masters of the teeth in the global frame and by
    the coordinates of a race (N, p, 3 m)."""
    free_gap: Array
    """Gaps g without the previous forces (N, p) [m]."""
    compliance: Array
    """Compliance W of all points (N, p, p) [m/N]."""
    inverse: Array
    """Inverse W^-1 of the active points, zero elsewhere (N, p, p) [N/m]."""

    def with_vertices(self, nodal: Array, sector: Index) -> Array:
        """Extend nodal values to all contact points, (n, b) -> (n, p).

        Args:
            nodal: Values at the bore nodes (n, b).
            sector: Sectors of these values (n,).
        """
        vertex = np.einsum("kvb,kb->kv", self.vertex[sector], nodal)
        return np.concatenate([nodal, vertex], axis=1)

    def nodal_force(self, pressure: Array) -> Array:
        """Nodal forces in the frames of the teeth (N, 3 b) [N].

        Args:
            pressure: Forces at all contact points (N, p) [N].
        """
        b = self.normal.shape[1]
        size = pressure[:, :b] + np.einsum("svb,sv->sb", self.vertex, pressure[:, b:])
        return np.asarray((size[..., None] * self.normal).reshape(len(size), -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidLinearised:
    """Ring linearised at one state.

    A sector has n coordinates, three for each master and those of a race.
    """

    frames: tuple[SolidFrames, ...]
    gradient: Array
    """Derivative of the strain energy (N, n) [N]."""
    hessian: Array
    """Tangent, including the condensed contact of the wave generator (N, n, n) [N/m].
    """
    pushed: Array
    """Forces B^T W^-1 g of the wave generator on undisplaced masters (N, n) [N]."""
    bore: BoreContact
    race: RaceForces | None = None
    """Forces of a race, already included in gradient and tangent."""


def linearise(
    model: SolidSectorModel, state: SolidState, *, kept: Mask | None = None
) -> SolidLinearised:
    """Linearise a ring at a state.

    Args:
        model: The 3D model.
        state: The state.
        kept: Mask of the lines that remain shared if the state shares them, see
            ``shared`` of :class:`SolidState` (N, L); None for all lines.
    """
    frames = model.frames(state)
    n = model.size
    gradient, pushed = np.zeros((2, model.sectors, n))
    hessian = np.zeros((model.sectors, n, n))
    bore = bore_contact(model, state, frames[0], kept=kept)
    loads = model.loads(state)
    for number, (segment, frame) in enumerate(
        zip(model.strip.segments, frames, strict=True)
    ):
        dofs = model.dofs(segment.masters)
        elastic = frame.deformation @ segment.stiffness
        total = elastic
        if number == 0:
            total = elastic - loads @ segment.loaded_from_masters
        gradient[:, dofs] += rotate_to_global(frame, project_to_frames(frame, elastic))
        local = matrices_in_global(frame, tangent(segment, frame, total))
        hessian[:, dofs[:, None], dofs] += local
        if number == 0:
            into, held = model.contact_dofs, bore.inverse @ bore.rows
            hessian[:, into[:, None], into] += bore.rows.transpose(0, 2, 1) @ held
            pushed[:, into] += np.einsum("spi,sp->si", held, bore.free_gap)
    race = None
    if model.race is not None and state.race is not None:
        race, dofs = (
            model.race.forces(state.race, state.wave_generator_angle),
            model.race_dofs,
        )
        gradient[:, dofs] += race.gradient
        hessian[:, dofs[:, None], dofs] += race.hessian
    return SolidLinearised(
        frames=frames,
        gradient=gradient,
        hessian=hessian,
        pushed=pushed,
        bore=bore,
        race=race,
    )


def bore_contact(
    model: SolidSectorModel,
    state: SolidState,
    frame: SolidFrames,
    *,
    kept: Mask | None = None,
) -> BoreContact:
    """Contact points of all sectors.

    Args:
        model: The 3D model.
        state: The state.
        frame: Frames of the toothed segments.
        kept: Mask of the lines that remain shared, see :func:`linearise` (N, L).
    """
    teeth, first = model.strip.teeth, model.strip.flank_dofs
    n, p = state.touching.shape
    b = len(model.strip.bore)
    local = model.bore_positions(frame, state)
    points = np.einsum("sij,spj->spi", frame.turn, local)
    if model.race is not None and state.race is not None:
        gap, normal, by_race = model.race.gap(state.race, points, model.bore_places)
    else:
        gap, normal, _ = model.wave_generator.gap(
            points.reshape(-1, 3), state.wave_generator_angle
        )
        gap, by_race = gap.reshape(n, b), np.zeros((n, b, 0))
    normal = np.einsum("sji,spj->spi", frame.turn, normal.reshape(n, b, 3))
    vertex, found, bend, covered = _vertices(model, gap, state, kept)
    # derivative by the masters in the frame: motion of the teeth and of the frame
    carry = teeth.loaded_from_masters[first:].reshape(b, 3, -1)
    carried = np.einsum("spi,pim->spm", normal, carry)
    m = frame.position.shape[1]
    middle = local - frame.centre[:, None] - teeth.position.mean(axis=0)
    turning = np.cross(middle, normal)
    s = -spin(frame.position).reshape(n, 3 * m, 3)
    turning -= np.einsum("spm,smw->spw", carried, s)
    rows = carried + np.einsum("spw,swm->spm", turning, frame.gradient)
    rows = np.einsum("sij,spaj->spai", frame.turn, rows.reshape(n, b, m, 3))
    rows = np.concatenate([rows.reshape(n, b, 3 * m), by_race], axis=2)
    compliance = teeth.compliance[first:, first:].reshape(b, 3, b, 3)
    seen = np.einsum("iajb,sjb->siaj", compliance, normal)
    nodal = np.einsum("sia,siaj->sij", normal, seen)
    p = b + vertex.shape[1]
    w = np.zeros((n, p, p))
    w[:, :b, :b], w[:, b:, :b] = nodal, vertex @ nodal
    w[:, :b, b:] = w[:, b:, :b].transpose(0, 2, 1)
    w[:, b:, b:] = w[:, b:, :b] @ vertex.transpose(0, 2, 1)
    lines = found.shape[1]
    at, rolls = np.arange(b, b + lines), np.arange(b + lines, p)
    present = np.ones((n, p), dtype=bool)
    present[:, at], present[:, rolls] = found, False
    present[:, :b] = ~covered
    if model.race is not None:
        present[:, :b] &= model.race.covers(model.strip.bore[:, 2])
    active = state.touching & present
    active[:, rolls] = active[:, at] & (state.pressure[:, at] > 0.0)
    loaded = np.where(active[:, rolls], state.pressure[:, at], 1.0)
    w[:, rolls, rolls] += bend / loaded
    moved = model.loads(state) @ teeth.compliance[:, first:]
    free = gap - np.einsum("spi,spi->sp", normal, moved.reshape(n, b, 3))
    on = active[:, :, None] & active[:, None, :]
    size = np.mean(np.einsum("spp->sp", w))
    safe = np.where(on, w, 0.0) + np.where(active, 0.0, size)[:, :, None] * np.eye(p)
    inverse = np.where(on, np.linalg.inv(safe), 0.0)

    def with_vertices(of_nodes: Array) -> Array:
        return np.concatenate([of_nodes, vertex @ of_nodes], axis=1)

    return BoreContact(
        gap=with_vertices(gap[..., None])[..., 0],
        normal=normal,
        vertex=vertex,
        found=found,
        present=present,
        active=active,
        rows=with_vertices(rows),
        free_gap=with_vertices(free[..., None])[..., 0],
        compliance=w,
        inverse=inverse,
    )


def _vertices(
    model: SolidSectorModel, gap: Array, state: SolidState, kept: Mask | None
) -> tuple[Array, Mask, Array, Mask]:
    """Vertices of the gap along the axis.

    Returns:
        Weights of the bore nodes in the vertices and in their slopes (N, 2 L, b); mask
        of the lines that have a vertex (N, L), and its bend (N, L) [m]; mask of the
        nodes that the vertices replace (N, b).
    """
    n, b = gap.shape
    planes = model.strip.planes
    lines = b // planes
    crown = crown_bend(model.wave_generator.crowning, model.strip.mesh.teeth.z)

    def over(nodal: NDArray[Any]) -> NDArray[Any]:
        return nodal.reshape(n, planes, lines).transpose(1, 0, 2).reshape(planes, -1)

    flat = np.full(n * lines, crown * FLAT if crown else inf)
    # planes that share a contact keep it until the gap is clearly bent
    shared = state.shared.ravel()
    flat[shared] *= WIDE
    flat[shared & (True if kept is None else kept.ravel())] = inf
    seen = vertices(over(gap), flat)
    if model.race is not None:  # no vertex outside the width of the race
        beside = ~model.race.covers(model.strip.mesh.teeth.z @ seen.weight)
        seen.found[beside], seen.covered[:, beside] = False, False
    means = np.zeros((n, 2, lines, planes, lines))
    line = np.arange(lines)
    for k, weight in enumerate((seen.weight, seen.slope)):
        spread = weight.reshape(planes, n, lines).transpose(2, 1, 0)
        means[:, k, line, :, line] = spread
    return (
        means.reshape(n, 2 * lines, b),
        seen.found.reshape(n, lines),
        seen.bend.reshape(n, lines),
        seen.covered.reshape(planes, n, lines).transpose(1, 0, 2).reshape(n, b),
    )

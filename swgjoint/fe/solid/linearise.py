r"""Linearised ring, with the contact of the wave generator eliminated in every sector.

The contact points of a sector are its bore nodes and at most one vertex per line of
bore nodes along the axis, see :mod:`swgjoint.fe.solid.across`. Only the compliance C of
the toothed segment couples them to each other and to the masters, so their forces are
eliminated sector by sector:

.. math:: \lambda = -W^{-1}(g + B\,\delta q + D F), \quad W = n^T C n .

Here g are the gaps that would remain without the previous contact forces, n the
gradients of the gaps, :math:`\delta q` the increments of the masters, B the derivative
of the gaps by the masters, F the tooth forces, and D the derivative of the gaps by F.
The result is a ring of small matrices.
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
)
from swgjoint.fe.solid.corotation import tangent as stiffness
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.typing import Array, Index, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class BoreContact:
    """Contact points on the bore at one state.

    Each of the N sectors has b bore nodes in L lines along the axis and p = b + 2 L
    points: first the bore nodes, plane after plane; then the vertices of the gap over
    the face width, one per line; then the slopes of the gap at these vertices. A slope
    is active while its vertex carries force; at equilibrium it does no work.
    """

    gap: Array
    """Gaps (N, p) [m]."""
    normal: Array
    """Gradients of the gaps at the nodes in the frames of the teeth (N, b, 3) [-]."""
    vertex: Array
    """Weights of the nodes in the gaps at the vertices and in the slopes there
    (N, p - b, b) [-]."""
    found: Mask
    """Mask of the lines that have a vertex (N, L)."""
    present: Mask
    """Mask of the points that can open and close (N, p)."""
    active: Mask
    """Mask of the points that touch (N, p)."""
    rows: Array
    """Derivative B of the gaps by the masters of the toothed segment in the global
    frame, and by the 16 coordinates of a race if there is one (N, p, 3 m) or
    (N, p, 3 m + 16) [-]."""
    free_gap: Array
    """Gaps g without the previous contact forces (N, p) [m]."""
    compliance: Array
    """Compliance W of all points (N, p, p) [m/N]."""
    inverse: Array
    """Inverse W^-1 over the active points, zero elsewhere (N, p, p) [N/m]."""

    def with_vertices(self, nodal: Array, sector: Index) -> Array:
        """Extend values at the bore nodes to all contact points (n, p).

        Args:
            nodal: Values at the bore nodes (n, b).
            sector: Sector of each row of values (n,).
        """
        vertex = np.einsum("kvb,kb->kv", self.vertex[sector], nodal)
        return np.concatenate([nodal, vertex], axis=1)

    def nodal_force(self, pressure: Array) -> Array:
        """Force vectors at the bore nodes in the frames of the teeth (N, 3 b) [N].

        Args:
            pressure: Forces at all contact points (N, p) [N].
        """
        b = self.normal.shape[1]
        size = pressure[:, :b] + np.einsum("svb,sv->sb", self.vertex, pressure[:, b:])
        return np.asarray((size[..., None] * self.normal).reshape(len(size), -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidLinearised:
    """Ring linearised at one state.

    A sector has n coordinates: three per master and, with a race, those of the race.
    """

    frames: tuple[SolidFrames, ...]
    """Frames of the segments, in the order of the strip."""
    gradient: Array
    """Derivative of the strain energy by the coordinates (N, n) [N]."""
    hessian: Array | None
    """Tangent, including the condensed contact of the wave generator (N, n, n) [N/m];
    None if it was not asked for."""
    pushed: Array
    """Contribution B^T W^-1 g of this contact to the gradient if the coordinates do not
    move: the negative forces of the wave generator on the coordinates (N, n) [N]."""
    bore: BoreContact
    race: RaceForces | None = None
    """Forces of a race, already included in gradient and tangent; None without."""


def linearise(
    model: SolidSectorModel,
    state: SolidState,
    *,
    kept: Mask | None = None,
    tangent: bool = True,
) -> SolidLinearised:
    """Linearise a ring at a state.

    Args:
        model: The 3D model.
        state: The state.
        kept: Mask of the lines whose contact remains shared by several planes if it is
            shared in the state, see ``shared`` of :class:`SolidState` (N, L); None for
            all lines.
        tangent: Whether the tangent is computed.
    """
    frames = model.frames(state)
    n = model.size
    gradient, pushed = np.zeros((2, model.sectors, n))
    hessian = np.zeros((model.sectors, n, n)) if tangent else None
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
        if hessian is not None:
            local = matrices_in_global(frame, stiffness(segment, frame, total))
            _add(hessian, dofs, local)
    into, held = model.contact_dofs, bore.inverse @ bore.rows
    pushed[:, into] += np.einsum("spi,sp->si", held, bore.free_gap)
    if hessian is not None:
        _add(hessian, into, bore.rows.transpose(0, 2, 1) @ held)
    race = None
    if model.race is not None and state.race is not None:
        race, dofs = (
            model.race.forces(state.race, state.wave_generator_angle),
            model.race_dofs,
        )
        gradient[:, dofs] += race.gradient
        if hessian is not None:
            _add(hessian, dofs, race.hessian)
    return SolidLinearised(
        frames=frames,
        gradient=gradient,
        hessian=hessian,
        pushed=pushed,
        bore=bore,
        race=race,
    )


def _add(matrix: Array, dofs: Index, blocks: Array) -> None:
    """Add blocks (N, k, k) to the rows and columns of degrees of freedom (k,).

    The degrees of freedom form a few runs: slices are faster than indices.
    """
    breaks = np.flatnonzero(np.diff(dofs) != 1) + 1
    begin, end = np.concatenate([[0], breaks]), np.append(breaks, len(dofs))
    runs = [
        (slice(dofs[i], dofs[j - 1] + 1), slice(i, j))
        for i, j in zip(begin, end, strict=True)
    ]
    for row, i in runs:
        for column, j in runs:
            matrix[:, row, column] += blocks[:, i, j]


def bore_contact(
    model: SolidSectorModel,
    state: SolidState,
    frame: SolidFrames,
    *,
    kept: Mask | None = None,
) -> BoreContact:
    """Contact points of all sectors, with their gaps, derivatives and compliance.

    Args:
        model: The 3D model.
        state: The state.
        frame: Frames of the toothed segments.
        kept: Mask of the lines whose contact remains shared, see :func:`linearise`
            (N, L).
    """
    # gaps of the bore nodes, their gradients, and vertices over the face width
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
    # derivative by the masters in the frame: deformation and rotation of the frame
    carry = teeth.loaded_from_masters[first:].reshape(b, 3, -1)
    by_point = normal.transpose(1, 0, 2)
    carried = np.ascontiguousarray((by_point @ carry).transpose(1, 0, 2))
    m = frame.position.shape[1]
    middle = local - frame.centre[:, None] - teeth.position.mean(axis=0)
    turning = np.cross(middle, normal)
    s = -spin(frame.position).reshape(n, 3 * m, 3)
    turning -= carried @ s
    rows = carried + turning @ frame.gradient
    rows = rows.reshape(n, b * m, 3) @ frame.turn.transpose(0, 2, 1)
    rows = np.concatenate([rows.reshape(n, b, 3 * m), by_race], axis=2)
    # compliance W of nodes, vertices and slopes
    compliance = teeth.compliance[first:, first:].reshape(b, 3, 3 * b)
    seen = (by_point @ compliance).reshape(b, n, b, 3)
    nodal = np.einsum("isjb,sjb->sij", seen, normal)
    p = b + vertex.shape[1]
    w = np.zeros((n, p, p))
    w[:, :b, :b], w[:, b:, :b] = nodal, vertex @ nodal
    w[:, :b, b:] = w[:, b:, :b].transpose(0, 2, 1)
    w[:, b:, b:] = w[:, b:, :b] @ vertex.transpose(0, 2, 1)
    # points that can touch, and points that do; slopes follow their vertices
    lines = found.shape[1]
    at, rolls = np.arange(b, b + lines), np.arange(b + lines, p)
    present = np.ones((n, p), dtype=bool)
    present[:, at], present[:, rolls] = found, False
    present[:, :b] = ~covered
    if model.race is not None:
        present[:, :b] &= model.race.covers(model.strip.bore[:, 2])
    active = state.touching & present
    active[:, rolls] = active[:, at] & (state.pressure[:, at] > 0.0)
    # spring of a slope whose vertex carries the force lambda: compliance g''/lambda
    loaded = np.where(active[:, rolls], state.pressure[:, at], 1.0)
    w[:, rolls, rolls] += bend / loaded
    # gaps without the previous forces, and the inverse over the active points
    moved = model.loads(state) @ teeth.compliance[:, first:]
    free = gap - np.einsum("spi,spi->sp", normal, moved.reshape(n, b, 3))
    inverse = np.zeros_like(w)
    for k in np.flatnonzero(active.any(axis=1)):
        on = np.ix_(active[k], active[k])
        inverse[k][on] = np.linalg.inv(w[k][on])

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
        Weights of the bore nodes in the gaps at the vertices and in the slopes there
        (N, 2 L, b); mask of the lines that have a vertex (N, L); second derivative of
        the gap at the vertex by the plane number (N, L) [m]; mask of the nodes that the
        vertices replace (N, b).
    """
    n, b = gap.shape
    planes = model.strip.planes
    lines = b // planes
    crown = crown_bend(model.wave_generator.crowning, model.strip.mesh.teeth.z)

    def over(nodal: NDArray[Any]) -> NDArray[Any]:
        return nodal.reshape(n, planes, lines).transpose(1, 0, 2).reshape(planes, -1)

    flat = np.full(n * lines, crown * FLAT if crown else inf)
    # lines with a shared contact need a larger bend before they get a vertex
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

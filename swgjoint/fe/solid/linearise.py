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

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.fe.plane.race import RaceForces
from swgjoint.fe.solid.corotation import (
    SolidFrames,
    dead_load_tangent,
    matrices_in_global,
    project_to_frames,
    rotate_to_global,
    spin,
)
from swgjoint.fe.solid.corotation import tangent as stiffness
from swgjoint.fe.solid.sector_matrices import SectorMatrices
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.wave_generator.turning import sliding_tangent
from swgjoint.fe.solid.wave_generator.vertices import find_vertices
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
    points: Index
    """Points that touch, then others that fill the rows (N, a)."""
    weight: Array
    """Weights of the nodes in the gaps at these points, zero at points that do not
    touch (N, a, b) [-]."""
    rows: Array
    """Derivative B of the gaps at these points by the masters of the toothed segment in
    the global frame, and by the 16 coordinates of a race if there is one (N, a, 3 m) or
    (N, a, 3 m + 16) [-]."""
    free_gap: Array
    """Gaps g without the previous contact forces (N, p) [m]."""
    compliance: Array
    """Compliance W between the points that touch and all points (N, a, p) [m/N]."""
    inverse: Array
    """Inverse W^-1 over the points that touch, zero at others (N, a, a) [N/m]."""
    frame: SolidFrames
    """Frames of the toothed segments."""
    carry: Array
    """Displacements of the bore nodes by the masters in the frames (3 b, 3 m) [-]."""
    place: Array
    """Positions of the nodes in the frames, relative to the mean of the masters
    (N, b, 3) [m]."""
    arm: Array
    """Derivative of the gaps at the nodes by a rotation of the bore in the frames
    (N, b, 3) [m]."""
    by_race: Array
    """Derivative of the gaps at the nodes by the coordinates of a race (N, b, 16) [-];
    no columns without a race."""

    def among_points(self, values: Array) -> Array:
        """Values at ``points`` (N, a) of values at all contact points (N, p)."""
        return np.take_along_axis(values, self.points, axis=1)

    def at_all(self, values: Array) -> Array:
        """Values at all contact points (N, p) of values at ``points`` (N, a).

        They are zero at points that do not touch.
        """
        spread = np.zeros(self.gap.shape)
        np.put_along_axis(spread, self.points, values, axis=1)
        return np.where(self.active, spread, 0.0)

    @property
    def own_compliance(self) -> Array:
        """Diagonal of W; zero at points that do not touch (N, p) [m/N]."""
        own = np.take_along_axis(self.compliance, self.points[:, :, None], axis=2)
        return self.at_all(own[:, :, 0])

    def change(self, moved: Array) -> Array:
        """Change of all gaps to first order, at the same contact forces (N, p) [m].

        Args:
            moved: Motion of the coordinates to which ``rows`` refer (N, 3 m) or
                (N, 3 m + 16) [m].
        """
        n, m = self.frame.position.shape[:2]
        local = moved[:, : 3 * m].reshape(n, m, 3) @ self.frame.turn
        turn = (self.frame.gradient @ local.reshape(n, 3 * m, 1))[:, :, 0]
        local -= np.cross(turn[:, None], self.frame.position)
        deformed = (local.reshape(n, -1) @ self.carry.T).reshape(n, -1, 3)
        nodal = np.einsum("sbi,sbi->sb", self.normal, deformed)
        nodal += (self.arm @ turn[:, :, None])[:, :, 0]
        nodal += (self.by_race @ moved[:, 3 * m :, None])[:, :, 0]
        return self.with_vertices(nodal, np.arange(n))

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

    def size(self, state: SolidState) -> Array:
        """Contact forces at ``points`` (N, a) [N]; zero at slopes."""
        b, p = self.normal.shape[1], self.gap.shape[1]
        at = self.among_points(state.pressure)
        return np.where(self.points < (b + p) // 2, at, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidLinearised:
    """Ring linearised at one state.

    A sector has n coordinates: three per master and, with a race, those of the race.
    """

    frames: tuple[SolidFrames, ...]
    """Frames of the segments, in the order of the strip."""
    gradient: Array
    """Derivative of the strain energy by the coordinates (N, n) [N]."""
    hessian: SectorMatrices | None
    """Tangent of the sectors, including the condensed contact of the wave generator
    [N/m]; None if it was not asked for."""
    pushed: Array
    """Contribution B^T W^-1 g of this contact to the gradient if the coordinates do not
    move: the negative forces of the wave generator on the coordinates (N, n) [N]."""
    bore: BoreContact
    race: RaceForces | None = None
    """Forces of a race, already included in gradient and tangent; None without."""

    def exchange(
        self,
        model: SolidSectorModel,
        state: SolidState,
        pressure: Array,
        switched: Mask,
        kept: Mask,
    ) -> SolidLinearised:
        """The same ring with the contact of some points of the bore inverted.

        Args:
            model: The 3D model.
            state: State at which the ring is linearised.
            pressure: Latest forces at the contact points (N, p) [N].
            switched: Points whose contact is inverted (N, p).
            kept: See :func:`linearise`.
        """
        touching = self.bore.active ^ switched
        touched = replace(state, pressure=pressure, touching=touching)
        bore = bore_contact(model, touched, self.frames[0], kept=kept)
        return replace(self, bore=bore, pushed=_pushed(model, bore))


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
    gradient = np.zeros((model.sectors, n))
    terms = list[tuple[Index, Array]]()
    bore = bore_contact(model, state, frames[0], kept=kept)
    loads = model.loads(state)
    for number, (segment, frame) in enumerate(
        zip(model.strip.segments, frames, strict=True)
    ):
        dofs = model.dofs(segment.masters)
        elastic = frame.deformation @ segment.stiffness
        gradient[:, dofs] += rotate_to_global(frame, project_to_frames(frame, elastic))
        if tangent:
            acting, turned = elastic, np.zeros(())
            if number == 0:
                acting = elastic - loads @ segment.loaded_from_masters
            force = project_to_frames(frame, acting)
            if number == 0:  # forces on the bore do not turn with the frame
                push = state.bore_force.reshape(bore.place.shape)
                moment, turned = dead_load_tangent(frame, bore.carry, bore.place, push)
                force += moment
            local = stiffness(segment, frame, force) + turned
            terms.append((dofs, matrices_in_global(frame, local)))
    if tangent:
        into, held = model.contact_dofs, bore.inverse @ bore.rows
        pressed = bore.rows.transpose(0, 2, 1) @ held
        if model.nonlinear and bore.active.any():
            pressed += sliding_tangent(
                model, state, bore.frame, bore.place, bore.weight, bore.size(state)
            )
        terms.append((into, pressed))
    race = None
    if model.race is not None and state.race is not None:
        race, dofs = (
            model.race.forces(state.race, state.wave_generator_angle),
            model.race_dofs,
        )
        gradient[:, dofs] += race.gradient
        if tangent:
            terms.append((dofs, race.hessian))
    return SolidLinearised(
        frames=frames,
        gradient=gradient,
        hessian=SectorMatrices(size=n, terms=tuple(terms)) if tangent else None,
        pushed=_pushed(model, bore),
        bore=bore,
        race=race,
    )


def _pushed(model: SolidSectorModel, bore: BoreContact) -> Array:
    """Negative forces of the wave generator if the coordinates do not move (N, n)."""
    pushed = np.zeros((model.sectors, model.size))
    free = bore.inverse @ bore.among_points(bore.free_gap)[:, :, None]
    pushed[:, model.contact_dofs] = (free.transpose(0, 2, 1) @ bore.rows)[:, 0]
    return pushed


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
    n, b = len(state.touching), len(model.strip.bore)
    local = model.bore_positions(frame, state)
    points = np.einsum("sij,spj->spi", frame.turn, local)
    if model.race is not None and state.race is not None:
        gap, normal, by_race = model.race.gap(state.race, points, model.bore_places)
    else:
        gap, normal, _ = model.wave_generator.gap(
            points.reshape(-1, 3), state.wave_generator_angle
        )
        gap, by_race = gap.reshape(n, b), np.zeros((n, b, 0))
    normal = normal.reshape(n, b, 3) @ frame.turn
    vertex, found, bend, covered = find_vertices(model, gap, state.shared, kept)
    # points that can touch, and points that do; slopes follow their vertices
    p, lines = b + vertex.shape[1], found.shape[1]
    at, rolls = np.arange(b, b + lines), np.arange(b + lines, p)
    present = np.ones((n, p), dtype=bool)
    present[:, at], present[:, rolls] = found, False
    present[:, :b] = ~covered
    if model.race is not None:
        present[:, :b] &= model.race.covers(model.strip.bore[:, 2])
    active = state.touching & present
    active[:, rolls] = active[:, at] & (state.pressure[:, at] > 0.0)
    touching = int(active.sum(axis=1).max(initial=0))
    points = np.argsort(~active, axis=1, kind="stable")[:, :touching]
    real = np.take_along_axis(active, points, axis=1)
    # weights of the nodes in the gaps that touch
    s, k = np.nonzero(real)
    point, weight = points[s, k], np.zeros((n, touching, b))
    nodal, across = point < b, point >= b
    weight[s[nodal], k[nodal], point[nodal]] = 1.0
    weight[s[across], k[across]] = vertex[s[across], point[across] - b]
    push = (weight[..., None] * normal[:, None]).reshape(n * touching, 3 * b)
    # their derivatives by the masters: deformation and rotation of the frame
    carry, m = teeth.loaded_from_masters[first:], frame.position.shape[1]
    carried = (push @ carry).reshape(n, touching, 3 * m)
    place = local - frame.centre[:, None] - teeth.position.mean(axis=0)
    arm = np.cross(place, normal)
    spun = spin(frame.position).reshape(n, 3 * m, 3)
    rows = carried + (weight @ arm + carried @ spun) @ frame.gradient
    rows = rows.reshape(n, touching * m, 3) @ frame.turn.transpose(0, 2, 1)
    rows = np.concatenate([rows.reshape(n, touching, 3 * m), weight @ by_race], axis=2)
    # compliance W between the points that touch and nodes, vertices and slopes
    compliance = teeth.compliance[first:, first:]
    moved = (push @ compliance).reshape(n, touching, b, 3)
    w = np.einsum("skbi,sbi->skb", moved, normal)
    w = np.concatenate([w, w @ vertex.transpose(0, 2, 1)], axis=2)
    # spring of a slope whose vertex carries the force lambda: compliance g''/lambda
    spring = np.zeros((n, p))
    loaded = np.where(active[:, rolls], state.pressure[:, at], 1.0)
    spring[:, rolls] = bend / loaded
    w[s, k, point] += spring[s, point]
    # its inverse over the points that touch
    both = real[:, :, None] & real[:, None, :]
    square = np.take_along_axis(w, points[:, None], axis=2)
    inverse = np.linalg.inv(np.where(both, square, np.eye(touching))) * both
    # gaps without the previous forces
    eased = (model.loads(state) @ teeth.compliance[:, first:]).reshape(n, b, 3)
    free = gap - np.einsum("sbi,sbi->sb", normal, eased)

    def with_vertices(of_nodes: Array) -> Array:
        return np.concatenate(
            [of_nodes, (vertex @ of_nodes[..., None])[..., 0]], axis=1
        )

    return BoreContact(
        gap=with_vertices(gap),
        normal=normal,
        vertex=vertex,
        found=found,
        present=present,
        active=active,
        points=points,
        weight=weight,
        rows=rows,
        free_gap=with_vertices(free),
        compliance=w,
        inverse=inverse,
        frame=frame,
        carry=carry,
        place=place,
        arm=arm,
        by_race=by_race,
    )

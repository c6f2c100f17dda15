"""Gradient and tangent of the ring at one state, in the bases of its nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.corotation import (
    Frames,
    elastic_force,
    projected,
    rotate,
    tangent,
    turned,
)
from swgjoint.fe.race import NODE, PlaneRaceForces
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.fe.superelement import Superelement
from swgjoint.fe.tooth_contact import Contacts, ToothContact

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Per sector, n degrees of freedom: 2 n_a, and those of a race.

    The basis of a node is the global frame, at the bore nodes normal and tangent of a
    rigid wave generator, so that touching nodes have one known and one free component.
    """

    element: Superelement
    frames: Frames
    dofs: Index
    """Those of the skeleton (2 n_a,)."""
    face_dofs: int
    """Of a face."""
    basis: Array
    """Columns in the global frame (N, n_a, 2, 2)."""
    turn: Array
    """Columns in the sector frames (N, n_a, 2, 2)."""
    gradient: Array
    """Derivative of energy and load potential (N, n) [N]."""
    hessian: Array
    """Second derivative (N, n, n) [N/m]."""
    wave_generator_gap: Array
    """(N, n_bore + 1) [m]."""
    normal_dofs: Index
    """Of the bore nodes of a sector, the corner of its first face included; normal to a
    rigid wave generator."""
    known: Mask
    """Components that the wave generator prescribes (N, n)."""
    value: Array
    """Their increments (N, n) [m]."""
    rotation: float
    """Best-fit rotation of the bore [rad]."""
    rotation_gradient: Array
    """(N, n) [rad/m]."""
    anchor: Array
    """Tangential direction at one node (N, n)."""
    anchor_stiffness: float
    """[N/m]."""
    flank: Array
    """Displacement of the flank nodes in the sector frames, manufacturing errors
    included (N, 2 n_b) [m]."""
    ring_elastic: Array
    """Elastic displacement of the circular spline's flanks (N_c, 2 n_c) [m]."""
    search: ToothContact
    race: PlaneRaceForces | None = None
    """Counted in gradient and tangent; None for a rigid wave generator."""
    race_rows: Array | None = None
    """Derivative of the gaps to the race (N, n_bore + 1, n)."""
    press: Array | None = None
    """Stiffness of the race under the bore nodes (n_bore + 1,) [N/m]."""

    @property
    def no_contacts(self) -> Contacts:
        """An empty set of candidates."""
        ring = self.search.circular_spline
        return Contacts.none(self.flank.shape[1], ring.flank_dofs)

    def anchored(self) -> Array:
        """Tangent with the anchor spring, known components replaced by identity."""
        matrix = self.hessian.copy()
        direction = self.anchor[0, :2]
        matrix[0, :2, :2] += self.anchor_stiffness * np.outer(direction, direction)
        matrix[self.known] = 0.0
        matrix.transpose(0, 2, 1)[self.known] = 0.0
        np.einsum("sii->si", matrix)[self.known] = self.anchor_stiffness
        return matrix

    def gap_gradient(self, contacts: Contacts) -> Array:
        """Derivative of the gaps by the skeleton in the node bases (n_contacts, n)."""
        s, frames = contacts.sector, self.frames
        count, n = len(s), frames.spin.shape[1]
        carried = contacts.weight @ self.element.flank_from_skeleton
        j_y = turned(frames.position[s].reshape(count, n // 2, 2)).reshape(count, n)
        arm = np.einsum("ki,ki->k", contacts.normal, turned(contacts.point))
        lever = arm - np.einsum("kn,kn->k", carried, j_y)
        rows = _to_basis(self.turn[s], carried + frames.spin[s] * lever[:, None])
        return self._spread(rows)

    def _spread(self, rows: Array) -> Array:
        """Rows by the skeleton as rows by all degrees of freedom of a sector."""
        spread = np.zeros((len(rows), self.gradient.shape[1]))
        spread[:, self.dofs] = rows
        return spread

    def in_global_frame(self, increment: Array) -> Array:
        """Increment in the node bases as vectors (N, n_a, 2)."""
        shaped = increment[:, self.dofs].reshape(*self.basis.shape[:2], 2)
        return np.asarray(np.einsum("snia,sna->sni", self.basis, shaped))

    def gap_after(self, increment: Array) -> Array:
        """Gaps of the bore nodes after an increment (N, n_bore + 1) [m]."""
        if self.race_rows is None:
            return np.asarray(self.wave_generator_gap + increment[:, self.normal_dofs])
        moved = np.einsum("sbn,sn->sb", self.race_rows, increment)
        return np.asarray(self.wave_generator_gap + moved)

    def pressure_after(self, increment: Array, residual: Array) -> Array:
        """Forces on the bore nodes if all of them touch (N, n_bore + 1) [N].

        Args:
            increment: In the node bases (N, n) [m].
            residual: What is left of the forces of rigid contact (N, n) [N].
        """
        if self.press is None:
            return self.normal_rows(residual)
        return np.asarray(-self.press * self.gap_after(increment))

    @property
    def contact_stiffness(self) -> Array | float:
        """Scale of a force between bore and wave generator [N/m]."""
        return self.anchor_stiffness if self.press is None else self.press

    def normal_rows(self, residual: Array) -> Array:
        """Normal components at the bore nodes, both sectors of a corner summed."""
        rows = residual[:, self.normal_dofs]
        rows[:, 0] += np.roll(residual[:, residual.shape[1] - 2], 1)
        return rows


def linearise(model: RingModel, state: State, torque: float | None) -> Linearised:
    """Linearise the ring.

    Args:
        model: The ring.
        state: Positions, active set and tooth forces.
        torque: T on the load, whole drive, None if the rotation is prescribed [N·m].
    """
    element = model.element
    size, n_a = element.face_size, len(element.skeleton)
    bore, nodes_of = slice(size - 1, n_a - size), model.bore_nodes
    frames, x = model.frames(state), model.skeleton(state)
    nodes = x[:, bore]
    alpha, race = state.wave_generator_angle, None
    basis = np.broadcast_to(np.eye(2), (model.sectors, n_a, 2, 2)).copy()
    if model.race is not None and state.race is not None:
        race = model.race.forces(state.race, alpha, nodes, state.touching)
        gap = race.gap
    else:
        gap, normal, curvature = model.wave_generator_gap(nodes, alpha)
        basis[:, bore, :, 0] = normal
        basis[:, bore, :, 1] = turned(normal)
    last = np.roll(basis[:, :size], -1, axis=0)
    last[-1] *= model.closure
    basis[:, n_a - size :] = last
    turn = np.moveaxis(
        rotate(np.moveaxis(basis, 3, 2), -frames.angle[:, None, None]), 2, 3
    )

    # elastic forces and tangent in the sector frames, then in the bases
    elastic = elastic_force(element, frames)
    total = elastic - state.flank_force @ element.flank_from_skeleton
    gradient = _to_basis(turn, projected(frames, elastic))
    hessian = np.einsum(
        "snia,snimj,smjb->snamb",
        turn,
        tangent(element, frames, total).reshape(model.sectors, n_a, 2, n_a, 2),
        turn,
        optimize=True,
    ).reshape(model.sectors, 2 * n_a, 2 * n_a)
    if race is None:
        # sliding over a curved wave generator turns the contact force
        slide = 2 * nodes_of + 1
        pressed = np.where(state.touching, state.pressure, 0)
        hessian[:, slide, slide] -= pressed * curvature

    rotation, slope = model.best_fit_rotation(nodes)
    rows = np.zeros((model.sectors, n_a, 2))
    rows[:, bore] = np.einsum("sni,snia->sna", slope, basis[:, bore])
    rotation_gradient = rows.reshape(model.sectors, -1)
    if torque is not None:
        gradient = gradient + torque / model.copies * rotation_gradient

    # the normal displacement of touching nodes closes their gap
    known = np.zeros((model.sectors, n_a, 2), dtype=bool)
    value = np.zeros((model.sectors, n_a, 2))
    if race is None:
        known[:, bore, 0] = state.touching
        value[:, bore, 0] = np.where(state.touching, -gap, 0.0)
    known[:, -1, 0] = np.roll(known[:, size - 1, 0], -1)
    value[:, -1, 0] = np.roll(value[:, size - 1, 0], -1)

    anchor = np.zeros((model.sectors, 2 * n_a))
    anchor[0, :2] = turned(x[0, 0]) / np.hypot(*x[0, 0])
    centre = frames.position.reshape(model.sectors, n_a, 2).mean(axis=1)
    seen = frames.angle - state.ring_rotation
    ring_elastic = model.ring_displacement(state)
    flank = frames.displacement @ element.flank_from_skeleton.T
    flank += state.flank_force @ element.flank_compliance
    found = Linearised(
        element=element,
        frames=frames,
        dofs=model.dofs,
        face_dofs=model.face_dofs,
        basis=basis,
        turn=turn,
        gradient=gradient,
        hessian=hessian,
        wave_generator_gap=gap,
        normal_dofs=2 * nodes_of,
        known=known.reshape(model.sectors, -1),
        value=value.reshape(model.sectors, -1),
        rotation=rotation,
        rotation_gradient=rotation_gradient,
        anchor=anchor,
        anchor_stiffness=float(np.mean(np.diag(element.stiffness))),
        flank=model.placed(flank, model.tooth_shift),
        ring_elastic=ring_elastic,
        search=ToothContact(
            rubs=model.friction is not None,
            element=element,
            circular_spline=model.circular_spline,
            ring_flank=model.placed(ring_elastic, model.ring_tooth_shift),
            angle=seen,
            bearing=seen - np.arctan2(centre[:, 0], centre[:, 1]),
        ),
    )
    return found if race is None else _on_race(model, found, race)


def _on_race(model: RingModel, ring: Linearised, race: PlaneRaceForces) -> Linearised:
    """The ring with the race, whose nodes join the faces of the sectors."""
    assert model.race is not None
    size = len(model.dofs) + len(model.race_dofs)
    into = np.concatenate([model.dofs[_pairs(model.bore_nodes)], model.race_dofs])
    # half a ring: the last node continues as the opposite of the first
    sign = np.ones((model.sectors, size))
    sign[-1, model.race_dofs[-NODE:]] = model.closure

    def spread(rows: Array) -> Array:
        wide = np.zeros((*rows.shape[:-1], size))
        wide[..., model.dofs] = rows
        return wide

    gradient, hessian = spread(ring.gradient), np.zeros((model.sectors, size, size))
    hessian[:, model.dofs[:, None], model.dofs] = ring.hessian
    gradient[:, into] += sign[:, into] * race.gradient
    hessian[:, into[:, None], into] += (
        sign[:, into, None] * race.hessian * sign[:, None, into]
    )
    known = np.zeros(gradient.shape, dtype=bool)
    known[:, model.dofs] = ring.known
    known[:, into] |= race.fixed
    rows = np.zeros((*race.gap.shape, size))
    rows[..., into] = race.rows
    return replace(
        ring,
        gradient=gradient,
        hessian=hessian,
        known=known,
        value=spread(ring.value),
        rotation_gradient=spread(ring.rotation_gradient),
        anchor=spread(ring.anchor),
        race=race,
        race_rows=rows * sign[:, None],
        press=model.race.press,
    )


def _pairs(nodes: Index) -> Index:
    """Degrees of freedom x, y of nodes."""
    return np.asarray((2 * nodes[:, None] + np.arange(2)).ravel())


def _to_basis(turn: Array, rows: Array) -> Array:
    """Row vectors per sector or contact into the bases of the nodes."""
    shaped = rows.reshape(len(rows), rows.shape[1] // 2, 2)
    return np.asarray(np.einsum("sni,snia->sna", shaped, turn)).reshape(rows.shape)

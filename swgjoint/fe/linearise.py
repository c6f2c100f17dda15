"""Gradient and tangent of the ring at one state, in the bases of its nodes."""

from __future__ import annotations

from dataclasses import dataclass

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
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.fe.superelement import Superelement
from swgjoint.fe.tooth_contact import Contacts, ToothContact

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Per sector, n = 2 n_a degrees of freedom.

    The basis of a node is the global frame, at the bore nodes normal and tangent of the
    wave generator, so that touching nodes have one known and one free component.
    """

    element: Superelement
    frames: Frames
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
    """Of the bore nodes of a sector, the corner of its first face included."""
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
        return _to_basis(self.turn[s], carried + frames.spin[s] * lever[:, None])

    def in_global_frame(self, increment: Array) -> Array:
        """Increment in the node bases as vectors (N, n_a, 2)."""
        shaped = increment.reshape(*self.basis.shape[:2], 2)
        return np.asarray(np.einsum("snia,sna->sni", self.basis, shaped))

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
    gap, normal, curvature = model.wave_generator_gap(nodes, state.wave_generator_angle)

    basis = np.broadcast_to(np.eye(2), (model.sectors, n_a, 2, 2)).copy()
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
    # sliding over a curved wave generator turns the contact force
    slide = 2 * nodes_of + 1
    hessian[:, slide, slide] -= np.where(state.touching, state.pressure, 0) * curvature

    rotation, slope = model.best_fit_rotation(nodes)
    rows = np.zeros((model.sectors, n_a, 2))
    rows[:, bore] = np.einsum("sni,snia->sna", slope, basis[:, bore])
    rotation_gradient = rows.reshape(model.sectors, -1)
    if torque is not None:
        gradient = gradient + torque / model.copies * rotation_gradient

    # the normal displacement of touching nodes closes their gap
    known = np.zeros((model.sectors, n_a, 2), dtype=bool)
    value = np.zeros((model.sectors, n_a, 2))
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
    return Linearised(
        element=element,
        frames=frames,
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


def _to_basis(turn: Array, rows: Array) -> Array:
    """Row vectors per sector or contact into the bases of the nodes."""
    shaped = rows.reshape(len(rows), rows.shape[1] // 2, 2)
    return np.asarray(np.einsum("sni,snia->sna", shaped, turn)).reshape(rows.shape)

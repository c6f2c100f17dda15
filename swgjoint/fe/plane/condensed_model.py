"""The 2D drive linearised at an equilibrium and condensed to its contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.fe.common.cyclic import CyclicFactor
from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.common.influence import Gaps, Influence, pivot_system
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.plane.linearise import Linearised
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array, Index, Mask

REACH = 0.03
"""Largest gap of a contact candidate, in lobe heights [-]."""
ALIKE = 1e-5
"""Distance below which two points of a flank count as one [m]. It is a tenth of the
half length of a contact patch."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedModel:
    """A ring linearised at an equilibrium and solved for unit forces at its contacts.

    The condensed system of the teeth has n + 3 unknowns: n contact forces, the force of
    the anchor, the multiplier of the flexspline's rotation and the rotation of the
    circular spline. N sectors have n_dofs degrees of freedom each.
    """

    model: SectorModel
    """The 2D model."""
    state: State
    """The equilibrium."""
    linear: Linearised
    """The model linearised there."""
    circular_spline_is_output: bool
    """Whether the circular spline is the output."""
    contacts: Contacts
    """Tooth contacts, n of them."""
    carries: Mask
    """Whether each contact carries force (n,)."""

    @cached_property
    def _factor(self) -> CyclicFactor:
        """Factorised tangent with the anchor spring."""
        return CyclicFactor(self.linear.anchor_tangent(), self.linear.face_dofs)

    @cached_property
    def _rows(self) -> Array:
        """Derivatives of the tooth gaps with respect to nodes (n, n_dofs) [-]."""
        return self.linear.gap_gradient(self.contacts)

    @cached_property
    def _loads(self) -> Array:
        """Unit loads on teeth, anchor and flexspline rotation (N, n_dofs, n + 2)."""
        linear, n = self.linear, len(self.contacts)
        loads = np.zeros((*linear.gradient.shape, n + 2))
        loads[self.contacts.sector, :, np.arange(n)] = self._rows
        loads[:, :, n], loads[:, :, n + 1] = linear.anchor, linear.rotation_gradient
        return loads

    @cached_property
    def _response(self) -> Array:
        """Displacements under these loads, then under minus the gradient.

        Shape (N, n_dofs, n + 3).
        """
        return self._solved(
            np.concatenate([self._loads, -self.linear.gradient[:, :, None]], axis=2)
        )

    def _solved(self, right: Array) -> Array:
        """Displacements (N, n_dofs, k) under right-hand sides of that shape.

        Rows of fixed degrees of freedom are set to zero in ``right`` itself.
        """
        right[self.linear.fixed] = 0.0
        return self._factor.solve(right)

    def torque_response(self) -> Array:
        """Displacements per output torque of the whole drive (N, n_dofs) [m/(N·m)]."""
        system, _ = self._teeth
        n = len(self.contacts)
        free = [n, n + 1, n + 2] if self.circular_spline_is_output else [n]
        inside = np.concatenate([np.flatnonzero(self.carries), free])
        z, at = np.zeros(n + 3), np.ix_(inside, inside)
        if self.circular_spline_is_output:
            right = (inside == n + 2) / self.model.copies
        else:
            z[n + 1] = -1.0 / self.model.copies
            right = -system[inside, n + 1] * z[n + 1]
        z[inside] = np.linalg.solve(system[at], right)
        return np.asarray(self._response[:, :, :-1] @ z[: n + 2])

    @cached_property
    def _teeth(self) -> tuple[Array, Array]:
        """Linear system of the tooth gaps, with three more rows.

        Its rows are the tooth gaps, the displacement of the anchor (which keeps the
        tangent regular), the rotation of the flexspline, and the moment on the circular
        spline.

        Returns:
            Matrix (n + 3, n + 3) and offset (n + 3,).
        """
        model, state, linear = self.model, self.state, self.linear
        contacts, element, n = self.contacts, model.element, len(self.contacts)
        system, offset = np.zeros((n + 3, n + 3)), np.zeros(n + 3)
        answers = self._answers(self._response)
        system[: n + 2, : n + 2], offset[: n + 2] = answers[:, :-1], answers[:, -1]
        local = contacts.weight @ element.flank_compliance
        same = contacts.sector[:, None] == contacts.sector[None, :]
        system[:n, :n] += np.where(same, local @ contacts.weight.T, 0.0)
        compliance = model.circular_spline.compliance
        if compliance is not None:
            system[:n, :n] += compliance.contact_compliance(
                contacts.tooth,
                contacts.circular_spline_weight,
                model.circular_spline_teeth,
            )
        system[n, n] -= 1.0 / linear.anchor_stiffness
        # turning the circular spline towards the teeth closes each gap by its lever arm
        arm = np.einsum("ki,ki->k", rotate_right_angle(contacts.point), contacts.normal)
        system[:n, n + 2] = system[n + 2, :n] = -arm
        # gaps without the tooth forces of the state
        old = np.einsum("kb,kb->k", local, state.flank_force[contacts.sector])
        old += np.einsum(
            "kb,kb->k",
            contacts.circular_spline_weight,
            linear.circular_spline_elastic[contacts.tooth],
        )
        offset[:n] += contacts.gap - old
        if self._strips is not None:
            compliant, approach = self._strips.linearise()
            system[:n, :n] += compliant
            offset[:n] += approach
        if self.circular_spline_is_output:
            offset[n + 2] = -state.torque / model.copies
        return system, offset

    @cached_property
    def _strips(self) -> Strips | None:
        """Contact strips of the teeth; None if the flanks conform or do not indent."""
        law, state = self.model.indentation, self.state
        if law is None or np.isinf(law.radius):
            return None
        return Strips.from_contacts(
            law, self.contacts, state.contacts, state.tooth_force
        )

    def _answers(self, response: Array) -> Array:
        """Changes of tooth gaps, anchor and rotation (n + 2, n_columns).

        Args:
            response: Displacements (N, n_dofs, n_columns).
        """
        n = len(self.contacts)
        return np.concatenate(
            [
                at_sectors(self._rows, self.contacts.sector, response),
                np.einsum("snf,snl->fl", self._loads[:, :, n:], response),
            ]
        )

    def _system(self, supports: Supports) -> tuple[Array, Array]:
        """System :attr:`_teeth` with k supports of the bore inserted after the teeth.

        Returns:
            Matrix (n + k + 3, n + k + 3) and offset (n + k + 3,).
        """
        n, sector = len(self.contacts), supports.intervals.sector
        k = len(sector)
        m = n + k
        load = np.zeros((*self.linear.gradient.shape, k))
        load[sector, :, np.arange(k)] = supports.loads
        supported = self._solved(load)
        teeth = np.r_[0:n, m : m + 3]
        system, offset = np.zeros((m + 3, m + 3)), np.zeros(m + 3)
        system[np.ix_(teeth, teeth)], offset[teeth] = self._teeth
        system[np.ix_(teeth[:-1], np.arange(n, m))] = self._answers(supported)
        answers = supports.answers(self._response)
        system[n:m, teeth[:-1]], offset[n:m] = answers[:, :-1], answers[:, -1]
        system[n:m, n:m] = supports.answers(supported)
        system[np.arange(n, m), np.arange(n, m)] += supports.own
        offset[n:m] += supports.start
        return system, offset

    def influence(self, supports: Supports) -> Influence:
        """Complementarity problem of the tooth contacts and of bore supports."""
        model, state, contacts = self.model, self.state, self.contacts
        system, offset = self._system(supports)
        n, m = len(contacts), len(contacts) + len(supports.intervals.sector)
        return pivot_system(
            system,
            offset,
            Gaps(
                sector=contacts.sector,
                tooth=contacts.tooth,
                direction=np.stack(
                    [
                        _by_shift(contacts.weight),
                        _by_shift(contacts.circular_spline_weight),
                    ]
                ),
                by_tilt=np.zeros((n, 2)),  # a 2D model has no axis to tilt
                carries=self.carries,
                strips=self._strips,
            ),
            closed_supports=supports.closed,
            free=[m, m + 1, m + 2] if self.circular_spline_is_output else [m],
            output=m + 2 if self.circular_spline_is_output else m + 1,
            sign=(1.0 if self.circular_spline_is_output else -1.0) / model.copies,
            angle=state.circular_spline_rotation
            if self.circular_spline_is_output
            else state.rotation,
            torque=state.torque,
        )


def at_sectors(rows: Array, sector: Index, response: Array) -> Array:
    """Products of rows with the responses of their sectors (k, n_columns).

    Args:
        rows: One row per product (k, n).
        sector: Sector of each row (k,).
        response: Responses of all sectors (N, n, n_columns).
    """
    products = np.empty((len(rows), response.shape[2]))
    for number in np.unique(sector):
        here = sector == number
        products[here] = rows[here] @ response[number]
    return products


def _by_shift(weight: Array) -> Array:
    """Derivatives of the gaps with respect to a shift of the whole tooth (n, 2) [-]."""
    return np.asarray(weight.reshape(len(weight), -1, 2).sum(axis=1))


def distinct(contacts: Contacts, state: State) -> tuple[Contacts, Mask]:
    """Contacts without those that almost coincide, and which of them carry force.

    If two points of a flank are closer than :data:`ALIKE`, only the one with the larger
    force is kept: two nearly dependent contacts would make the system ill-conditioned.

    Args:
        contacts: Candidates.
        state: Equilibrium whose tooth forces the candidates inherit.

    Returns:
        The remaining contacts, and whether each carries force.
    """
    held = state.contacts
    force = np.zeros(len(contacts))
    if held is not None and len(held):
        np.add.at(force, held.nearest_in(contacts), state.tooth_force)
    key = 2 * contacts.sector + contacts.side
    stays = np.ones(len(contacts), bool)
    for k in np.argsort(-force, kind="stable"):
        near = (key == key[k]) & stays
        near &= np.abs(contacts.station - contacts.station[k]) < ALIKE
        near[k] = False
        if stays[k]:
            stays &= ~near
    index = np.flatnonzero(stays)
    return contacts.chosen(index), force[index] > 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Intervals:
    """Selection of k intervals of the bore, with p stations each."""

    sector: Index
    """Sector of each interval (k,)."""
    number: Index
    """Number of each interval within its sector (k,)."""
    share: Array
    """Weights of the stations in the mean over their interval (k, p)."""

    def mean(self, values: Array) -> Array:
        """Means over the intervals (k, ...) of values at all stations (N, q, ...)."""
        p = self.share.shape[1]
        shaped = values.reshape(len(values), -1, p, *values.shape[2:])
        there = shaped[self.sector, self.number]
        return np.asarray(np.einsum("kp,kp...->k...", self.share, there))


@dataclass(frozen=True, kw_only=True, eq=False)
class Supports:
    """The k intervals of the bore that touch the wave generator or may do so.

    All intervals have the same number of stations: those between two bore nodes, or
    those of a part of the sector.

    The stations of an interval share one force F and one mean gap g; K is the sum of
    their stiffnesses. The slack s = g + F/K of the layer below them satisfies F s = 0.
    An open support has the unknown F and the response s; a closed one has the unknown s
    and the response F = K (s - g).
    """

    intervals: _Intervals
    """Where the supports are."""
    closed: Mask
    """Whether each support touches the wave generator (k,)."""
    rows: Array
    """Derivative of g with respect to the degrees of freedom of the sector (k, n) [-].
    """
    stiffness: Array
    """Stiffness K (k,) [N/m]."""
    start: Array
    """Response at the state: F [N] of closed supports, g [m] of open ones (k,)."""

    @classmethod
    def from_state(cls, linear: Linearised, state: State, used: Mask) -> Supports:
        """Supports of selected intervals.

        Args:
            linear: The model linearised at the state.
            state: The equilibrium.
            used: Whether to use each interval (N, intervals).
        """
        touching = state.touching.reshape(*used.shape, -1)
        p = touching.shape[2]
        sector, interval = np.nonzero(used)
        touches = touching[sector, interval]
        is_closed = np.asarray(touches.any(axis=1))
        used_there = touches | ~is_closed[:, None]
        k = used_there * linear.stations.stiffness.reshape(-1, p)[interval]
        stiffness = k.sum(axis=1)
        there = _Intervals(sector=sector, number=interval, share=k / stiffness[:, None])
        rows = np.zeros((len(sector), linear.gradient.shape[1]))
        rows[:, linear.gap_dofs] = there.mean(linear.gap_gradients())
        return cls(
            intervals=there,
            closed=is_closed,
            rows=rows,
            stiffness=stiffness,
            start=np.where(is_closed, -stiffness, 1.0) * there.mean(linear.gap),
        )

    @property
    def loads(self) -> Array:
        """Nodal forces per unit of each support's unknown F or s (k, n)."""
        return np.where(self.closed, self.stiffness, 1.0)[:, None] * self.rows

    @property
    def own(self) -> Array:
        """Response of the layer itself per unit of each support's unknown (k,)."""
        return np.where(self.closed, self.stiffness, 1.0 / self.stiffness)

    def answers(self, response: Array) -> Array:
        """Responses of the supports to displacements (k, n_columns).

        The response :attr:`own` of the layer is not included.

        Args:
            response: Displacements of the sectors (N, n, n_columns) [m].
        """
        moved = at_sectors(self.rows, self.intervals.sector, response)
        return np.asarray(np.where(self.closed, -self.stiffness, 1.0)[:, None] * moved)

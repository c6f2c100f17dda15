"""The 2D drive linearised at an equilibrium and condensed to its contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.common.influence import Gaps, Influence, pivot_system
from swgjoint.fe.common.ring_factor import RingFactor
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
    def _factor(self) -> RingFactor:
        """Factorised tangent with the anchor spring."""
        return RingFactor(
            self.linear.hessian,
            self.linear.face_dofs,
            np.unique(self.contacts.sector),
        )

    @cached_property
    def _rows(self) -> Array:
        """Derivatives of the tooth gaps with respect to nodes (n, n_dofs) [-]."""
        return self.linear.gap_gradient(self.contacts)

    @cached_property
    def _loads(self) -> Array:
        """Unit loads on anchor and flexspline rotation, and minus the gradient.

        Shape (N, n_dofs, 3).
        """
        linear = self.linear
        loads = np.stack(
            [linear.anchor, linear.rotation_gradient, -linear.gradient], axis=-1
        )
        loads[linear.fixed] = 0.0
        return loads

    def _products(self, sector: Index, rows: Array) -> Array:
        """Products of :attr:`_loads` and of k rows with the compliance of the ring.

        Args:
            sector: Sector of each row (k,).
            rows: Loads on these sectors (k, n_dofs).

        Returns:
            Symmetric matrix (3 + k, 3 + k).
        """
        free = np.where(self.linear.fixed[sector], 0.0, rows)
        return self._factor.condense(self._loads, sector, free)

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
        load = self._loads[:, :, :2] @ z[n : n + 2]
        np.add.at(load, self.contacts.sector, z[:n, None] * self._rows)
        return self._factor.solve(load[:, :, None])[:, :, 0]

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
        products = self._products(contacts.sector, self._rows)
        order = np.r_[3 : n + 3, 0, 1]
        system[: n + 2, : n + 2] = products[np.ix_(order, order)]
        offset[: n + 2] = products[order, 2]
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

    def _system(self, supports: Supports) -> tuple[Array, Array]:
        """System :attr:`_teeth` with k supports of the bore inserted after the teeth.

        Returns:
            Matrix (n + k + 3, n + k + 3) and offset (n + k + 3,).
        """
        n, sector = len(self.contacts), supports.intervals.sector
        k = len(sector)
        m = n + k
        products = self._products(
            np.concatenate([self.contacts.sector, sector]),
            np.concatenate([self._rows, supports.loads]),
        )
        teeth = np.r_[0:n, m : m + 3]
        system, offset = np.zeros((m + 3, m + 3)), np.zeros(m + 3)
        system[np.ix_(teeth, teeth)], offset[teeth] = self._teeth
        # rows of the supports in the products, and those of teeth, anchor and rotation
        here, there = np.arange(n + 3, m + 3), np.r_[3 : n + 3, 0, 1]
        supported = products[np.ix_(there, here)]
        system[np.ix_(teeth[:-1], np.arange(n, m))] = supported
        # the response of a closed support is a force, which decreases with the gap
        sign = np.where(supports.closed, -1.0, 1.0)
        system[n:m, teeth[:-1]] = sign[:, None] * supported.T
        system[n:m, n:m] = sign[:, None] * products[np.ix_(here, here)]
        offset[n:m] = sign * products[here, 2]
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
        weight = np.zeros((len(sector), *used.shape[1:], p))
        weight[np.arange(len(sector)), interval] = there.share
        weight = weight.reshape(len(sector), linear.gap.shape[1])
        return cls(
            intervals=there,
            closed=is_closed,
            rows=linear.mean_gap_gradient(sector, weight),
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

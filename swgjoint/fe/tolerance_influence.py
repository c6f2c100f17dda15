"""How the gap of every tooth acts on the output of the drive in the plane."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.corotation import rotate, turned
from swgjoint.fe.cyclic import CyclicFactor
from swgjoint.fe.indentation import Strips
from swgjoint.fe.influence import Gaps, Influence, pivoted
from swgjoint.fe.linearise import Linearised, linearise
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.fe.tooth_contact import Contacts

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

REACH = 0.03
"""Gap up to which a contact may close, in lobe heights."""
STATIONS = 30
"""Points along a flank that may touch, beside those of the perfect drive: contacts
wander along flanks that conform."""
SUPPORTS = 3
"""Intervals of the bore of a sector that may touch the wave generator, beside those
that do: with two of them lots are 1.04 % of their peak to peak off full solves."""


def influence(model: RingModel, state: State, *, ring_is_output: bool) -> Influence:
    """Condense a drive with perfect teeth at an equilibrium.

    Args:
        model: All sectors, an elastic circular spline, a rigid wave generator, no
            errors of the teeth, no friction.
        state: The equilibrium.
        ring_is_output: Whether the circular spline is the output.
    """
    shifts = (model.tooth_shift, model.ring_tooth_shift)
    flawed = any(shift is not None and shift.any() for shift in shifts)
    if model.half or model.friction is not None or flawed:
        raise ValueError("needs all sectors, without friction and errors of the teeth")
    if model.race is not None:
        raise ValueError("needs a rigid wave generator")
    element, compliance = model.element, model.circular_spline.compliance
    assert compliance is not None
    ring = linearise(model, state, None if ring_is_output else state.torque)
    contacts, carries = _tooth_contacts(model, ring, state)
    supports = _Supports.of(model, ring, state)
    n, m = len(contacts), len(contacts) + len(supports.sector)
    rows = ring.gap_gradient(contacts)

    # columns: forces on teeth, forces or slacks at the wave generator, then the anchor
    # that keeps the rotation regular and the rotation of the flexspline
    load = np.zeros((*ring.gradient.shape, m + 2))
    load[contacts.sector, :, np.arange(n)] = rows
    load[supports.sector, :, np.arange(n, m)] = supports.loads
    load[:, :, m], load[:, :, m + 1] = ring.anchor, ring.rotation_gradient
    right = np.concatenate([load, -ring.gradient[:, :, None]], axis=2)
    right[ring.fixed] = 0.0
    response = CyclicFactor(ring.anchored(), ring.face_dofs).solve(right)

    # gaps, or forces where closed; the equations of anchor and rotation; the rotation
    # of the circular spline, which turns towards the teeth with a lever arm
    system = np.zeros((m + 3, m + 3))
    answers = np.concatenate(
        [
            np.einsum("kn,knl->kl", rows, response[contacts.sector]),
            supports.answers(response),
            np.einsum("snf,snl->fl", load[:, :, m:], response),
        ]
    )
    system[: m + 2, : m + 2], offset = answers[:, :-1], answers[:, -1]
    system[np.arange(n, m), np.arange(n, m)] += supports.own
    local = contacts.weight @ element.flank_compliance
    same = contacts.sector[:, None] == contacts.sector[None, :]
    system[:n, :n] += np.where(same, local @ contacts.weight.T, 0.0)
    system[:n, :n] += compliance.between(
        contacts.tooth, contacts.ring_weight, model.ring_teeth
    )
    system[m, m] -= 1.0 / ring.anchor_stiffness
    arm = np.einsum("ki,ki->k", turned(contacts.point), contacts.normal)
    system[:n, m + 2] = system[m + 2, :n] = -arm
    # gaps as if the tooth forces of the state were gone
    old = np.einsum("kb,kb->k", local, state.flank_force[contacts.sector])
    old += np.einsum(
        "kb,kb->k", contacts.ring_weight, ring.ring_elastic[contacts.tooth]
    )
    offset[:n] += contacts.gap - old
    if model.indentation is not None:
        strips = Strips.of(
            model.indentation, contacts, state.contacts, state.tooth_force
        )
        compliant, approach = strips.linearised()
        system[:n, :n] += compliant
        offset[:n] += approach
    offset[n:m] += supports.start
    offset = np.append(offset, -state.torque if ring_is_output else 0.0)

    found = pivoted(
        system,
        offset,
        Gaps(
            sector=contacts.sector,
            tooth=contacts.tooth,
            direction=np.stack(
                [_by_shift(contacts.weight), _by_shift(contacts.ring_weight)]
            ),
            by_tilt=np.zeros((n, 2)),  # a plane has no axis
            carries=carries,
        ),
        closed_supports=supports.closed,
        free=[m, m + 1, m + 2] if ring_is_output else [m],
        output=m + 2 if ring_is_output else m + 1,
        sign=1.0 if ring_is_output else -1.0,
        angle=state.ring_rotation if ring_is_output else state.rotation,
        torque=state.torque,
    )
    return replace(found, supports=supports.place)


def _by_shift(weight: Array) -> Array:
    """Derivative by a common shift of all flank nodes (n, 2)."""
    return np.asarray(weight.reshape(len(weight), -1, 2).sum(axis=1))


def _tooth_contacts(
    model: RingModel, ring: Linearised, state: State
) -> tuple[Contacts, Mask]:
    """Points that may touch, and which of them carry force at the state."""
    held = state.contacts
    if held is None or not len(held):
        raise ValueError("needs an equilibrium whose teeth carry force")
    reach = REACH * model.lobe_height
    near = ring.search.search(ring.flank, reach, held)
    stations, step = np.linspace(*model.element.flank_range, STATIONS, retstep=True)
    flanks = np.unique(2 * near.sector + near.side)
    key = np.repeat(flanks, STATIONS)
    place = np.tile(stations, flanks.size)
    beside = (2 * near.sector + near.side)[:, None] == key
    beside &= np.abs(near.station[:, None] - place) < 0.5 * step
    added = np.flatnonzero(~beside.any(axis=0))
    more = near.chosen(np.zeros(added.size, dtype=np.int64))
    sector, side = np.divmod(key[added], 2)
    more = replace(more, sector=sector, side=side, station=place[added])
    found = ring.search.search(ring.flank, reach, Contacts.joined(held, more))
    nearest = held.nearest_in(found)
    carries = np.zeros(len(found), bool)
    carries[nearest] = True
    return found, carries


@dataclass(frozen=True, kw_only=True, eq=False)
class _Supports:
    """Intervals of the bore that touch the wave generator or may do so; k of them.

    Stations of an interval share one force F and one mean gap g, K is their stiffness.
    With the slack s = g + F/K of the layer below them F s = 0: an open support takes F
    and answers with s, a closed one takes s and answers with F = K (s - g).
    """

    sector: Index
    closed: Mask
    rows: Array
    """Derivative of g by the degrees of freedom of the sector (k, n)."""
    stiffness: Array
    """K (k,) [N/m]."""
    start: Array
    """F at the state where closed, elsewhere g (k,) [N], [m]."""
    place: Array
    """In the frame of the wave generator (k, 2) [m]."""

    @classmethod
    def of(cls, model: RingModel, ring: Linearised, state: State) -> _Supports:
        per_interval = model.stations.per_interval
        shape = (model.sectors, -1, per_interval)
        gap, touching = ring.gap.reshape(shape), state.touching.reshape(shape)
        closed = np.asarray(touching.any(axis=2))
        spread = np.arange(SUPPORTS) * closed.shape[1] // SUPPORTS
        used = closed.copy()
        near = gap[:, spread].min(axis=2) < REACH * model.lobe_height
        used[:, spread] |= near
        sector, interval = np.nonzero(used)
        there = touching[sector, interval] | ~closed[sector, interval][:, None]
        k = there * model.stations.stiffness.reshape(shape[1:])[interval]
        stiffness = k.sum(axis=1)
        share = k / stiffness[:, None]

        def mean(values: Array) -> Array:
            """Of the stations of every support."""
            by_interval = values.reshape(*shape, *values.shape[2:])
            return np.asarray(
                np.einsum("kp,kp...->k...", share, by_interval[sector, interval])
            )

        rows = np.zeros((len(sector), ring.gradient.shape[1]))
        rows[:, ring.gap_dofs] = mean(ring.gap_gradients())
        is_closed = closed[sector, interval]
        start = np.where(is_closed, -stiffness, 1.0) * mean(ring.gap)
        return cls(
            sector=sector,
            closed=is_closed,
            rows=rows,
            stiffness=stiffness,
            start=start,
            place=rotate(mean(model.bore_points(state)), -state.wave_generator_angle),
        )

    @property
    def loads(self) -> Array:
        """Forces of what the supports take (k, n)."""
        return np.where(self.closed, self.stiffness, 1.0)[:, None] * self.rows

    @property
    def own(self) -> Array:
        """Answers of the layer itself to what the supports take (k,)."""
        return np.where(self.closed, self.stiffness, 1.0 / self.stiffness)

    def answers(self, response: Array) -> Array:
        """Answers to displacements (N, n, n_columns), the layer's left out."""
        moved = np.einsum("kn,knl->kl", self.rows, response[self.sector])
        return np.asarray(np.where(self.closed, -self.stiffness, 1.0)[:, None] * moved)

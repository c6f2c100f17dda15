"""How the gap of every tooth acts on the output of the 2D drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.condensed_ring import REACH, CondensedRing, Supports, distinct
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.linearise import Linearised, linearise
from swgjoint.fe.plane.ring import RingModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Mask

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
    assert model.circular_spline.compliance is not None
    ring = linearise(model, state, None if ring_is_output else state.torque)
    contacts, carries = _tooth_contacts(model, ring, state)
    supports = Supports.from_state(ring, state, _near_supports(model, ring, state))
    drive = CondensedRing(
        model=model,
        state=state,
        ring=ring,
        ring_is_output=ring_is_output,
        contacts=contacts,
        carries=carries,
    )
    place = supports.intervals.mean(model.bore_points(state))
    place = rotate(place, -state.wave_generator_angle)
    return replace(drive.influence(supports), supports=place)


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
    found = ring.search.search(ring.flank, reach, Contacts.join(held, more))
    return distinct(found, state)


def _near_supports(model: RingModel, ring: Linearised, state: State) -> Mask:
    """Intervals of the bore that touch, and some of those that may (N, intervals)."""
    shape = (model.sectors, -1, model.stations.per_interval)
    gap = ring.gap.reshape(shape)
    used = np.asarray(state.touching.reshape(shape).any(axis=2))
    spread = np.arange(SUPPORTS) * used.shape[1] // SUPPORTS
    used[:, spread] |= gap[:, spread].min(axis=2) < REACH * model.lobe_height
    return used

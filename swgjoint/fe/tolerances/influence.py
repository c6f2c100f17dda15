"""Influence of every tooth gap on the output of the 2D drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.condensed_model import REACH, CondensedModel, Supports, distinct
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.linearise import Linearised, linearise
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Mask

STATIONS = 30
"""Number of possible contact points along a flank, in addition to those of the perfect
drive, because contacts move along conforming flanks."""
SUPPORTS = 500
"""Largest number of intervals into which the bore is divided, each of which touches the
wave generator or not. With 480 of them, output angles of the reference drive deviate
from full solves by up to 0.13 % of their peak-to-peak value at zero torque and 2.5 % at
twice the rated torque; with 240, by 0.23 and 2.4 %; with the 1,200 intervals between
bore nodes, by 0.07 and 1.6 %. A drive that is pressed on its wave generator all around
takes thirty times as long with all intervals as with 400."""


def influence(
    model: SectorModel, state: State, *, circular_spline_is_output: bool
) -> Influence:
    """Influence of every tooth gap on the output, linearised at an equilibrium.

    Args:
        model: 2D model of the whole drive with an elastic circular spline, without
            tooth errors and friction. Balls of a bearing keep their state: pressed or
            free.
        state: The equilibrium.
        circular_spline_is_output: Whether the circular spline is the output.

    Raises:
        ValueError: If the model does not meet these conditions, or no tooth carries
            force at the equilibrium.
    """
    shifts = (model.tooth_shift, model.circular_spline_tooth_shift)
    flawed = any(shift is not None and shift.any() for shift in shifts)
    if model.half or model.friction is not None or flawed:
        raise ValueError(
            "the influence needs a model of the whole drive, without friction and"
            " without tooth errors"
        )
    assert model.circular_spline.compliance is not None
    linear = linearise(
        model, state, None if circular_spline_is_output else state.torque
    )
    contacts, carries = _tooth_contacts(model, linear, state)
    supports = Supports.from_state(linear, state, _near_supports(model, linear, state))
    drive = CondensedModel(
        model=model,
        state=state,
        linear=linear,
        circular_spline_is_output=circular_spline_is_output,
        contacts=contacts,
        carries=carries,
    )
    points = supports.intervals.mean(model.bore_points(state))
    points = rotate(points, -state.wave_generator_angle)
    return replace(drive.influence(supports), supports=points)


def _tooth_contacts(
    model: SectorModel, linear: Linearised, state: State
) -> tuple[Contacts, Mask]:
    """Possible contact points, and a mask of those that carry force in the state."""
    loaded = state.contacts
    if loaded is None or not len(loaded):
        raise ValueError("the influence needs an equilibrium whose teeth carry force")
    reach = REACH * model.lobe_height
    near = linear.search.search(linear.flank, reach, loaded)
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
    possible = linear.search.search(linear.flank, reach, Contacts.join(loaded, more))
    return distinct(possible, state)


def _near_supports(model: SectorModel, linear: Linearised, state: State) -> Mask:
    """Mask of bore intervals that touch the wave generator or may do so (N, n)."""
    sectors, stations = linear.gap.shape
    most = max(1, SUPPORTS // sectors)
    count = next(n for n in range(most, 0, -1) if stations % n == 0)
    shape = (sectors, count, -1)
    near = linear.gap.reshape(shape).min(axis=2) < REACH * model.lobe_height
    return np.asarray(near | state.touching.reshape(shape).any(axis=2))

"""Prediction of contact changes from one equilibrium of the 2D model."""

from __future__ import annotations

import numpy as np

from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.plane.condensed_model import REACH, CondensedModel, Supports, distinct
from swgjoint.fe.plane.linearise import linearise
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Mask

MOST_SUPPORTS = 80
"""Largest number of bore intervals that may open or close in a prediction."""
FAR = 5.0
"""Torque range in which these intervals are selected, divided by the range of the
prediction [-]. It is wider because the selection ignores other contact changes, which
shift the torques at which the intervals open or close."""


def predicted_changes(
    model: SectorModel,
    state: State,
    *,
    circular_spline_is_output: bool,
    low: float,
    high: float,
) -> ContactChanges | None:
    """Contact changes over a torque range, predicted from one equilibrium.

    The prediction solves the drive linearised there and condensed to its contacts. Bore
    intervals that would open or close far outside the torque range keep their state.

    Args:
        model: The 2D model, without friction.
        state: The equilibrium.
        circular_spline_is_output: Whether the circular spline is the output.
        low: Smallest torque of interest [N·m].
        high: Largest torque of interest [N·m].

    Returns:
        The changes; None if no tooth carries force or if the output is held by a single
        contact.
    """
    if state.contacts is None or not len(state.contacts):
        return None
    linear = linearise(
        model, state, None if circular_spline_is_output else state.torque
    )
    reach = REACH * model.lobe_height
    candidates = linear.search.search(
        linear.flank, reach, state.contacts, thorough=False
    )
    contacts, carries = distinct(candidates, state)
    drive = CondensedModel(
        model=model,
        state=state,
        linear=linear,
        circular_spline_is_output=circular_spline_is_output,
        contacts=contacts,
        carries=carries,
    )
    apart = max(high - state.torque, state.torque - low)
    supports = Supports.from_state(linear, state, _supports_within(drive, FAR * apart))
    at = supports.intervals
    numbers = np.concatenate(
        [
            2 * contacts.sector + contacts.side,
            -1 - at.sector * linear.gap.shape[1] - at.number,
        ]
    )
    try:
        return drive.influence(supports).changes(low, high, numbers)
    except np.linalg.LinAlgError:
        # without one of the contacts nothing holds the flexspline
        return None


def _supports_within(drive: CondensedModel, torque: float) -> Mask:
    """Whether each bore interval opens or closes within a torque change [N·m].

    All other contact changes are ignored. If more than :data:`MOST_SUPPORTS` intervals
    would change, only those that change first are marked.

    Returns:
        Mask (N, intervals).
    """
    linear, state = drive.linear, drive.state
    p = linear.stations.per_interval
    shape = (len(linear.gap), -1, p)
    gap, touching = linear.gap.reshape(shape), state.touching.reshape(shape)
    slope = (linear.gap_after(drive.torque_response()) - linear.gap).reshape(shape)
    closed = touching.any(axis=2)
    k = np.where(touching, linear.stations.stiffness.reshape(shape[1:]), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        lasts = np.abs((k * gap).sum(axis=2) / (k * slope).sum(axis=2))
        comes = np.where(gap / slope < np.inf, np.abs(gap / slope), np.inf)
    away = np.where(closed, np.nan_to_num(lasts, nan=np.inf), comes.min(axis=2))
    few = np.sort(away, axis=None)[min(MOST_SUPPORTS, away.size - 1)]
    return np.asarray(away < min(torque, few))

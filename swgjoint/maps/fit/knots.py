"""Common torsion knots of the curves of a map at all angles."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from swgjoint.maps.fit.torsion_table import interpolate_on_knots
from swgjoint.maps.samples import MapSamples, ToleranceSamples
from swgjoint.typing import Array

END_STEPS = 6
"""Newton steps to the torsion at which the mean torque is the largest sampled one."""
LADDER = 12
"""Largest number of knot intervals across the end of a clearance."""


def common_knots(samples: MapSamples, torsion: Array) -> Array:
    """Common torsion knots of the curves at all angles.

    Args:
        samples: Samples of the map; its tolerances are registered by torque, see
            :func:`swgjoint.maps.fit.tolerance_modes.register_by_torque`.
        torsion: Torsion of the samples (n_torques, n_angles) [rad].

    Returns:
        Increasing knots, zero included (n_knots,) [rad].
    """
    assert samples.solved is not None
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    tolerances = samples.tolerances
    if tolerances is None:
        # the mean torsions, with both ends inside the sampled range of every angle
        knots = torsion.mean(axis=1)
        knots[0], knots[-1] = torsion[0].max(), torsion[-1].min()
        # the range of stiff angles may end before the mean torsion of the last torques
        least = 0.3 * np.abs(np.diff(torsion.mean(axis=1))[[0, -1]])
        inside = (knots > knots[0] + least[0]) & (knots < knots[-1] - least[1])
        inside[[0, -1]] = True
        at = zero - int((~inside[:zero]).sum())
        knots = knots[inside]
        ends = torsion[zero - 2 : zero + 3]
    else:
        # with tooth errors the stiffness varies so much that the range common to all
        # positions would end far below the largest torque, so that the curves of stiff
        # positions are extrapolated instead
        error, rest = tolerances.table[0], tolerances.zero
        flawed = error[rest] - error
        mean = PchipInterpolator(tolerances.torque, flawed.mean(axis=1))
        knots = mean(np.clip(samples.torque, *tolerances.torque[[0, -1]]))
        _end_at_largest_torque(knots, tolerances, flawed)
        solved = np.array(samples.solved)
        solved[[0, -1]] = True
        wide = np.diff(knots[solved])
        at, ends = zero, flawed[rest - 2 : rest + 3]
    knots[at] = 0.0
    if samples.free and (tolerances is None or tolerances.onsets):
        up = _clearance_knots(knots[at + 3 :], ends[3:])
        down = _clearance_knots(-knots[: at - 2][::-1], -ends[:2][::-1])
        knots = np.concatenate([-down[::-1], [0.0], up])
    if tolerances is not None:
        below, above = float(flawed[0].min()), float(flawed[-1].max())
        low = -_further(-knots[0], -below, 2.0 * wide[0])[::-1]
        high = _further(knots[-1], above, 2.0 * wide[-1])
        knots = np.concatenate([low, knots, high])
    return np.asarray(knots)


def _further(first: float, last: float, step: float) -> Array:
    """Knots beyond the last one that cover the torsion of soft positions (n,) [rad].

    Tooth errors make the torsion at the largest torque differ so much between positions
    that the mean one is too small for many of them.

    Args:
        first: Last knot [rad].
        last: Largest torsion of any position [rad].
        step: Largest distance of the knots [rad].
    """
    count = max(0, int(np.ceil((last - first) / step)))
    return np.linspace(first, last, count + 1)[1:]


def _end_at_largest_torque(
    knots: Array, tolerances: ToleranceSamples, torsion: Array
) -> None:
    """Scale the knots of each sign in place to end at the largest sampled torque.

    The extrapolated curves of stiff positions raise the mean torque, so it reaches the
    largest sampled torque at less than the mean torsion.
    """
    torque = np.broadcast_to(tolerances.torque[:, None], torsion.shape)
    curve = np.stack([tolerances.table[1], torque, 1.0 / tolerances.table[2]])
    for end, sign in ((0, -1.0), (-1, 1.0)):
        last = knots[[end]].copy()
        for _ in range(END_STEPS):
            _, reached, slope = interpolate_on_knots(torsion, curve, last).mean(axis=0)
            last += (tolerances.torque[end] - reached) / slope
        side = knots * sign > 0.0
        knots[side] *= last / knots[end]


def _clearance_knots(beyond: Array, ends: Array) -> Array:
    """Knots of one side, with equal steps across the end of the clearance.

    The torsion at which the clearance ends varies with the angle by more than the
    elastic torsion of a stiff drive. The steps extend from the torsion where no angle
    has left the clearance to the one where all have left it. Each is about as long as
    the transition at a single angle; there are at most :data:`LADDER`.

    Args:
        beyond: Usual knots, from the first torque after the one that takes up the
            clearance [rad]. Shape (n,).
        ends: Torsion at the end of the clearance, and under the torque that takes it up
            [rad]. Shape (2, n_angles).

    Returns:
        The knots [rad].
    """
    first, last = float(ends[0].min()), float(ends[1].max())
    step = float((ends[1] - ends[0]).mean())
    count = min(LADDER, int(np.ceil((last - first) / step)))
    ladder = np.linspace(first, last, count + 1)
    kept = beyond > last + 0.5 * (ladder[1] - ladder[0])
    return np.concatenate([ladder, beyond[kept]])

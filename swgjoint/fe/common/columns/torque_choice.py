"""Choice of the torques of a map, and of the torques and angles of its validation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.fe.common.load_path import LoadPath
from swgjoint.typing import Array

FEWEST_TORQUES = 40
"""Smallest number of torques of one sign that a table gets, if permitted."""
KINK = 0.07
"""Largest error of a map between two torques of its table where the compliance jumps,
as a fraction of the jump times their distance [-]. It follows from the interpolation of
a kinked curve by :func:`~swgjoint.maps.fit.torsion_table.interpolate_on_knots` and
:func:`~swgjoint.maps.quartic.quartic_chain`."""
TABLE_GOAL = 0.02
"""Goal for this error, as a fraction of the peak-to-peak value [-]."""
MISSED_JUMPS = 0.5
"""Largest number of jumps per angle at which the goal may be missed [-]."""
MOST_MISSED = 0.04
"""Largest error at any jump, if permitted by the number of torques [-]."""
REACH = 1.1
"""Safety factor on the linear estimate of the torque beyond the largest one under which
the output turns as far at the stiffest angle as it does at the softest angle under the
largest torque [-]."""
BEYOND = (0.02, 0.15)
"""Bounds of the difference between this torque and the largest one, as fractions of the
largest one [-]."""


Ripple = Callable[[ArrayLike], Array]
"""Function that returns, at torques T [N·m] of any shape (...), peak-to-peak values of
output error [rad] and input torque [N·m] over the angle (2, ...)."""


def no_ripple(torque: ArrayLike) -> Array:
    """No lower bound of the peak-to-peak values, see :data:`Ripple`."""
    return np.zeros((2, *np.shape(torque)))


def common_torques(
    paths: list[LoadPath],
    own: set[float],
    least: float,
    most: int,
    peaks: tuple[Array, Array],
) -> Array:
    """Torques of a table, denser where jumps of the compliance matter.

    A map is smooth between two torques of its table. At a jump of the compliance it is
    off by a fraction of the jump times the distance of these torques. The interval with
    the worst jump is halved until few jumps miss the goal, and none by far. Jumps of
    many angles at nearly the same torque thus do not take torques from single ones.

    Args:
        paths: Load paths of all angles.
        own: Positive torques that were solved at all angles [N·m].
        least: Lower bound of the added torques [N·m].
        most: Largest number of added torques.
        peaks: Torques [N·m] and the peak-to-peak values of the output error over the
            angle at these torques [rad], each (m,).

    Returns:
        Solved and added torques, increasing (n,) [N·m].
    """
    top = max(own)
    jumps = [one.jumps for one in paths]
    torque = np.concatenate([place for place, _ in jumps])
    size = np.concatenate([size for _, size in jumps])
    order = np.argsort(torque)
    order = order[(torque[order] > least) & (torque[order] <= top)]
    torque, part = torque[order], size[order] / np.interp(torque[order], *peaks)
    levels, count = np.array(sorted(own)), min(FEWEST_TORQUES, most)
    spread = _spread_torques(torque, part, least, top, count)
    # drop torques that almost coincide with a solved one
    gap = np.abs(spread[:, None] - levels).min(axis=1)
    near = gap < 0.35 * np.gradient(spread)
    table = np.sort(np.concatenate([spread[~near], levels]))
    while count < most and torque.size:
        ends = np.concatenate([[least], table])
        after = np.searchsorted(table, torque)
        error = KINK * part * np.diff(ends)[after]
        missed = np.count_nonzero(error > TABLE_GOAL)
        if missed <= MISSED_JUMPS * len(paths) and error.max() <= MOST_MISSED:
            break
        # halve the interval of the worst jump
        worst = int(after[error.argmax()])
        table = np.insert(table, worst, 0.5 * (ends[worst] + ends[worst + 1]))
        count += 1
    return table


def _spread_torques(
    torque: Array, part: Array, least: float, top: float, count: int
) -> Array:
    """Torques of a table between two limits, half of them following the jumps.

    Args:
        torque: Torques of the jumps, increasing (n,) [N·m].
        part: Weights of the jumps (n,).
        least: Smaller limit [N·m].
        top: Larger limit [N·m].
        count: Number of torques.
    """
    fine = np.linspace(least, top, 8001)
    share = (fine - least) / (top - least)
    # the other half is slightly denser near zero
    measure = 0.25 * share + 0.25 * np.sqrt(share)
    if part.any():
        sums = np.concatenate([[0.0], np.cumsum(part)]) / part.sum()
        measure += 0.5 * sums[np.searchsorted(torque, fine, side="right")]
    middle = (np.arange(count) + 0.5) / count
    return np.asarray(np.interp(middle * measure[-1], measure, fine))


def periodic(values: Array, parts: Array) -> tuple[Array, Array]:
    """Trigonometric interpolation over a period, and its derivative.

    Args:
        values: Values at equal steps over the period (n, ...).
        parts: Positions as fractions of the period (m,) [-].

    Returns:
        Values, and derivatives with respect to the fraction of the period, each
        (m, ...).
    """
    n = len(values)
    modes = np.fft.rfft(values, axis=0)[: (n + 1) // 2] / n
    modes[1:] *= 2.0
    wave = 2.0j * np.pi * np.arange(len(modes))
    phase = np.exp(parts[:, None] * wave)
    return (phase @ modes).real, ((phase * wave) @ modes).real


def torque_beyond(top: float, torsion: Array, compliance: Array) -> float:
    """Torque beyond the largest one, under which all angles turn far enough [N·m].

    Args:
        top: Largest torque, of either sign [N·m].
        torsion: Torsion under this torque at all angles (n,) [rad].
        compliance: Tangent compliance there (n,) [rad/(N·m)].
    """
    apart = REACH * float(np.ptp(torsion) / compliance.mean())
    low, high = (abs(top) * part for part in BEYOND)
    return top + float(np.sign(top)) * min(max(apart, low), high)


def unseen_places(count: int, finest: int) -> list[float]:
    """Validation angles, spread over the pitch and between the angles of all grids.

    Args:
        count: Number of validation angles.
        finest: Number of angles of the finest grid.

    Returns:
        Angles as multiples of the step of the finest grid, not integers [-].
    """
    # offset by the golden section of their spacing, so that no grid is near all of them
    return [finest * (k + 0.381966) / count for k in range(count)]


def unseen_parts(count: int) -> Array:
    """Validation torques as fractions of the largest torque [-], half of them small.

    None of them is close to the initial torques of a map.
    """
    small = count // 2
    parts = [np.geomspace(0.021, 0.28, small), np.linspace(0.37, 0.97, count - small)]
    return np.concatenate(parts)

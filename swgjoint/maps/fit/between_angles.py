"""Samples at unequally spaced angles over one period.

Contacts that change between two sampled angles cause corners of the output error and of
the input torque, and harmonics of equally spaced samples miss them by a part that falls
slowly with their number. A few more samples next to the worst corners suffice. A cubic
spline transfers unequally spaced samples to equal steps. It is linear in the samples,
so that torque, torsion and energy remain derivatives and integrals of each other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from swgjoint.typing import Array

WORST = 0.5
"""Fraction of the largest doubt above which steps are divided together with the worst
one [-]."""
OF_ERROR = 0.4
"""Weight of the doubt of the output error compared with that of the input torque [-].
With this weight, both are about as large as the differences at other angles in dense
scans of two designs (0.7 to 1.5 times)."""
SHORTEST = 2
"""Number of parts into which the steps of equally spaced samples may be divided. In
shorter steps, small errors of the curves over the torque change the input torque."""

FADED = 0.05
"""Torque above which the unloaded table of unequally spaced angles no longer matters,
as a fraction of the largest torque [-]."""


def even_steps(parts: Array, count: int) -> int:
    """Number of equal steps, at least ``count``, whose ends include all positions.

    Args:
        parts: Positions of the samples as fractions of the period (n,) [-].
        count: Number of steps at first, which is doubled.
    """
    while np.abs(parts * count - np.round(parts * count)).max() > 0.1:
        count *= 2
    return count


def finer_steps(parts: Array, count: int) -> Array:
    """Ratios of ``count`` equal steps to the shorter step next to each sample.

    Args:
        parts: Positions of the samples as fractions of the period, increasing (n,) [-].
        count: Number of equal steps.
    """
    after = np.diff(np.append(parts, 1.0 + parts[0]))
    return np.asarray(np.round(1.0 / count / np.minimum(after, np.roll(after, 1))))


def spread_evenly(parts: Array, values: Array, count: int) -> Array:
    """Samples at equal steps over the period.

    Args:
        parts: Positions of the samples as fractions of the period, increasing from 0
            (n,) [-].
        values: The samples (n, ...).
        count: Number of equal steps. All positions are multiples of the step.

    Returns:
        Values (count, ...), at the positions of the samples without any change.
    """
    own = np.round(parts * count).astype(int)
    if own.size == count:
        return values
    periodic = np.concatenate([values, values[:1]])
    spline = CubicSpline(np.append(parts, 1.0), periodic, bc_type="periodic")
    spread = np.asarray(spline(np.arange(count) / count))
    spread[own] = values
    return spread


def missed_by_neighbours(parts: Array, values: Array) -> Array:
    """Difference of each sample from the cubic through two neighbours on either side.

    Args:
        parts: Positions of the samples as fractions of the period, increasing (n,) [-].
        values: The samples (n, ...).

    Returns:
        Differences (n, ...).
    """
    n = parts.size
    near = np.arange(n)[:, None] + np.array([-2, -1, 1, 2])
    place = parts[near % n] + near // n  # (n, 4)
    same = np.eye(4, dtype=bool)
    # Lagrange polynomials of the neighbours
    way = np.where(same, 1.0, (parts[:, None] - place)[:, None, :])
    apart = np.where(same, 1.0, place[:, :, None] - place[:, None, :])
    weights = (way / apart).prod(axis=2)
    return np.asarray(values - np.einsum("nk,nk...->n...", weights, values[near % n]))


def doubt_between(
    parts: Array, period: float, values: Array, heights: Sequence[float]
) -> Array:
    """Estimated errors of output error and input torque in the steps between samples.

    They follow from the differences of the samples at both ends of a step from their
    neighbours. A wrong potential G changes the input torque dG/dtheta by as much as its
    difference divided by the step.

    Args:
        parts: Positions of the samples as fractions of the period, increasing (n,) [-].
        period: The period [rad].
        values: Output error [rad] and complementary potential [J] at one torque (2, n).
        heights: Peak to peak of output error [rad] and input torque [N·m] over the
            angle at this torque.

    Returns:
        Largest error in the step after each sample, as a fraction of the peak to peak
        (n,) [-].
    """
    step = np.diff(np.append(parts, 1.0 + parts[0]))
    missed = np.abs(missed_by_neighbours(parts, values.T)).T
    error, potential = 0.5 * (missed + np.roll(missed, -1, axis=1))
    moment = potential / (step * period)
    return np.asarray(np.maximum(OF_ERROR * error / heights[0], moment / heights[1]))


def steps_to_divide(
    parts: Array, doubt: Array, goal: float, count: int, most: int
) -> list[float]:
    """Middles of the steps with the largest doubts.

    Args:
        parts: Positions of the samples as fractions of the period, increasing (n,) [-].
        doubt: Doubts in the steps after them (n,) [-].
        goal: Doubt that is not divided [-].
        count: Number of equally spaced samples at first; steps are not divided beyond
            :data:`SHORTEST` parts of theirs.
        most: Largest number of steps.

    Returns:
        Positions as fractions of the period, increasing [-].
    """
    step = np.diff(np.append(parts, 1.0 + parts[0]))
    doubt = np.where(step * count * SHORTEST > 1.5, doubt, 0.0)
    limit = max(goal, WORST * float(doubt.max()))
    worst = [k for k in np.argsort(-doubt, kind="stable") if doubt[k] > limit]
    return sorted(float(parts[k] + 0.5 * step[k]) for k in worst[: max(0, most)])


def with_mirrored_torques(
    tables: dict[float, Array], count: int | None = None
) -> dict[float, Array]:
    """Tables of positive torques together with their mirror images.

    Without load the drive equals its mirror image except for round-off, which exceeds
    the strain energy at the smallest torques, and except where only one of two mirrored
    angles was solved. The tables of both signs are therefore shifted to the mean of the
    unloaded table and its mirror image. A shift of the output error at a single angle
    would change the input torque in proportion to the torque. The part of the shift
    that is due to unequally spaced angles therefore fades with the torque.

    Args:
        tables: Output error [rad], energy [J], compliance [rad/(N·m)] and input torque
            [N·m] (4, n_angles) by torque [N·m], zero included.
        count: Number of equally spaced solved angles; None if all were solved.
    """
    rest = tables[0.0]
    middle = 0.5 * (rest + _mirrored(rest))
    shift = np.zeros_like(rest)
    shift[:2] = (middle - rest)[:2]
    angles = rest.shape[1]
    count = angles if count is None else count
    even = shift[:, :: angles // count]
    lasting = spread_evenly(np.arange(count) / count, even.T, angles).T
    fading, end = shift - lasting, FADED * max(tables)
    sides = {
        t: values + (lasting + max(0.0, 1.0 - t / end) * fading)
        for t, values in tables.items()
        if t
    }
    return sides | {-t: _mirrored(v) for t, v in sides.items()} | {0.0: middle}


def _mirrored(values: Array) -> Array:
    """Table of the mirrored drive, under the opposite torque.

    At -T and -theta the output error and the input torque have the opposite sign, while
    energy and compliance are equal.
    """
    back = np.roll(values[:, ::-1], 1, axis=1)
    return np.asarray(back * np.array([-1.0, 1.0, 1.0, -1.0])[:, None])

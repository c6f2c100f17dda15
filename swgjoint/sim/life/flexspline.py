"""Stress cycles at the tooth root of a flexspline over a duty cycle.

A tooth goes through the stress of one period of the place each time a lobe passes it.
The stress follows from the place and the torque at that instant, see
:mod:`swgjoint.maps.root_stress`. Teeth meet the peaks of the torque at different
places, so several teeth are examined, and the most damaged one counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swgjoint.gear.fatigue_life import (
    StressCycles,
    StressLife,
    count_cycles,
    equivalent_amplitude,
    miner_damage,
    turning_points,
)
from swgjoint.maps.root_stress import SignedRootStress, root_stress
from swgjoint.sim.life.loads import TaskLoads
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap

TEETH = 12
"""Number of examined teeth, equally spaced over one period of the place."""
POINTS = 2
"""Number of examined points of the root, those with the largest stress range."""
PER_PERIOD = 120
"""Least number of stress samples per period of the place; between the steps of a run,
place and torque are interpolated linearly. The range of a sine is then low by less than
0.04 %."""
CHUNK = 100_000
"""Number of stress samples that are evaluated at once."""
SLACK = 1e-9
"""Relative tolerance of the torque range."""


def count_root_cycles(
    drive: DriveMap,
    cycle: Sequence[TaskLoads],
    j: int,
    steel: StressLife | None = None,
) -> StressCycles | str:
    """Stress cycles of the most damaged tooth in one duty cycle.

    Every task is counted as a history that repeats itself, and so is the sequence of
    all tasks, which replaces one occurrence of each. Without an S-N curve, or without
    damage, the tooth with the largest equivalent amplitude counts.

    Args:
        drive: The drive.
        cycle: Loads by task; not all of them rests.
        j: Index of the joint.
        steel: S-N curve and strength of the flexspline; None if not known.

    Returns:
        The cycles, none if the stress does not change, or the reason why they are not
        known.

    Raises:
        MissingExtraError: If the package ``rainflow`` is not installed.
    """
    if drive.fields is None:
        return f"the map of {drive.name} contains no stress fields"
    tasks = [task for task in cycle if not task.rest]
    extremes = np.array([[t.torque[:, j].min(), t.torque[:, j].max()] for t in tasks])
    low, high = drive.fields.torque[[0, -1]]
    if extremes.min() < low * (1.0 + SLACK) or extremes.max() > high * (1.0 + SLACK):
        return (
            f"torque of {extremes.min():.4g} to {extremes.max():.4g} N·m leaves the"
            f" stress fields of {drive.name} ({low:.4g} to {high:.4g} N·m)"
        )
    stress = root_stress(drive.fields)
    ultimate = np.inf if steel is None else steel.ultimate_strength
    worst: tuple[float, float] = (-1.0, -1.0)
    none = np.empty(0)
    kept = StressCycles(amplitude=none, mean=none, count=none)
    for point in _hot_points(stress, extremes.min(), extremes.max(), ultimate):
        for tooth in np.arange(TEETH) * stress.period / TEETH:
            found = _cycles_of_tooth(stress, tasks, j, float(tooth), point)
            if not found.amplitude.size:
                continue
            largest = equivalent_amplitude(found.amplitude, found.mean, ultimate).max()
            damage = 0.0 if steel is None else miner_damage(found, steel)
            if (damage, float(largest)) > worst:
                worst, kept = (damage, float(largest)), found
    return kept


def _hot_points(
    stress: SignedRootStress, low: float, high: float, ultimate: float
) -> NDArray[np.intp]:
    """Points of the root with the largest stress range between two torques."""
    place = np.arange(PER_PERIOD) * stress.period / PER_PERIOD
    values = np.empty((stress.stress.shape[2], 2 * PER_PERIOD))
    for point in range(len(values)):
        for k, torque in enumerate((low, high)):
            part = slice(k * PER_PERIOD, (k + 1) * PER_PERIOD)
            at = np.full(PER_PERIOD, torque)
            values[point, part] = stress.evaluate_at(place, at, point)
    top, bottom = values.max(axis=1), values.min(axis=1)
    use = equivalent_amplitude(0.5 * (top - bottom), 0.5 * (top + bottom), ultimate)
    return np.argsort(-use, kind="stable")[:POINTS]


def _cycles_of_tooth(
    stress: SignedRootStress,
    tasks: Sequence[TaskLoads],
    j: int,
    tooth: float,
    point: int,
) -> StressCycles:
    """Stress cycles of one point of a tooth at an angle from the first tooth [rad]."""
    histories = [_history(stress, task, j, tooth, point) for task in tasks]
    counts = [(count_cycles(np.concatenate(histories)), 1)]
    counts += [
        (count_cycles(history), task.times - 1)
        for task, history in zip(tasks, histories, strict=True)
        if task.times > 1
    ]
    return StressCycles(
        amplitude=np.concatenate([one.amplitude for one, _ in counts]),
        mean=np.concatenate([one.mean for one, _ in counts]),
        count=np.concatenate([times * one.count for one, times in counts]),
    )


def _history(
    stress: SignedRootStress, task: TaskLoads, j: int, tooth: float, point: int
) -> Array:
    """Turning points of the stress during one task [Pa]. Shape (n,)."""
    place, torque = task.place[:, j] + tooth, task.torque[:, j]
    fastest = float(np.abs(np.diff(place)).max(initial=0.0))
    parts = max(1, ceil(fastest * PER_PERIOD / stress.period))
    steps = max(1, CHUNK // parts)
    points = []
    for first in range(0, max(len(place) - 1, 1), steps):
        last = min(first + steps, len(place) - 1)
        fine = np.linspace(first, last, (last - first) * parts + 1)
        at = np.arange(len(place))
        values = stress.evaluate_at(
            np.interp(fine, at, place), np.interp(fine, at, torque), point
        )
        points.append(turning_points(values))
    return turning_points(np.concatenate(points))

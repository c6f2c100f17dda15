"""Loads of the joints during the tasks of a duty cycle, and their means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi

import numpy as np

from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class TaskLoads:
    """Loads of all joints during one occurrence of a task, at equal time steps.

    A rest has no samples (n = 0).
    """

    name: str
    """Name of the task."""
    duration: float
    """Duration of one occurrence [s]."""
    times: int
    """Number of occurrences in a cycle."""
    torque: Array
    """Output torques [N·m]. Shape (n, n_joints)."""
    speed: Array
    """Output speeds [rad/s]. Shape (n, n_joints)."""
    input_speed: Array
    """Input speeds [rad/s]. Shape (n, n_joints)."""
    place: Array
    """Angles of the flexsplines relative to their wave generators [rad]. Shape
    (n, n_joints)."""
    bearings: Mapping[str, Array] = field(default_factory=dict)
    """Radial and axial force [N] and tilting moment [N·m] on each output bearing, by
    joint. Shapes (n, 3)."""
    reasons: tuple[str, ...] = ()
    """Reasons why the simulation of the task is not valid."""

    @property
    def rest(self) -> bool:
        """Whether the joints stand still."""
        return not len(self.torque)


@dataclass(frozen=True, kw_only=True)
class MeanLoad:
    """Mean load of one joint over a duty cycle."""

    torque: float | None
    """Mean torque to the power p, weighted with the speed [N·m]; None for a joint that
    does not turn."""
    input_speed: float
    """Mean magnitude of the input speed, including rests [rad/s]."""
    input_turns: float
    """Input turns in one cycle [-]."""
    peak: float
    """Largest magnitude of the output torque [N·m]."""


def cycle_duration(cycle: Sequence[TaskLoads]) -> float:
    """Duration of one duty cycle, including rests [s]."""
    return sum(task.times * task.duration for task in cycle)


def mean_load(cycle: Sequence[TaskLoads], j: int, exponent: float = 3.0) -> MeanLoad:
    r"""Mean load of one joint over the duty cycle.

    .. math:: T_{av}^p = \frac{\sum_k m_k \int |n| |T|^p dt}{\sum_k m_k \int |n| dt}

    with the number of occurrences :math:`m_k` of each task. Each integral is the mean
    of the recorded samples times the duration of the task.

    Args:
        cycle: Loads by task; not all of them rests.
        j: Index of the joint.
        exponent: Exponent p of the torque [-].
    """
    weighted = turned = turns = 0.0
    for task in cycle:
        if task.rest:
            continue
        share = task.times * task.duration
        speed, torque = np.abs(task.speed[:, j]), np.abs(task.torque[:, j])
        weighted += share * float(np.mean(speed * torque**exponent))
        turned += share * float(np.mean(speed))
        turns += share * float(np.mean(np.abs(task.input_speed[:, j])))
    return MeanLoad(
        torque=(weighted / turned) ** (1.0 / exponent) if turned else None,
        input_speed=turns / cycle_duration(cycle),
        input_turns=turns / (2.0 * pi),
        peak=max(
            float(np.abs(task.torque[:, j]).max()) for task in cycle if not task.rest
        ),
    )

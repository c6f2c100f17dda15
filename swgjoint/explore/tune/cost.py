r"""Cost of gains: parallel episodes of an environment, one per candidate and seed.

With the symbols of the environment's reward :math:`1/(1 + (e/s)^2) - w u^2`, the cost
of an episode is

.. math:: J = s \sqrt{\langle (e/s)^2 + w u^2 \rangle}
    = \sqrt{\langle e^2 \rangle + s^2 w \langle u^2 \rangle},

where e is the error of the true link angle, u the motor torque divided by its limit,
and the brackets denote the mean over the episode. J combines the rms error with a
torque term, which is :math:`s\sqrt{w}` for permanent full torque. For small errors the
mean reward is :math:`1 - (J/s)^2`. For large errors the reward levels off, but J does
not. After a limit has been exceeded, and wherever a signal is not finite, e is set to
the limit of the link angle and u to 1. No cost is therefore larger than
:attr:`Trials.worst`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, cast

import numpy as np

from swgjoint.control.motor_side import MotorPlan
from swgjoint.errors import InputError
from swgjoint.explore.tune.gains import Tunable, build, parts_of, weight_plan
from swgjoint.sim.controller import KnownJoints, ReadingAge, Task
from swgjoint.typing import Array
from swgjoint.units import arcmin

PREFIX = "swgjoint/"
TUNABLE = ("JointTracking-v0",)
"""Environments whose action is the motor torque alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """Signals of episodes for plots, shape (n, n_episodes)."""

    time: Array
    """Ends of the control periods [s], shape (n,)."""
    reference: Array
    """Reference of the link angle [rad]."""
    error: Array
    """Link angle minus reference [rad]; NaN after a limit has been exceeded."""
    torque: Array
    """Motor torque [N·m]."""


def environment_named(name: str) -> str:
    """Find the id of an environment whose controllers can be tuned.

    Raises:
        InputError: If the environment is unknown, or if its action is added to an
            internal control loop.
        MissingExtraError: If gymnasium is not installed.
    """
    from swgjoint.envs import ENVIRONMENTS

    short = name.removeprefix(PREFIX)
    if short in TUNABLE:
        return PREFIX + short
    if PREFIX + short in ENVIRONMENTS:
        raise InputError(
            f"environment {name!r}: its action is added to an internal control loop;"
            f" accepted: {', '.join(TUNABLE)}"
        )
    near = get_close_matches(short, TUNABLE, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    raise InputError(f"environment {name!r}; {hint}accepted: {', '.join(TUNABLE)}")


class Trials:
    """The same seeded episodes for every candidate."""

    def __init__(
        self,
        environment: str,
        arguments: Mapping[str, Any],
        *,
        seeds: Sequence[int],
        candidates: int,
    ) -> None:
        """Create the simulations.

        Args:
            environment: Id of the environment.
            arguments: Settings of the environment.
            seeds: Seeds of the episodes of every candidate.
            candidates: Number of candidates that run in parallel.

        Raises:
            InputError: If an argument is not a setting of the environment.
        """
        import gymnasium

        from swgjoint.envs.bench import settings_of
        from swgjoint.envs.joint_tracking import TrackingSettings

        # reject arguments of gymnasium itself, such as the restart mode
        settings_of(TrackingSettings, dict(arguments))
        self.seeds, self.candidates = tuple(seeds), candidates
        env = gymnasium.make_vec(
            f"swgjoint.envs:{environment}",
            num_envs=len(self.seeds) * candidates,
            **arguments,
        )
        self.env = cast(Any, env.unwrapped)
        settings, limits = self.env.core.settings, self.env.core.limits
        self.joints: KnownJoints = self.env.core.joints
        self.error_scale = float(settings.error_scale_arcmin * arcmin)
        """Error scale s of the cost [rad]."""
        self.effort_weight = float(settings.effort_weight)
        """Effort weight w of the cost [-]."""
        self._limit = float(limits.angle[0])
        self.worst = float(np.hypot(self._limit, self._full_torque))
        """Largest possible cost: that of an episode that exceeds a limit at once
        [rad]."""
        self._plans: dict[str, tuple[MotorPlan, MotorPlan]] = {}

    @property
    def _full_torque(self) -> float:
        return self.error_scale * float(np.sqrt(self.effort_weight))

    def costs(self, tunable: Tunable, values: Mapping[str, Array]) -> Array:
        """Costs of candidates on all seeds [rad], shape (candidates, seeds).

        Args:
            tunable: Controller.
            values: Parameter values of the candidates by key, shape (candidates,) each.
        """
        return self._run(tunable, values, None)

    def cost_and_traces(
        self, tunable: Tunable, values: Mapping[str, Array]
    ) -> tuple[Array, Trace]:
        """Costs [rad], shape (candidates, seeds), and signals of the episodes.

        Args:
            tunable: Controller.
            values: Parameter values of the candidates by key, shape (candidates,) each.
        """
        rows: list[tuple[Array, Array]] = []
        costs = self._run(tunable, values, rows)
        error, torque = (np.array(x) for x in zip(*rows, strict=True))
        task = self._task
        return costs, Trace(
            time=task.period * np.arange(1, len(error) + 1),
            reference=np.asarray(task.position[1:, :, 0]),
            error=error,
            torque=torque,
        )

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def _run(
        self,
        tunable: Tunable,
        values: Mapping[str, Array],
        rows: list[tuple[Array, Array]] | None,
    ) -> Array:
        env, count = self.env, len(self.seeds)
        observation, _ = env.reset(seed=list(self.seeds) * self.candidates)
        self._task = task = env.task
        each = {key: np.repeat(x, count)[:, None] for key, x in values.items()}
        limit = self.joints.torque_limit
        controller = build(self._plan(tunable, task, each), each, limit)
        # the age of the readings is a tuned parameter, so hide the true one
        controller.start(replace(task, reading_age=ReadingAge()))
        squares = np.zeros((2, env.num_envs))
        alive = np.ones(env.num_envs, dtype=bool)
        steps = len(task.position) - 1
        for k in range(steps):
            torque = controller.torque(k, env.read_measurements(observation))
            action = np.nan_to_num(torque / limit, posinf=1.0, neginf=-1.0)
            observation, _, terminated, _, info = env.step(np.clip(action, -1.0, 1.0))
            error = arcmin * info["link_error_arcmin"]
            effort = info["motor_torque_Nm"] / limit[0]
            valid = alive & np.isfinite(error) & np.isfinite(effort)
            size = np.where(valid, np.minimum(np.abs(error), self._limit), self._limit)
            squares += np.square([size, np.where(valid, effort, 1.0)])
            if rows is not None:
                rows.append(
                    (np.where(valid, error, np.nan), info["motor_torque_Nm"].copy())
                )
            alive &= ~terminated
        mean = squares / steps
        cost = np.sqrt(mean[0] + self._full_torque**2 * mean[1])
        return np.asarray(cost.reshape(self.candidates, count))

    def _plan(
        self, tunable: Tunable, task: Task, each: Mapping[str, Array]
    ) -> MotorPlan:
        """Plan of all motions; parts that candidates share are computed only once."""
        count = len(self.seeds)
        few = replace(
            task,
            position=task.position[:, :count],
            velocity=task.velocity[:, :count],
            acceleration=task.acceleration[:, :count],
            link_torque=task.link_torque[:, :count],
        )
        if tunable.name not in self._plans:
            self._plans[tunable.name] = parts_of(tunable, few)
        return weight_plan(
            self._plans[tunable.name], few, each, repeats=self.candidates
        )

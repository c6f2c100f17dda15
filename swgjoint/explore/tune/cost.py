r"""Cost of controllers: parallel episodes of an environment, per candidate and seed.

The reward of an environment is :math:`1/(1 + q) - w u`, with the squared error q
relative to its scale s, the squared effort u and the effort weight w. The cost of an
episode is

.. math:: J = s \sqrt{\langle q + w u \rangle},

where the brackets denote the mean over the instants that have a reward. For an error e
of the link angle, this is :math:`\sqrt{\langle e^2 \rangle + s^2 w \langle u \rangle}`:
the rms error and a term of the effort. For small errors the mean reward is :math:`1 -
(J/s)^2`. For large errors the reward levels off, but J does not. After a limit has been
exceeded, and wherever a signal is not finite, the error is that of all links at their
limits and u is 1. No cost is therefore larger than :attr:`Trials.worst`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, cast

import numpy as np

from swgjoint.errors import InputError
from swgjoint.explore.tune.tunable import Tunable
from swgjoint.sim.controller import KnownJoints, KnownLoop, Task
from swgjoint.typing import Array
from swgjoint.units import arcmin, mm

PREFIX = "swgjoint/"
UNITS = {"error_scale_arcmin": ("arcmin", arcmin), "error_scale_mm": ("mm", mm)}
"""Units of costs by the setting of the environment that has the error scale."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """Signals of episodes for plots, shape (n, n_episodes)."""

    time: Array
    """Ends of the control periods [s], shape (n,)."""
    reference: Array
    """Reference of the first link angle [rad]."""
    error: Array
    """Link angle minus reference [rad], of an arm the error of its tool [m]; NaN after
    a limit has been exceeded."""
    torque: Array
    """Torque of the first motor [N·m]."""


def environment_named(name: str) -> str:
    """Find the id of an environment.

    Raises:
        InputError: If the environment is unknown.
        MissingExtraError: If gymnasium is not installed.
    """
    from swgjoint.envs import ENVIRONMENTS

    known = [one.removeprefix(PREFIX) for one in ENVIRONMENTS]
    short = name.removeprefix(PREFIX)
    if short in known:
        return PREFIX + short
    near = get_close_matches(short, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    raise InputError(f"environment {name!r}; {hint}accepted: {', '.join(known)}")


def settings_type(environment: str) -> type[Any]:
    """Class of the settings of an environment."""
    import gymnasium
    from gymnasium.envs.registration import load_env_creator

    single: Any = load_env_creator(str(gymnasium.spec(environment).entry_point))
    kind: type[Any] = single.settings_type
    return kind


def arguments_for(
    tunable: Tunable, environment: str, arguments: Mapping[str, Any]
) -> dict[str, Any]:
    """Arguments of an environment with those that a controller needs.

    Args:
        tunable: Controller.
        environment: Id of the environment.
        arguments: Other arguments.

    Raises:
        InputError: If the environment has no such arguments.
    """
    from swgjoint.envs import ENVIRONMENTS

    def fits(name: str) -> bool:
        return all(hasattr(settings_type(name), key) for key in tunable.needs)

    if not fits(environment):
        others = ", ".join(
            one.removeprefix(PREFIX) for one in ENVIRONMENTS if fits(one)
        )
        raise InputError(
            f"controller {tunable.name!r} in {environment.removeprefix(PREFIX)};"
            f" accepted: in {others}"
        )
    return {**tunable.needs, **arguments}


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

        # reject arguments of gymnasium itself, such as the restart mode
        settings = settings_of(settings_type(environment), dict(arguments))
        if (kind := getattr(settings, "action", "torque")) != "torque":
            raise InputError(f"action {kind!r} of a tuning run; accepted: torque")
        self.seeds, self.candidates = tuple(seeds), candidates
        env = gymnasium.make_vec(
            f"swgjoint.envs:{environment}",
            num_envs=len(self.seeds) * candidates,
            **arguments,
        )
        self.env = cast(Any, env.unwrapped)
        core = self.env.core
        self.joints: KnownJoints = core.joints
        (scale,) = (key for key in UNITS if hasattr(settings, key))
        self.unit, self.unit_size = UNITS[scale]
        """Name and size of the unit of costs in results."""
        self.error_scale = float(getattr(settings, scale) * self.unit_size)
        """Error scale s of the cost [rad or m]."""
        self.effort_weight = float(settings.effort_weight)
        """Effort weight w of the cost [-]."""
        self._limit = (core.worst_error / self.error_scale) ** 2
        self.worst = self.error_scale * float(np.sqrt(self._limit + self.effort_weight))
        """Largest possible cost: that of an episode that exceeds a limit at once
        [rad or m]."""
        self._kept: dict[str, Any] = {}
        self._task = self._begin()

    @property
    def loop(self) -> KnownLoop | None:
        """Motor loop to which torques are added, along the motions of the seeds."""
        return self._task.loop

    def costs(self, tunable: Tunable, values: Mapping[str, Array]) -> Array:
        """Costs of candidates on all seeds, shape (candidates, seeds) [rad or m].

        Args:
            tunable: Controller.
            values: Parameter values of the candidates by key, shape (candidates,) each.
        """
        return self._run(tunable, values, None)

    def cost_and_traces(
        self, tunable: Tunable, values: Mapping[str, Array]
    ) -> tuple[Array, Trace]:
        """Costs [rad or m], shape (candidates, seeds), and signals of the episodes.

        Args:
            tunable: Controller.
            values: Parameter values of the candidates by key, shape (candidates,) each.
        """
        rows: list[tuple[Array, Array]] = []
        costs = self._run(tunable, values, rows)
        error, torque = (np.array(x) for x in zip(*rows, strict=True))
        task = self._task
        return costs, Trace(
            time=task.period * np.arange(1.0, len(error) + 1.0),
            reference=np.asarray(task.position[1:, :, 0]),
            error=error,
            torque=torque,
        )

    def close(self) -> None:
        """Close the environments."""
        self.env.close()

    def _begin(self) -> Task:
        """Begin the episodes of all candidates."""
        seeds = list(self.seeds) * self.candidates
        self._observation, _ = self.env.reset(seed=seeds)
        task: Task = self.env.task
        return task

    def _run(
        self,
        tunable: Tunable,
        values: Mapping[str, Array],
        rows: list[tuple[Array, Array]] | None,
    ) -> Array:
        env, core = self.env, self.env.core
        self._task = task = self._begin()
        act, observation = tunable.begin(values, task, self._kept), self._observation
        total = np.zeros(env.num_envs)
        alive = np.ones(env.num_envs, dtype=bool)
        steps = len(task.position) - 1
        for k in range(steps):
            torque = act(k, env.read_measurements(observation), alive)
            action = np.nan_to_num(torque / core.authority, posinf=1.0, neginf=-1.0)
            observation, _, terminated, _, _ = env.step(np.clip(action, -1.0, 1.0))
            error, effort = core.deviation()
            valid = alive & np.isfinite(error) & np.isfinite(effort)
            if k + 1 > core.first_step:
                error = np.where(valid, np.minimum(error, self._limit), self._limit)
                total += error + self.effort_weight * np.where(valid, effort, 1.0)
            if rows is not None:
                shown = core.shown_error()
                torques = core.motor_torque[:, 0].copy()
                rows.append((np.where(valid, shown, np.nan), torques))
            alive = alive & ~terminated
        cost = self.error_scale * np.sqrt(total / (steps - core.first_step))
        return np.asarray(cost.reshape(self.candidates, len(self.seeds)))

"""Batched environments for stable-baselines3.

``BatchVecEnv`` trains on a batch as fast as the engine steps it::

    import gymnasium
    from stable_baselines3 import PPO
    from swgjoint.envs.sb3 import BatchVecEnv

    name = "swgjoint.envs:swgjoint/JointTracking-v0"
    batch = gymnasium.make_vec(name, num_envs=64, autoreset_mode="SameStep")
    PPO("MlpPolicy", BatchVecEnv(batch)).learn(1_000_000)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode

from swgjoint.envs.api import BatchEnv
from swgjoint.errors import InputError, MissingExtraError
from swgjoint.typing import Array

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as error:
    raise MissingExtraError(
        "BatchVecEnv needs stable-baselines3: pip install 'swgjoint[rl]'"
    ) from error


class BatchVecEnv(VecEnv):  # type: ignore[misc]
    """A batch of episodes with the interface of stable-baselines3.

    It behaves as ``DummyVecEnv`` of the same single environments: an ended episode
    restarts immediately, its last observation is ``infos[k]["terminal_observation"]``,
    and ``infos[k]["TimeLimit.truncated"]`` tells whether it reached its full length
    without exceeding a limit. Observations and rewards are those of the batch, rounded
    to 32 bits.

    The episodes share one object. ``get_attr`` therefore returns its attribute for
    every index, ``env_method`` calls its method once, and ``set_attr`` accepts all
    indices only.
    """

    def __init__(self, batch: BatchEnv, *, every_info: bool = False) -> None:
        """Adapt a batch.

        Args:
            batch: Batched environment of this package with ``autoreset_mode``
                ``SameStep``.
            every_info: Whether ``infos`` contain the true values of every step, which
                slows large batches down; otherwise only those of the last step of an
                episode.

        Raises:
            InputError: If the environment is not such a batch.
        """
        if not isinstance(batch, BatchEnv):
            raise InputError(
                f"{type(batch).__name__}; accepted: a batched environment of swgjoint"
                " without wrappers, gymnasium.make_vec(..., num_envs=64,"
                " autoreset_mode='SameStep')"
            )
        mode = batch.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise InputError(
                f"autoreset_mode {mode.value!r}; accepted: SameStep, because"
                " stable-baselines3 expects ended episodes to restart immediately"
            )
        self.batch, self._every_info = batch, every_info
        self._actions: Array = np.zeros(0)
        super().__init__(
            batch.num_envs,
            _single_precision(batch.single_observation_space),
            _single_precision(batch.single_action_space),
        )

    def reset(self) -> Any:
        """Begin all episodes, with the seeds that :meth:`seed` has set.

        Returns:
            Observations, 32 bits. Shape (n, n_values).

        Raises:
            InputError: If options are set, because no option is accepted.
        """
        for options in self._options:
            if options:
                raise InputError(f"options {options!r}; accepted: none")
        observation, info = self.batch.reset(seed=list(self._seeds))
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [_row(info, k) for k in range(self.num_envs)]
        return observation.astype(np.float32)

    def step_async(self, actions: Array) -> None:
        """Set the actions of the next step. Shape (n, n_actions)."""
        self._actions = np.asarray(actions)

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Step all episodes with these actions.

        Returns:
            Observations, rewards and whether episodes ended, each with the episodes as
            first axis, and a list of infos.
        """
        observation, reward, terminated, truncated, info = self.batch.step(
            self._actions
        )
        done, late = terminated | truncated, truncated & ~terminated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if self._every_info:
            infos = [_row(info, k) for k in range(self.num_envs)]
        for k in np.flatnonzero(done).tolist():
            if self._every_info:
                self.reset_infos[k] = infos[k]
            infos[k] = _row(info["final_info"], k)
            infos[k]["terminal_observation"] = info["final_obs"][k].astype(np.float32)
        for one, flag in zip(infos, late.tolist(), strict=True):
            one["TimeLimit.truncated"] = flag
        return observation.astype(np.float32), reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Close the batch."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Attribute of the batch, once for every index.

        Args:
            attr_name: Name of the attribute.
            indices: Indices of episodes; None for all.
        """
        value = getattr(self.batch, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the batch.

        Args:
            attr_name: Name of the attribute.
            value: Its value, for all episodes.
            indices: None or the indices of all episodes.

        Raises:
            InputError: If not all episodes are meant.
        """
        meant = {int(k) for k in self._get_indices(indices)}
        if len(meant) != self.num_envs:
            raise InputError(
                f"attribute {attr_name!r} for {len(meant)} of {self.num_envs} episodes;"
                " accepted: for all, because they share one object"
            )
        setattr(self.batch, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: Any = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call a method of the batch once, and return its result for every index.

        Args:
            method_name: Name of the method.
            *method_args: Positional arguments.
            indices: Indices of episodes; None for all.
            **method_kwargs: Keyword arguments.
        """
        result = getattr(self.batch, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[Any], indices: Any = None
    ) -> list[bool]:
        """False for every index: the episodes have no wrappers.

        Args:
            wrapper_class: Class of a wrapper.
            indices: Indices of episodes; None for all.
        """
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> list[None]:
        """No pictures, because a batch has no render mode."""
        return [None] * self.num_envs


def _single_precision(space: Any) -> Box[Any]:
    """The same space with 32 bits, whose bounds are rounded as its values are."""
    return Box(space.low.astype(np.float32), space.high.astype(np.float32))


def _row(info: dict[str, Any], k: int) -> dict[str, Any]:
    """Info of one episode, as a single environment returns it."""
    values = {}
    for key, value in info.items():
        if key.startswith("_") or key.startswith("final_"):
            continue
        values[key] = value[k].item() if value.ndim == 1 else value[k].copy()
    return values

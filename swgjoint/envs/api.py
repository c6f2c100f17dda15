"""The two interfaces of gymnasium in front of the episodes."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from swgjoint.envs.bench import settings_of
from swgjoint.envs.core import Core, Entry, bounds
from swgjoint.envs.picture import Picture
from swgjoint.errors import InputError
from swgjoint.sim.controller import Measured, Task

Array = NDArray[np.float64]


def _box(entries: tuple[Entry, ...]) -> Any:
    low, high = bounds(entries)
    return Box(low, high, dtype=np.float64)


class SingleEnv(gymnasium.Env[Array, Array]):
    """One episode at a time."""

    metadata = {  # noqa: RUF012  (gymnasium's own declaration)
        "render_modes": ["rgb_array"],
        "render_fps": 50,
    }

    core_of: ClassVar[type[Any]]
    """Made from a number of episodes, threads of the engine and settings."""
    settings_type: ClassVar[type[Any]]

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Arguments are those of the class's docstring."""
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"render_mode {render_mode!r}; accepted: None, 'rgb_array'; for the"
                " rerun viewer swgjoint.envs.recording.EpisodeRecorder"
            )
        settings = settings_of(self.settings_type, arguments)
        core: Core = self.core_of(1, 1, settings)
        self.core, self.render_mode = core, render_mode
        self._picture: Picture | None = None
        self.observation_space = _box(core.observation_entries)
        self.action_space = _box(core.action_entries)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; ``options`` has no keys."""
        super().reset(seed=seed)
        self.core.restart([0], [self.np_random])
        return self.core.observation()[0], self._info(0)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold an action over one control period."""
        core = self.core
        core.step(np.asarray(action)[None], None)
        broken = int(core.broken()[0])
        return (
            core.observation()[0],
            float(core.reward()[0]),
            broken > 0,
            bool(core.over[0]),
            self._info(broken),
        )

    def render(self) -> Any:
        """A picture where ``render_mode`` is ``rgb_array``; (480, 640, 3) of uint8."""
        if self.render_mode is None:
            return None
        plant = self.core.plant
        if self._picture is None:
            self._picture = Picture(plant.model)
        return self._picture.draw(plant.batch.get_data(0))

    def close(self) -> None:
        """Give back what pictures need."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _info(self, broken: int) -> dict[str, Any]:
        got = {
            key: float(value[0]) if value.ndim == 1 else value[0]
            for key, value in self.core.info().items()
        }
        return got | {"broken_limit": broken}

    @property
    def task(self) -> Task:
        """The commanded motion of the episode, known since its reset."""
        task = self.core.task
        return Task(
            period=task.period,
            position=task.position[:, 0],
            velocity=task.velocity[:, 0],
            acceleration=task.acceleration[:, 0],
            link_torque=task.link_torque[:, 0],
            joints=task.joints,
            reading_age=task.reading_age,
        )

    def measured(self, observation: Array) -> Measured:
        """What a controller reads from an observation; shapes (n_joints,)."""
        return self.core.measured(observation)


class BatchEnv(VectorEnv[Array, Array, Array]):
    """Many episodes on the threads of the engine.

    An episode that has ended begins anew in the next step, whose action it ignores
    (``autoreset_mode`` ``NextStep``), or at once, its last observation in
    ``info["final_obs"]`` (``SameStep``): as in gymnasium's own vector environments,
    with which this one agrees to the last bit.
    """

    single: ClassVar[type[SingleEnv]]

    def __init__(
        self,
        num_envs: int = 1,
        threads: int = 0,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **arguments: Any,
    ) -> None:
        """Threads of the engine, 0 for one per core; the rest as the single one's."""
        modes = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
        if autoreset_mode not in (*modes, *(mode.value for mode in modes)):
            raise InputError(
                f"autoreset_mode {autoreset_mode!r}; accepted:"
                f" {', '.join(mode.value for mode in modes)}"
            )
        mode = AutoresetMode(autoreset_mode)
        self._same_step = mode is AutoresetMode.SAME_STEP
        settings = settings_of(self.single.settings_type, arguments)
        core: Core = self.single.core_of(num_envs, threads, settings)
        self.core, self.num_envs = core, core.plant.batch.nsim
        self.metadata = {"render_modes": [], "autoreset_mode": mode}
        self.single_observation_space = _box(core.observation_entries)
        self.single_action_space = _box(core.action_entries)
        self.observation_space = batch_space(
            self.single_observation_space, self.num_envs
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._rngs: list[np.random.Generator] = []
        self._ended = np.zeros(self.num_envs, dtype=bool)
        self._all = np.ones(self.num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Begin all episodes, number k with ``seed + k``.

        Args:
            seed: The first, or one each; None goes on with the generators.
            options: No keys.
        """
        n = self.num_envs
        if isinstance(seed, int):
            seed = [seed + k for k in range(n)]
        seeds: list[int | None] = [None] * n if seed is None else list(seed)
        if len(seeds) != n:
            raise InputError(f"{len(seeds)} seeds; accepted: {n}, one per episode")
        old = self._rngs
        self._rngs = [
            old[k] if old and one is None else seeding.np_random(one)[0]
            for k, one in enumerate(seeds)
        ]
        self._ended = np.zeros(n, dtype=bool)
        self.core.restart(range(n), self._rngs)
        return self.core.observation(), self._info(np.zeros(n, dtype=np.int64))

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Hold actions over one control period. Shapes (n, ...)."""
        core, ended = self.core, self._ended
        some = bool(ended.any())
        core.step(actions, ~ended if some else None)
        reward, broken, over = core.reward(), core.broken(), core.over
        if some:
            self._restart(ended)
            reward[ended], broken[ended], over[ended] = 0.0, 0, False
        terminated = broken > 0
        done, further = terminated | over, {}
        if not self._same_step:
            self._ended = done
        elif done.any():
            further = self._final(done, self._info(broken))
            self._restart(done)
            broken = np.where(done, 0, broken)
        info = further | self._info(broken)
        return core.observation(), reward, terminated, over, info

    def _final(self, done: NDArray[np.bool_], info: dict[str, Any]) -> dict[str, Any]:
        """Last observations and infos of episodes that end, as gymnasium has them."""
        last = self.core.observation()
        final = np.full(self.num_envs, None, dtype=object)
        for k in np.flatnonzero(done):
            final[k] = last[k]
        among = {
            key: np.where(done.reshape(-1, *[1] * (value.ndim - 1)), value, 0)
            for key, value in info.items()
        }
        for key in info:
            if key.startswith("_"):
                among[key] = done
        return {
            "final_obs": final,
            "final_info": among,
            "_final_obs": done,
            "_final_info": done,
        }

    def _restart(self, ended: NDArray[np.bool_]) -> None:
        rows = np.flatnonzero(ended)
        self.core.restart(rows.tolist(), [self._rngs[k] for k in rows])

    def _info(self, broken: NDArray[np.int64]) -> dict[str, Any]:
        got: dict[str, Any] = self.core.info() | {"broken_limit": broken}
        return got | {f"_{key}": self._all for key in got}

    @property
    def task(self) -> Task:
        """The commanded motions, the episodes in front of the joints."""
        return self.core.task

    def measured(self, observation: Array) -> Measured:
        """What a controller reads from observations; shapes (n, n_joints)."""
        return self.core.measured(observation)

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

from swgjoint.envs.arguments import format_value
from swgjoint.envs.bench import settings_of
from swgjoint.envs.core import Core, Entry, bounds
from swgjoint.envs.picture import Picture
from swgjoint.errors import InputError
from swgjoint.sim.controller import Measured, Task
from swgjoint.typing import Array


def _check_began(began: bool) -> None:
    """Refuse what needs an episode."""
    if not began:
        raise InputError("no episode has begun; accepted: after reset()")


def _check_options(options: dict[str, Any], known: tuple[str, ...]) -> None:
    """Refuse options of ``reset`` that are not known."""
    if unknown := [key for key in options if key not in known]:
        raise InputError(
            f"option {format_value(unknown[0])} of reset; accepted:"
            f" {', '.join(known) or 'no options'}"
        )


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
        self._began = False
        self.observation_space = _box(core.observation_entries)
        self.action_space = _box(core.action_entries)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode; ``options`` has no keys."""
        _check_options(options or {}, ())
        super().reset(seed=seed)
        self._began = True
        self.core.restart([0], [self.np_random])
        return self.core.observation()[0], self._info(0)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold an action over one control period."""
        _check_began(self._began)
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

    def read_measurements(self, observation: Array) -> Measured:
        """What a controller reads from an observation; shapes (n_joints,)."""
        return self.core.read_measurements(observation)


class BatchEnv(VectorEnv[Array, Array, Array]):
    """Many episodes on the threads of the engine.

    An episode that has ended begins anew in the next step, whose action it ignores
    (``autoreset_mode`` ``NextStep``), at once, its last observation in
    ``info["final_obs"]`` (``SameStep``), or when ``reset`` is called with a
    ``reset_mask`` (``Disabled``): as in gymnasium's own vector environments, with which
    this one agrees to the last bit.
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
        modes = tuple(AutoresetMode)
        if autoreset_mode not in (*modes, *(mode.value for mode in modes)):
            raise InputError(
                f"autoreset_mode {autoreset_mode!r}; accepted:"
                f" {', '.join(mode.value for mode in modes)}"
            )
        mode = AutoresetMode(autoreset_mode)
        self._mode = mode
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
        """Begin all episodes, or those of a mask, number k with ``seed + k``.

        Args:
            seed: The first, or one each; None goes on with the generators.
            options: ``reset_mask``, an array of bools, one per episode: those
                begin anew, the others go on. ``info`` then is that of the former.

        Raises:
            InputError: If a seed is missing or an option is not accepted.
        """
        options, n = dict(options or {}), self.num_envs
        _check_options(options, ("reset_mask",))
        chosen = self._chosen(options.get("reset_mask"))
        if isinstance(seed, int):
            seed = [seed + k for k in range(n)]
        seeds: list[int | None] = [None] * n if seed is None else list(seed)
        if len(seeds) != n:
            raise InputError(f"{len(seeds)} seeds; accepted: {n}, one per episode")
        old = self._rngs
        self._rngs = [
            old[k] if old and (one is None or not mine) else seeding.np_random(one)[0]
            for k, (one, mine) in enumerate(zip(seeds, chosen, strict=True))
        ]
        self._ended = self._ended & ~chosen
        self._restart(chosen)
        info = self._info(np.zeros(n, dtype=np.int64))
        return self.core.observation(), _of(chosen, info)

    def _chosen(self, mask: Any) -> NDArray[np.bool_]:
        """Episodes that a reset begins."""
        if mask is None:
            return self._all
        n = self.num_envs
        good = isinstance(mask, np.ndarray) and mask.dtype == np.bool_
        if not (good and mask.shape == (n,) and mask.any()):
            raise InputError(
                f"reset_mask {format_value(mask)}; accepted: an array of {n} bools, at"
                " least one of them True"
            )
        if not self._rngs:
            raise InputError(
                "reset_mask before any episode has begun; accepted: after reset()"
            )
        return np.array(mask)

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Hold actions over one control period. Shapes (n, ...)."""
        _check_began(bool(self._rngs))
        core, ended = self.core, self._ended
        some = bool(ended.any())
        if some and self._mode is AutoresetMode.DISABLED:
            rows = ", ".join(map(str, np.flatnonzero(ended)[:8]))
            raise InputError(
                f"step of episodes that have ended ({rows}); accepted: after"
                " reset(options={'reset_mask': ...}), which autoreset_mode Disabled"
                " leaves to the caller"
            )
        core.step(actions, ~ended if some else None)
        reward, broken, over = core.reward(), core.broken(), core.over
        if some:
            self._restart(ended)
            reward[ended], broken[ended], over[ended] = 0.0, 0, False
        terminated = broken > 0
        done, further = terminated | over, {}
        if self._mode is not AutoresetMode.SAME_STEP:
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
        return {
            "final_obs": final,
            "final_info": _of(done, info),
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

    def read_measurements(self, observation: Array) -> Measured:
        """What a controller reads from observations; shapes (n, n_joints)."""
        return self.core.read_measurements(observation)


def _of(rows: NDArray[np.bool_], info: dict[str, Any]) -> dict[str, Any]:
    """The info of some episodes, as gymnasium has it: zeros and False for the rest."""
    if rows.all():
        return info
    among = {
        key: np.where(rows.reshape(-1, *[1] * (value.ndim - 1)), value, 0)
        for key, value in info.items()
    }
    return among | {key: rows for key in info if key.startswith("_")}

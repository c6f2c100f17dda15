"""Gymnasium interfaces of the episodes: single and vectorised."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import EzPickle, seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from swgjoint.envs.arguments import format_value
from swgjoint.envs.bench import settings_of
from swgjoint.envs.core import Core
from swgjoint.envs.entries import bounds
from swgjoint.envs.one_joint import JointEpisode
from swgjoint.envs.picture import Picture
from swgjoint.errors import InputError
from swgjoint.sim.controller import Measured, Task
from swgjoint.typing import Array


def _seeds_of(seed: Any, count: int) -> list[Any]:
    """Seed of each episode; None continues a random generator."""
    if isinstance(seed, int | np.integer):
        return [int(seed) + k for k in range(count)]
    if seed is None:
        return [None] * count
    if not isinstance(seed, list | tuple | np.ndarray):
        raise InputError(
            f"seed {format_value(seed)}; accepted: an integer, or one per episode"
        )
    if len(seed) != count:
        raise InputError(f"{len(seed)} seeds; accepted: {count}, one per episode")
    return [int(one) if isinstance(one, np.integer) else one for one in seed]


def _check_began(began: bool) -> None:
    """Reject a call that needs an episode before the first reset."""
    if not began:
        raise InputError("no episode has begun; call reset() first")


def _check_options(options: dict[str, Any], known: tuple[str, ...]) -> None:
    """Reject unknown options of ``reset``."""
    if unknown := [key for key in options if key not in known]:
        raise InputError(
            f"option {format_value(unknown[0])} of reset; accepted:"
            f" {', '.join(known) or 'no options'}"
        )


def _spaces(core: Core) -> tuple[Any, Any]:
    """Spaces of all observations and actions within their bounds."""
    observation, action = core.observation_bounds, bounds(core.action_entries)
    return Box(*observation, dtype=np.float64), Box(*action, dtype=np.float64)


class SingleEnv(gymnasium.Env[Array, Array], EzPickle):
    """One episode at a time.

    A copy, also one by ``pickle`` or ``deepcopy``, has the same arguments and begins
    with ``reset``.
    """

    metadata = {  # noqa: RUF012  (gymnasium's own declaration)
        "render_modes": ["rgb_array"],
        "render_fps": 50,
    }

    core_of: ClassVar[type[Any]]
    """Class of the episodes, called with number of episodes, threads and settings."""
    settings_type: ClassVar[type[Any]]
    """Class of the settings, called with the arguments of the environment."""
    episode_of: ClassVar[type[JointEpisode] | None] = None
    """Class of the same episode without arrays, if there is one; used with its core
    only, so that a derived core needs none."""

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Make one environment; the class docstring lists the arguments.

        Args:
            render_mode: None or ``rgb_array``.
            **arguments: Arguments of the environment.

        Raises:
            InputError: If an argument is unknown or outside its range.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"render_mode {render_mode!r}; accepted: None, 'rgb_array' (for the"
                " rerun viewer use swgjoint.envs.recording.EpisodeRecorder)"
            )
        EzPickle.__init__(self, render_mode, **arguments)
        settings = settings_of(self.settings_type, arguments)
        core = self.core_of(1, 1, settings)
        self.core: Core = core
        self.render_mode = render_mode
        self._episode: JointEpisode | None = None
        kind = self.episode_of
        if kind is not None and kind.core_of is type(core) and not core.needs_arrays:
            self._episode = kind(core)
        self._picture: Picture | None = None
        self._began = False
        self.observation_space, self.action_space = _spaces(core)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Seed of the episode; None continues the random generator.
            options: None or empty; no keys are accepted.

        Returns:
            Observation and info.

        Raises:
            InputError: If an option is given.
        """
        _check_options(options or {}, ())
        super().reset(seed=seed)
        self._began = True
        self.core.restart([0], [self.np_random])
        if self._episode is not None:
            self._episode.begin()
        return self.core.observation()[0], self._info(0)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Apply a constant action over one control period.

        Returns:
            Observation, reward, whether a limit was exceeded, whether the episode has
            its full length, and info.

        Raises:
            InputError: If no episode has begun, or if the action is not accepted.
        """
        _check_began(self._began)
        core, action = self.core, np.asarray(action)
        if self._episode is not None and (outcome := self._episode.step(action)):
            observation, reward, limit, over, info = outcome
            return observation, reward, limit > 0, over, info
        core.step(action[None], None)
        broken = int(core.broken()[0])
        return (
            core.observation()[0],
            float(core.reward()[0]),
            broken > 0,
            bool(core.over[0]),
            self._info(broken),
        )

    def render(self) -> Any:
        """Picture, shape (480, 640, 3), uint8; None without a render mode."""
        if self.render_mode is None:
            return None
        plant = self.core.plant
        if self._picture is None:
            self._picture = Picture(plant.model)
        return self._picture.draw(plant.batch.get_data(0))

    def close(self) -> None:
        """Release the graphics context."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def _info(self, broken: int) -> dict[str, Any]:
        values = {
            key: float(value[0]) if value.ndim == 1 else value[0]
            for key, value in self.core.info().items()
        }
        return values | {"broken_limit": broken}

    @property
    def task(self) -> Task:
        """Commanded motion of the episode, known after its reset."""
        return self.core.task.select(0)

    def read_measurements(self, observation: Array) -> Measured:
        """Sensor readings in an observation, for controllers. Shapes (n_joints,)."""
        return self.core.read_measurements(observation)


class BatchEnv(VectorEnv[Array, Array, Array], EzPickle):
    """Many episodes on the threads of the engine.

    ``autoreset_mode`` determines when an ended episode restarts. With ``NextStep`` it
    restarts in the next step, whose action is ignored. With ``SameStep`` it restarts
    immediately, and ``info["final_obs"]`` contains its last observation. With
    ``Disabled`` it restarts when ``reset`` is called with a ``reset_mask``. The results
    are bit-identical to those of gymnasium's own vector environments. A copy, also one
    by ``pickle`` or ``deepcopy``, has the same arguments and begins with ``reset``.
    """

    single: ClassVar[type[SingleEnv]]
    """Class of the single environment."""

    def __init__(
        self,
        num_envs: int = 1,
        threads: int = 0,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **arguments: Any,
    ) -> None:
        """Make the environments.

        Args:
            num_envs: Number of episodes.
            threads: Number of engine threads; 0: one per core.
            autoreset_mode: ``NextStep``, ``SameStep`` or ``Disabled``.
            **arguments: Arguments of the single environment.

        Raises:
            InputError: If an argument is unknown or outside its range.
        """
        EzPickle.__init__(self, num_envs, threads, autoreset_mode, **arguments)
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
        self.single_observation_space, self.single_action_space = _spaces(core)
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
        """Begin all episodes, or those of a mask.

        Args:
            seed: Seed of the first episode, where episode k gets ``seed + k``, or one
                seed per episode; None continues the random generators.
            options: ``reset_mask``, an array with one bool per episode: marked episodes
                restart, the others continue. ``info`` then covers the marked episodes.

        Returns:
            Observations and info.

        Raises:
            InputError: If the number of seeds is wrong, or if an option is not
                accepted.
        """
        options, n = dict(options or {}), self.num_envs
        _check_options(options, ("reset_mask",))
        chosen = self._chosen(options.get("reset_mask"))
        seeds = _seeds_of(seed, n)
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
        """Whether a reset restarts each episode. Shape (n,)."""
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
                "reset_mask before any episode has begun; call reset() without it first"
            )
        return np.array(mask)

    def step(self, actions: Array) -> tuple[Array, Array, Any, Any, dict[str, Any]]:
        """Apply constant actions over one control period. Shapes (n, ...).

        Returns:
            As those of :meth:`SingleEnv.step`, with the episodes as first axis.

        Raises:
            InputError: If no episode has begun, if an ended episode was not reset with
                ``Disabled``, or if the actions are not accepted.
        """
        _check_began(bool(self._rngs))
        core, ended = self.core, self._ended
        some = bool(ended.any())
        if some and self._mode is AutoresetMode.DISABLED:
            rows = ", ".join(map(str, np.flatnonzero(ended)[:8]))
            raise InputError(
                f"step of episodes that have ended ({rows}); with autoreset_mode"
                " Disabled, call reset(options={'reset_mask': ...}) first"
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
        """Last observations and infos of ended episodes, in gymnasium's format."""
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
        values: dict[str, Any] = self.core.info() | {"broken_limit": broken}
        return values | {f"_{key}": self._all for key in values}

    @property
    def task(self) -> Task:
        """Commanded motions; the axis of episodes precedes that of joints."""
        return self.core.task

    def read_measurements(self, observation: Array) -> Measured:
        """Sensor readings in observations, for controllers. Shapes (n, n_joints)."""
        return self.core.read_measurements(observation)


def _of(rows: NDArray[np.bool_], info: dict[str, Any]) -> dict[str, Any]:
    """Info of the marked episodes in gymnasium's format; zero or False for others."""
    if rows.all():
        return info
    among = {
        key: np.where(rows.reshape(-1, *[1] * (value.ndim - 1)), value, 0)
        for key, value in info.items()
    }
    return among | {key: rows for key in info if key.startswith("_")}

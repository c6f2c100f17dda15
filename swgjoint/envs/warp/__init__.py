r"""``JointTracking`` in MuJoCo Warp: many worlds on one device, without a copy.

Observations, rewards and ends are arrays on the device, for learning on a GPU::

    from swgjoint.envs.warp import WarpJointTracking

    env = WarpJointTracking(4096, randomise=True)
    observation = wp.to_torch(env.reset())
    while True:
        action = policy(observation)  # torch, shape (4096, 1)
        _, reward, terminated, truncated = env.step(wp.from_torch(action))

Joint, observation, action, reward and limits are those of
:class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`. The episodes with their
references, loads, sensor noise and specimens are drawn once, as the vector environment
draws them for the same seeds, and then played in turn. A world that ends begins the
next episode in the same step.

The engine's state has single precision, see :mod:`swgjoint.joint.warp`: the angle of
the motor has a resolution of 1.5e-5 rad at 128 to 256 rad, which is less than one count
of its encoder (4.8e-5 rad).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.utils import seeding

from swgjoint.envs.arguments import check_count
from swgjoint.envs.bench import settings_of
from swgjoint.envs.joint_tracking import TrackingCore, TrackingSettings
from swgjoint.errors import InputError, MissingExtraError
from swgjoint.joint.warp import install, without_plugin

try:
    import mujoco_warp as mjw
    import warp as wp

    from swgjoint.envs.warp import arrays, kernels
except ImportError as error:
    raise MissingExtraError(
        "environments in MuJoCo Warp need mujoco-warp: pip install 'swgjoint[warp]'"
    ) from error


class WarpJointTracking:
    """Many worlds of ``JointTracking-v0`` with arrays on a device.

    All arrays are written anew by every step; copy what must last.

    Attributes:
        observation: Observations after the step, those of the next episode where one
            has ended. Shape (worlds, n_values).
        final_observation: Observations before such a new beginning. Same shape.
        reward: Rewards [-]. Shape (worlds,).
        terminated: Whether a limit was exceeded. Shape (worlds,).
        truncated: Whether an episode has its full length. Shape (worlds,).
        broken_limit: Numbers of the exceeded limits, see
            :data:`~swgjoint.envs.limits.LIMITS`. Shape (worlds,).
        link_error: Link angle minus reference at the end of the step [rad]. Shape
            (worlds,).
        output_torque: Torque of the drive on the link, mean over the last step of the
            engine [N·m]. Shape (worlds,).
        episode: Numbers of the episodes that the worlds play. Shape (worlds,).
    """

    def __init__(
        self,
        worlds: int,
        *,
        episodes: int = 1024,
        seed: int = 0,
        device: Any = None,
        **arguments: Any,
    ) -> None:
        """Draw the episodes and build the worlds.

        Args:
            worlds: Number of worlds.
            episodes: Number of drawn episodes. World k begins with episode k and
                continues with the following ones.
            seed: Seed of the first episode; episode k has ``seed + k``.
            device: Device of Warp; None: its default device.
            **arguments: Arguments of ``JointTracking-v0``, except ``gauges``, with
                level ``full``.

        Raises:
            InputError: If an argument is not accepted, or if the episodes do not fit
                into the memory of a plan.
        """
        check_count("worlds", worlds, 1)
        check_count("episodes", episodes, 1)
        settings = settings_of(TrackingSettings, arguments)
        for name, value, accepted in (
            ("level", settings.level, "full"),
            ("gauges", settings.gauges, None),
        ):
            if value != accepted:
                raise InputError(
                    f"{name} {value!r} in MuJoCo Warp; accepted: {accepted}"
                )
        core = TrackingCore(episodes, 1, settings)
        core.restart(
            range(episodes), [seeding.np_random(seed + k)[0] for k in range(episodes)]
        )
        model = without_plugin(core.spec)
        self.observation_bounds = core.observation_bounds
        """Bounds of the observation. Shapes (n_values,)."""
        self.device = wp.get_device(device)
        self._sub_steps, self._began = core.plant.sub_steps, False
        self._graph: Any = None
        with wp.ScopedDevice(self.device):
            self._m = mjw.put_model(model)
            self._d = mjw.make_data(model, nworld=worlds)
            call = install(self._m, self._d, model, [core.joint])
            if core.varies_load:
                inertia = np.tile(model.body_inertia, (worlds, 1, 1))
                self._m.body_inertia = wp.array(inertia, dtype=wp.vec3)
            self._bench = arrays.bench(core, model)
            self._channels = arrays.channels(core)
            self._episodes = arrays.episodes(core)
            self._engine = arrays.engine(self._m, self._d, call)
            self._worlds = arrays.worlds(core, worlds)
            self._results = results = arrays.results(core, worlds)
            self._action = wp.zeros((worlds, 1), dtype=float)
            self._all = wp.full(worlds, True, dtype=wp.bool)
        self.observation = results.observation
        self.final_observation = results.final_observation
        self.reward = results.reward
        self.terminated, self.truncated = results.terminated, results.truncated
        self.broken_limit = results.broken_limit
        self.link_error = results.link_error
        self.output_torque = results.output_torque
        self.episode = self._worlds.episode

    def reset(self, chosen: Any = None) -> Any:
        """Begin the first episode of every world, or the next one of chosen worlds.

        Args:
            chosen: Which worlds begin, an array of bools on the device, or None for
                all. Shape (worlds,).

        Returns:
            :attr:`observation`.
        """
        first = chosen is None
        if not (first or self._began):
            raise InputError("reset of chosen worlds before all have begun")
        self._began = True
        self._launch(
            kernels.begin_chosen,
            self._bench,
            self._channels,
            self._episodes,
            self._engine,
            self._worlds,
            self._results,
            self._all if first else chosen,
            int(first),
        )
        return self.observation

    def step(self, action: Any) -> tuple[Any, Any, Any, Any]:
        """Apply constant actions over one control period.

        Args:
            action: Actions [-], clipped to -1 to 1, an array on the device. A value
                that is not finite counts as zero, and its reward is not a number.
                Shape (worlds, 1).

        Returns:
            :attr:`observation`, :attr:`reward`, :attr:`terminated` and
            :attr:`truncated`.
        """
        if not self._began:
            raise InputError("step before any episode has begun; call reset() first")
        if tuple(action.shape) != self._action.shape:
            raise InputError(
                f"action of shape {tuple(action.shape)}; accepted: {self._action.shape}"
            )
        wp.copy(self._action, action)
        if self._graph is not None:
            wp.capture_launch(self._graph)
        elif self.device.is_cuda:
            self._advance()  # compiles the kernels, hence not captured
            with wp.ScopedCapture(self.device) as capture:
                self._advance()
            self._graph = capture.graph
        else:
            self._advance()
        return self.observation, self.reward, self.terminated, self.truncated

    def _advance(self) -> None:
        """One control period: torques, steps of the engine, and what follows."""
        numbers, engine, worlds = self._bench, self._engine, self._worlds
        self._launch(
            kernels.command, numbers, self._episodes, engine, worlds, self._action
        )
        for _ in range(self._sub_steps):
            mjw.step(self._m, self._d)
        self._launch(
            kernels.judge,
            numbers,
            self._channels,
            self._episodes,
            engine,
            worlds,
            self._results,
        )

    def _launch(self, kernel: Any, *inputs: Any) -> None:
        """Run a kernel with one thread per world."""
        wp.launch(kernel, dim=self._d.nworld, inputs=list(inputs), device=self.device)

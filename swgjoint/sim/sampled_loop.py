"""Control laws that run in Python and read the sensors once per control period.

A scene runs such a law if it has computed torque, a control period, sensors, link
feedback, or an external controller that was passed to :func:`swgjoint.run_scene`. The
engine's actuators still apply the motor limits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import mujoco
import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.sim.controller import Controller, Measured, Task
from swgjoint.sim.scene.feature_sections import Sensor, TorqueSensor
from swgjoint.typing import Array
from swgjoint.units import arcsec

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly
    from swgjoint.sim.thermal import Warming


_CHUNK = 1000  # recorded states between two progress reports
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


class Readings:
    """Sensor readings of a scene.

    It stores the last motor angles, from which it computes speeds.
    """

    def __init__(self, assembly: Assembly, period: float) -> None:
        """Prepare the sensors of a scene.

        Args:
            assembly: The compiled scene.
            period: Time between two readings [s].
        """
        sensors = assembly.scene.sensors
        self.encoder = (sensors.motor if sensors else None) or Sensor()
        self.link_encoder = (sensors.link if sensors else None) or Sensor()
        self._torque = (sensors.torque if sensors else None) or TorqueSensor()
        self._noise = np.random.default_rng(sensors.seed if sensors else 0)
        self._period, self._step = period, assembly.step
        self._first_speed = assembly.ratio * assembly.trajectory.velocity[0]
        self._last: Array | None = None

    def motor(self, k: int, theta: Array, rate: Array) -> tuple[Array, Array]:
        """Readings of motor angles and speeds that are used at sample k.

        Args:
            k: Index of the sample at which the readings are used.
            theta: Motor angles of all samples [rad]. Shape (n, n_joints).
            rate: Motor speeds of all samples [rad/s]. Shape (n, n_joints).

        Returns:
            Angles [rad] and speeds [rad/s]. Shapes (n_joints,).
        """
        angle = self._read(self.encoder, theta, k)
        if self.encoder.counts_per_turn is None and not self.encoder.noise_arcsec:
            return angle, rate[self.sample_of(self.encoder, k)]
        last, self._last = self._last, angle
        if last is None:
            return angle, self._first_speed
        return angle, (angle - last) / self._period

    def link(self, k: int, psi: Array) -> Array:
        """Readings of link angles that are used at sample k [rad]. Shape (n_joints,).

        Args:
            k: Index of the sample at which the readings are used.
            psi: Link angles of all samples [rad]. Shape (n, n_joints).
        """
        return self._read(self.link_encoder, psi, k)

    def torque(self, k: int, torque: Array) -> Array:
        """Readings of output torques used at sample k [N·m]. Shape (n_joints,).

        Args:
            k: Index of the sample at which the readings are used.
            torque: Output torques of all samples [N·m]. Shape (n, n_joints).
        """
        return self._noisy(
            torque[self.sample_of(self._torque, k)], self._torque.noise_Nm
        )

    def _read(self, sensor: Sensor, angle: Array, k: int) -> Array:
        """Noisy and quantised reading of an angle that is used at sample k."""
        noisy = self._noisy(
            angle[self.sample_of(sensor, k)], sensor.noise_arcsec * arcsec
        )
        if sensor.counts_per_turn is None:
            return np.asarray(noisy)
        count = 2.0 * np.pi / sensor.counts_per_turn
        return np.asarray(np.floor(noisy / count) * count)

    def _noisy(self, exact: Array, deviation: float) -> Array:
        """Values with normally distributed noise of a standard deviation."""
        if not deviation:
            return exact
        return exact + deviation * self._noise.standard_normal(exact.shape)

    def sample_of(self, sensor: Sensor | TorqueSensor, k: int) -> int:
        """Index of the sample at which the reading used at sample k was taken.

        Args:
            sensor: The sensor, with its delay.
            k: Index of the sample at which the reading is used.

        Returns:
            Index of the sample, at least zero.
        """
        return max(k - round(sensor.delay_s / self._step), 0)


class Loop(Protocol):
    """A control law that :func:`run_sampled` evaluates once per control period."""

    every: int
    """Engine steps per control period."""
    senses_torque: bool
    """Whether the law reads the output torque."""

    def torque(
        self, k: int, theta: Array, psi: Array, theta_rate: Array, torque: Array
    ) -> Array:
        """Torque of every motor until the next evaluation [N·m]. Shape (n_joints,).

        The arrays contain values up to and including sample k.

        Args:
            k: Index of the current sample.
            theta: Motor angles of all samples [rad]. Shape (n, n_joints).
            psi: Link angles of all samples [rad]. Shape (n, n_joints).
            theta_rate: Motor speeds of all samples [rad/s]. Shape (n, n_joints).
            torque: Drive torques on the links [N·m], zero if they are not measured.
                Shape (n, n_joints).
        """


class SampledLoop:
    """The scene's own control law, which stores the integrals of the angle errors."""

    senses_torque = False

    def __init__(self, assembly: Assembly) -> None:
        """Prepare the loop of a scene whose controller is sampled."""
        self.assembly, self.controller = assembly, assembly.scene.controller
        self.period, self.every = control_period(assembly)
        self._readings = Readings(assembly, self.period)
        self._integral = np.zeros(len(assembly.joints))
        section, ratio = self.controller, assembly.ratio
        inertia = assembly.rotor_inertia * ratio**2 + assembly.link_inertia
        # gains per inertia [1/s², 1/s], so that computed torque keeps the natural
        # frequency and the damping ratio of the loop
        self._kp = assembly.loops.stiffness * ratio**2 / inertia
        self._kd = assembly.loops.damping * ratio**2 / inertia
        self._by_link = section.feedback == "link"

    def torque(
        self, k: int, theta: Array, psi: Array, theta_rate: Array, torque: Array
    ) -> Array:
        """Motor torques [N·m], see :meth:`Loop.torque`. Shape (n_joints,).

        Args:
            k: Index of the current sample.
            theta: Motor angles of all samples [rad]. Shape (n, n_joints).
            psi: Link angles of all samples [rad]. Shape (n, n_joints).
            theta_rate: Motor speeds of all samples [rad/s]. Shape (n, n_joints).
            torque: Drive torques on the links; unused.
        """
        whole, path = self.assembly, self.assembly.trajectory
        ratio, loops = whole.ratio, whole.loops
        readings = self._readings
        angle, speed = readings.motor(k, theta, theta_rate)
        # compare a reading with the command of the sample at which it was taken
        then = moved = readings.sample_of(readings.encoder, k)
        if self._by_link:
            angle = ratio * readings.link(k, psi)
            then = readings.sample_of(readings.link_encoder, k)
        error = ratio * path.position[then] - angle
        velocity = path.velocity[moved]
        if self.controller.kind == "computed_torque":
            slow = speed / ratio
            wanted = (
                path.acceleration[k]
                + self._kd * (velocity - slow)
                + self._kp * error / ratio
            )
            arm = whole.known_arm
            link = arm.torques((angle / ratio)[None], slow[None], wanted[None])[0]
            return np.asarray(
                (link + whole.load) / ratio + ratio * whole.rotor_inertia * wanted
            )
        wanted = (
            loops.stiffness * error
            + loops.damping * (ratio * velocity - speed)
            + loops.integral * self._integral
            + whole.feedforward[k]
        )
        if loops.integral.any():
            largest = loops.integral_limit / loops.integral
            grown = self._integral + self.period * error
            self._integral = np.clip(grown, -largest, largest)
        return np.asarray(wanted)


class GivenLoop:
    """An external controller, which receives the task and the sensor readings."""

    def __init__(self, assembly: Assembly, controller: Controller, task: Task) -> None:
        """Start the controller with the task of the scene.

        Args:
            assembly: The compiled scene.
            controller: The external controller.
            task: Commanded motion and nominal data, see
                :func:`swgjoint.sim.scene.task.task_of`.
        """
        scene = assembly.scene
        self.controller, self._joints = controller, assembly.joints
        self.period, self.every = control_period(assembly)
        sensors = scene.sensors
        self.senses_torque = sensors is not None and sensors.torque is not None
        self._by_link = scene.controller.feedback == "link"
        self._readings = Readings(assembly, self.period)
        controller.start(task)

    def torque(
        self, k: int, theta: Array, psi: Array, theta_rate: Array, torque: Array
    ) -> Array:
        """Motor torques [N·m], see :meth:`Loop.torque`. Shape (n_joints,).

        Args:
            k: Index of the current sample.
            theta: Motor angles of all samples [rad]. Shape (n, n_joints).
            psi: Link angles of all samples [rad]. Shape (n, n_joints).
            theta_rate: Motor speeds of all samples [rad/s]. Shape (n, n_joints).
            torque: Drive torques on the links [N·m], used if the scene has a torque
                sensor. Shape (n, n_joints).

        Raises:
            ComputationError: If the controller does not return one finite torque per
                joint.
        """
        angle, speed = self._readings.motor(k, theta, theta_rate)
        measured = Measured(
            motor_angle=angle,
            motor_speed=speed,
            link_angle=self._readings.link(k, psi) if self._by_link else None,
            output_torque=self._readings.torque(k, torque)
            if self.senses_torque
            else None,
        )
        wanted = np.asarray(self.controller.torque(k // self.every, measured), float)
        if wanted.shape != angle.shape or not np.isfinite(wanted).all():
            raise ComputationError(
                f"{type(self.controller).__name__}: torque {wanted} at instant"
                f" {k // self.every}; accepted: one finite number [N·m] for each of"
                f" {', '.join(self._joints)}"
            )
        return wanted


def control_period(assembly: Assembly) -> tuple[float, int]:
    """Control period [s], and number of engine steps per control period."""
    step = assembly.scene.simulation.step_s
    period = assembly.scene.controller.control_period_s or step
    whole = round(period / step)
    return whole * step, whole * assembly.sub_steps


def run_sampled(
    assembly: Assembly,
    loop: Loop,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    inputs: Array,
    *,
    warming: Warming,
    check: Callable[[mujoco.MjData, Array], None],
    progress: Callable[[int], None],
) -> tuple[Array, Array, Array]:
    """Step the engine and evaluate the loop once per control period.

    Args:
        assembly: The compiled scene.
        loop: The control law.
        model: Model of the scene that is stepped.
        data: Engine data in the initial state.
        inputs: Actuator inputs without the torques of the loop. Shape (n_steps,
            n_inputs).
        warming: Temperatures of the drives, updated at its intervals.
        check: Called with the engine's data and the states recorded since its last
            call.
        progress: Called with the number of completed engine steps.

    Returns:
        States at the steps of the scene, shape (n, n_state); link speeds [rad/s] and
        motor torques of the loop [N·m] at every engine step, shapes
        (n_steps + 1, n_joints). The torque of a state is the torque during the step
        that led to it.
    """
    parts, n = assembly.sub_steps, len(inputs)
    joints = len(assembly.joints)
    states = np.empty((n // parts + 1, mujoco.mj_stateSize(model, _STATE)))
    theta, psi, theta_rate, torque, rates, wanted = np.zeros((6, n + 1, joints))
    flexible = np.flatnonzero(assembly.motor_position >= 0)
    motor_q = assembly.motor_position[flexible]
    motor_v = assembly.motor_velocity[flexible]
    ratio, checked, warmed = assembly.ratio, 0, 0
    mujoco.mj_getState(model, data, states[0], _STATE)
    rates[0] = data.qvel[assembly.link_velocity]
    for k in range(n):
        psi[k] = data.qpos[assembly.link_position]
        theta[k] = ratio * (psi[k] - assembly.prescribed[k])
        theta_rate[k] = ratio * (rates[k] - assembly.prescribed_rate[k])
        theta[k, flexible] = data.qpos[motor_q]
        theta_rate[k, flexible] = data.qvel[motor_v]
        if loop.senses_torque:
            for j, attached in enumerate(warming.attached):
                torque[k, j] = attached.observe(model, data).torque
        wanted[k + 1] = (
            loop.torque(k, theta, psi, theta_rate, torque)
            if k % loop.every == 0
            else wanted[k]
        )
        data.ctrl[:] = inputs[k]
        data.ctrl[:joints] += wanted[k + 1]
        mujoco.mj_step(model, data)
        rates[k + 1] = data.qvel[assembly.link_velocity]
        done = (k + 1) // parts
        if (k + 1) % parts == 0:
            mujoco.mj_getState(model, data, states[done], _STATE)
            due = warming.every and (done % warming.every == 0 or k + 1 == n)
            if done % _CHUNK == 0 or k + 1 == n or due:
                check(data, states[checked + 1 : done + 1])
                checked = done
                progress(k + 1)
            if due:
                interval = states[warmed : done + 1]
                model, data = warming.advance(model, data, interval)
                warmed = done
    wanted[0] = wanted[min(1, n)]
    return states, rates, wanted

"""Controllers that run once a control period on what sensors read, in Python.

For scenes that ask for it: computed torque, a control period, sensors, link feedback.
Limits of the motors stay with the engine's actuators.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.feature_sections import Sensor

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly

Array = NDArray[np.float64]

_CHUNK = 1000  # recorded states between two signs of life
_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


class SampledLoop:
    """The control law of all joints; holds readings and integrals between periods."""

    def __init__(self, assembly: Assembly) -> None:
        """Prepare the loop of a scene that :attr:`Scene.sampled` says has one."""
        scene = assembly.scene
        self.assembly, self.controller = assembly, scene.controller
        step = scene.simulation.step_s
        period = scene.controller.control_period_s or step
        self.period = round(period / step) * step
        self.every = round(period / step) * assembly.sub_steps
        """Steps of the engine per control period."""
        sensors = scene.sensors
        self._motor = (sensors.motor if sensors else None) or Sensor()
        self._link = (sensors.link if sensors else None) or Sensor()
        self._integral = np.zeros(len(assembly.joints))
        self._last: Array | None = None
        section, ratio = scene.controller, assembly.ratio
        inertia = assembly.rotor_inertia * ratio**2 + assembly.link_inertia
        # per unit of inertia: the loop's own natural frequency and damping
        self._kp = assembly.loops.stiffness * ratio**2 / inertia
        self._kd = assembly.loops.damping * ratio**2 / inertia
        self._by_link = section.feedback == "link"

    def torque(self, k: int, theta: Array, psi: Array, theta_rate: Array) -> Array:
        """Torque of every motor from now on [N·m]. Shape (n_joints,).

        Args:
            k: Sample of the commanded motion.
            theta: Motor angles of all samples up to this one [rad]. (k + 1, n_joints).
            psi: Link angles. Same shape.
            theta_rate: Motor speeds [rad/s]. Same shape.
        """
        whole, path = self.assembly, self.assembly.trajectory
        ratio, loops = whole.ratio, whole.loops
        angle, speed = self._read_motor(k, theta, theta_rate)
        if self._by_link:
            angle = ratio * self._read(self._link, psi, k)
        error = ratio * path.position[k] - angle
        if self.controller.kind == "computed_torque":
            slow = speed / ratio
            wanted = (
                path.acceleration[k]
                + self._kd * (path.velocity[k] - slow)
                + self._kp * error / ratio
            )
            arm = whole.known_arm
            link = arm.torques((angle / ratio)[None], slow[None], wanted[None])[0]
            return np.asarray(
                (link + whole.load) / ratio + ratio * whole.rotor_inertia * wanted
            )
        wanted = (
            loops.stiffness * error
            + loops.damping * (ratio * path.velocity[k] - speed)
            + loops.integral * self._integral
            + whole.feedforward[k]
        )
        if loops.integral.any():
            largest = loops.integral_limit / loops.integral
            grown = self._integral + self.period * error
            self._integral = np.clip(grown, -largest, largest)
        return np.asarray(wanted)

    def _read(self, sensor: Sensor, angle: Array, k: int) -> Array:
        """Angles as a sensor gives them now [rad]. Shape (n_joints,)."""
        got = angle[self._age(sensor, k)]
        if sensor.counts_per_turn is None:
            return np.asarray(got)
        count = 2.0 * np.pi / sensor.counts_per_turn
        return np.asarray(np.floor(got / count) * count)

    def _read_motor(self, k: int, theta: Array, rate: Array) -> tuple[Array, Array]:
        angle = self._read(self._motor, theta, k)
        if self._motor.counts_per_turn is None:
            return angle, rate[self._age(self._motor, k)]
        last, self._last = self._last, angle
        if last is None:
            return angle, self.assembly.ratio * self.assembly.trajectory.velocity[0]
        return angle, (angle - last) / self.period

    def _age(self, sensor: Sensor, k: int) -> int:
        """Sample of a reading that is used at sample k; before the first, the first."""
        return max(k - round(sensor.delay_s / self.assembly.step), 0)


def run_sampled(
    assembly: Assembly,
    data: mujoco.MjData,
    inputs: Array,
    *,
    check: Callable[[Array], None],
    progress: Callable[[int], None],
) -> tuple[Array, Array, Array]:
    """Step the engine with the loop in between.

    Args:
        assembly: The scene.
        data: At its start; left at the end.
        inputs: Of the engine's actuators without the loop. Shape (n_steps, n_inputs).
        check: Called with the states since its last call.
        progress: Called with the steps done.

    Returns:
        States of the scene's steps, shape (n, n_state), speeds of the links and torques
        that the loop asked for at every step of the engine, shape (n_steps + 1,
        n_joints), the torque beside the state that it led to.
    """
    model, parts, n = assembly.model, assembly.sub_steps, len(inputs)
    loop, joints = SampledLoop(assembly), len(assembly.joints)
    states = np.empty((n // parts + 1, mujoco.mj_stateSize(model, _STATE)))
    theta, psi, theta_rate, rates, wanted = np.zeros((5, n + 1, joints))
    flexible = np.flatnonzero(assembly.motor_position >= 0)
    motor_q = assembly.motor_position[flexible]
    motor_v = assembly.motor_velocity[flexible]
    ratio, checked = assembly.ratio, 0
    mujoco.mj_getState(model, data, states[0], _STATE)
    rates[0] = data.qvel[assembly.link_velocity]
    for k in range(n):
        psi[k] = data.qpos[assembly.link_position]
        theta[k] = ratio * (psi[k] - assembly.prescribed[k])
        theta_rate[k] = ratio * (rates[k] - assembly.prescribed_rate[k])
        theta[k, flexible] = data.qpos[motor_q]
        theta_rate[k, flexible] = data.qvel[motor_v]
        wanted[k + 1] = (
            loop.torque(k, theta, psi, theta_rate) if k % loop.every == 0 else wanted[k]
        )
        data.ctrl[:] = inputs[k]
        data.ctrl[:joints] += wanted[k + 1]
        mujoco.mj_step(model, data)
        rates[k + 1] = data.qvel[assembly.link_velocity]
        done = (k + 1) // parts
        if (k + 1) % parts == 0:
            mujoco.mj_getState(model, data, states[done], _STATE)
            if done % _CHUNK == 0 or k + 1 == n:
                check(states[checked + 1 : done + 1])
                checked = done
                progress(k + 1)
    wanted[0] = wanted[min(1, n)]
    return states, rates, wanted

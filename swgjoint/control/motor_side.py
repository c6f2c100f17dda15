r"""Position control on the motor's own encoder, with a plan made before the motion.

A *plan* says where the motor shall be and what torque takes it there,

.. math:: \tau = \tau_r + k_p e + k_d \dot e + k_i \int e\,dt, \quad e = \theta_r -
    \theta,

where a reading of the motor is held against the plan of the instant at which it was
taken, which is what the age of the readings in the task is for.

Plans know the link's motion and more or less of the drive: :func:`ideal_plan` a rigid
gear, :func:`rigid_plan` its torque and friction, too, and
:func:`swgjoint.control.flexible.flexible_plan` the map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.sim.controller import KnownJoints, Measured, Task
from swgjoint.typing import Array

SLOW = 0.05
"""Speed over which a friction feed-forward changes its sign [rad/s of the motor]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorPlan:
    """Motion and torque of the motors at the instants; shapes (n, ..., n_joints)."""

    angle: Array
    """[rad]."""
    speed: Array
    """[rad/s]."""
    torque: Array
    """[N·m]."""


Planner = Callable[[Task], MotorPlan]


def ideal_plan(task: Task) -> MotorPlan:
    """Motor angles that an ideal gear gives, without any torque."""
    i = task.joints.ratio
    angle = i * task.position
    return MotorPlan(angle=angle, speed=i * task.velocity, torque=np.zeros_like(angle))


def rigid_plan(task: Task) -> MotorPlan:
    r"""Inverse dynamics of the arm behind ideal gears.

    .. math:: \tau_r = T/i + i J_m \ddot q + f(i \dot q, T/i)

    with T the known torque of the arm on the motion, weight and inertia included, from
    the engine or from :mod:`swgjoint.control.pinocchio_arm`, and f the friction that
    the known drives have.
    """
    joints, i = task.joints, task.joints.ratio
    plan = ideal_plan(task)
    torque = task.link_torque / i + i * joints.rotor_inertia * task.acceleration
    torque += known_friction(task.joints, plan.speed, task.velocity, task.link_torque)
    return MotorPlan(angle=plan.angle, speed=plan.speed, torque=torque)


def known_friction(
    joints: KnownJoints, motor_speed: Array, link_speed: Array, link_torque: Array
) -> Array:
    r"""Motor torque against the friction of the known drives, slipping [N·m].

    :math:`F = f\tanh(\nu/\nu_0) + \eta\nu` with :math:`\nu` the speed of the wave
    generator against the flexspline, see :mod:`swgjoint.maps.friction`. Where the
    flexspline is the output F also pushes that, which comes back through the gear:
    :math:`F\,\partial\nu/\partial\dot\theta` with :math:`\dot\psi =
    \dot\theta/i`.

    Args:
        joints: Drives, some of which have friction.
        motor_speed: [rad/s]. Shape (n, ..., n_joints).
        link_speed: [rad/s]. Same shape.
        link_torque: [N·m]. Same shape.
    """
    out = np.zeros_like(motor_speed)
    for j, drive in enumerate(joints.drives):
        law = drive.friction
        if law is None:
            continue
        by_theta, by_psi = drive.friction_direction
        nu = by_theta * motor_speed[..., j] + by_psi * link_speed[..., j]
        slip = law.yield_torque(nu, link_torque[..., j] / drive.ratio)
        rubs = slip * np.tanh(nu / SLOW) + law.viscous * nu
        out[..., j] = (by_theta + by_psi / drive.ratio) * rubs
    return out


class MotorPID:
    r"""PD or PID on the motor angle about a plan.

    Gains follow from the natural frequency and damping ratio of a rigid drive,
    :math:`k_p = J\omega^2`, :math:`k_d = 2\zeta J\omega` with :math:`J = J_m +
    J_l/i^2`, as in scenes, or are given outright. The integral acts from the next
    instant on and stops where its torque reaches the limit.
    """

    def __init__(
        self,
        plan: Planner = rigid_plan,
        *,
        frequency: ArrayLike = 8.0,
        damping_ratio: ArrayLike = 1.0,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        integral_time: float | None = None,
        integral_limit: ArrayLike = np.inf,
    ) -> None:
        """Gains of all joints; arrays broadcast against (..., n_joints).

        Args:
            plan: What the motor shall do, made at the start of every task.
            frequency: Natural frequency of the loop [Hz].
            damping_ratio: [-].
            stiffness: Gain on the motor angle instead [N·m/rad].
            damping: Gain on the motor speed instead [N·m·s/rad].
            integral_time: k_p/k_i [s]; None: no integral.
            integral_limit: Largest torque of the integral [N·m].
        """
        self.plan = plan
        self._omega = 2.0 * np.pi * np.asarray(frequency, float)
        self._zeta = np.asarray(damping_ratio, float)
        self._given = stiffness, damping
        self._integral_time = integral_time
        self._limit = np.asarray(integral_limit, float)

    def start(self, task: Task) -> None:
        """Make the plan and forget the integral."""
        joints = task.joints
        inertia = joints.rotor_inertia + joints.link_inertia / joints.ratio**2
        kp, kd = self._given
        self.stiffness = np.asarray(inertia * self._omega**2 if kp is None else kp)
        """Gain on the motor angle [N·m/rad]."""
        self.damping = np.asarray(
            2.0 * self._zeta * self._omega * inertia if kd is None else kd
        )
        """Gain on the motor speed [N·m·s/rad]."""
        self.planned = self.plan(task)
        self._angle = task.as_read(self.planned.angle, "motor")
        self._speed = task.as_read(self.planned.speed, "motor")
        self._period = task.period
        self._integral: Array = np.zeros(task.position.shape[1:])

    def torque(self, k: int, measured: Measured) -> Array:
        """See :class:`swgjoint.sim.controller.Controller`."""
        error = self._angle[k] - measured.motor_angle
        wanted = (
            self.stiffness * error
            + self.damping * (self._speed[k] - measured.motor_speed)
            + self._integral
            + self.planned.torque[k]
        )
        if self._integral_time is not None:
            gain = self._period / self._integral_time * self.stiffness
            self._integral = np.clip(
                self._integral + gain * error, -self._limit, self._limit
            )
        return np.asarray(wanted)

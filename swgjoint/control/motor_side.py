r"""Position control of the motor angle along a plan that is made before the motion.

A *plan* contains the reference angle :math:`\theta_r` of the motor and the feed-forward
torque :math:`\tau_r`; the controller adds feedback,

.. math:: \tau = \tau_r + k_p e + k_d \dot e + k_i \int e\,dt, \quad e = \theta_r -
    \theta.

A motor reading is compared with the plan at the instant at which the reading was taken;
the task states the age of the readings.

All plans use the link motion; they differ in the model of the drive:
:func:`ideal_plan` assumes an ideal gear without torque, :func:`rigid_plan` adds torque
and friction, and :func:`swgjoint.control.flexible.flexible_plan` uses the map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.sim.controller import KnownJoints, Measured, Task
from swgjoint.typing import Array

SLOW = 0.05
"""Speed nu_0 over which the friction feed-forward changes sign [rad/s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorPlan:
    """Planned motion and torque of the motors at the n control instants."""

    angle: Array
    """Motor angle [rad]. Shape (n, ..., n_joints)."""
    speed: Array
    """Motor speed [rad/s]. Shape (n, ..., n_joints)."""
    torque: Array
    """Motor torque [N·m]. Shape (n, ..., n_joints)."""


Planner = Callable[[Task], MotorPlan]
"""Function that makes the plan of a task."""


def ideal_plan(task: Task) -> MotorPlan:
    """Motor motion of an ideal gear, without feed-forward torque."""
    i = task.joints.ratio
    angle = i * task.position
    return MotorPlan(angle=angle, speed=i * task.velocity, torque=np.zeros_like(angle))


def rigid_plan(task: Task) -> MotorPlan:
    r"""Inverse dynamics of the arm on ideal gears.

    .. math:: \tau_r = T/i + i J_m \ddot q + f(i \dot q, T/i)

    T is the known link torque of the motion, including weight and inertia, computed by
    MuJoCo or :mod:`swgjoint.control.pinocchio_arm`; f is the friction torque of the
    known drives.
    """
    joints, i = task.joints, task.joints.ratio
    plan = ideal_plan(task)
    torque = task.link_torque / i + i * joints.rotor_inertia * task.acceleration
    torque += known_friction(task.joints, plan.speed, task.velocity, task.link_torque)
    return MotorPlan(angle=plan.angle, speed=plan.speed, torque=torque)


def known_friction(
    joints: KnownJoints, motor_speed: Array, link_speed: Array, link_torque: Array
) -> Array:
    r"""Motor torque that overcomes the sliding friction of the known drives [N·m].

    The friction torque is :math:`F = f\tanh(\nu/\nu_0) + \eta\nu` with the yield torque
    f, the viscous coefficient :math:`\eta` and the speed :math:`\nu` of the wave
    generator relative to the flexspline, see :mod:`swgjoint.maps.friction`.
    :data:`SLOW` is :math:`\nu_0`. If the flexspline is the output, F also acts on the
    output, and the gear transmits this part back to the motor. The motor torque is
    therefore :math:`F\,d\nu/d\dot\theta` with :math:`\dot\psi = \dot\theta/i`.

    Args:
        joints: Nominal data of the joints; drives without friction contribute zero.
        motor_speed: Motor speed [rad/s]. Shape (n, ..., n_joints).
        link_speed: Link speed [rad/s]. Same shape.
        link_torque: Torque of the drive on the link [N·m]. Same shape.

    Returns:
        Motor torque [N·m]. Same shape.
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
    r"""PD or PID control of the motor angle along a plan.

    The gains are given as arguments or follow from natural frequency and damping ratio
    of the joint with a rigid drive, as in scenes: :math:`k_p = J\omega^2` and
    :math:`k_d = 2\zeta J\omega` with :math:`J = J_m + J_l/i^2`. An error changes the
    integral torque from the next instant on; this torque is limited.
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
        """Set the gains; arrays are broadcast to shape (..., n_joints).

        Args:
            plan: Planner that is called at the start of every task.
            frequency: Natural frequency of the loop [Hz].
            damping_ratio: Damping ratio of the loop [-].
            stiffness: Position gain k_p [N·m/rad]; None derives it from the frequency.
            damping: Speed gain k_d [N·m·s/rad]; None derives it from the frequency and
                the damping ratio.
            integral_time: Integral time k_p/k_i [s]; None disables the integral.
            integral_limit: Largest magnitude of the integral torque [N·m].
        """
        self.plan = plan
        self._omega = 2.0 * np.pi * np.asarray(frequency, float)
        self._zeta = np.asarray(damping_ratio, float)
        self._given = stiffness, damping
        self._integral_time = integral_time
        self._limit = np.asarray(integral_limit, float)

    def start(self, task: Task) -> None:
        """Make the plan, compute the gains and reset the integral."""
        joints = task.joints
        inertia = joints.rotor_inertia + joints.link_inertia / joints.ratio**2
        kp, kd = self._given
        self.stiffness = np.asarray(inertia * self._omega**2 if kp is None else kp)
        """Position gain k_p [N·m/rad]."""
        self.damping = np.asarray(
            2.0 * self._zeta * self._omega * inertia if kd is None else kd
        )
        """Speed gain k_d [N·m·s/rad]."""
        self.planned = self.plan(task)
        self._angle = task.as_read(self.planned.angle, "motor")
        self._speed = task.as_read(self.planned.speed, "motor")
        self._period = task.period
        self._integral: Array = np.zeros(task.position.shape[1:])

    def torque(self, k: int, measured: Measured) -> Array:
        """Motor torques, feed-forward plus feedback [N·m]. Shape (..., n_joints).

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.
        """
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

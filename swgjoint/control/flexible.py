r"""Feed-forward for an elastic drive: motor motion and torque from the link motion.

To follow :math:`\psi(t)`, the link needs the drive torque T(t). The drive map then
determines the motor angle :math:`\theta(t)` by

.. math:: F_\psi(\theta, \psi) - C\,\dot\Delta\,\partial_\psi\Delta = T.

Here :math:`F_\theta` and :math:`F_\psi` are the elastic torques on motor and output,
:math:`\Delta` is the torsion and C is the damping along it. Differentiation gives motor
speed and acceleration, and the motor torque is

.. math:: \tau = J_m \ddot\theta - F_\theta(\theta, \psi)
    + C\,\dot\Delta\,\partial_\theta\Delta + f(\dot\theta, T/i)

with the rotor inertia :math:`J_m` and the friction torque f. The plan thus accounts for
torsion, stiffness curve and kinematic error of the map. With constant stiffness and
without kinematic error it reduces to the feed-forward of Spong (1987), with T and its
derivatives written out.

Source:
    Spong (1987), "Modeling and control of elastic joint robots", J. Dyn. Sys. Meas.
    Control 109, 310-319; De Luca (2000), "Feedforward/feedback laws for the control of
    flexible robots", IEEE ICRA, 233-240.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline

from swgjoint.control.motor_side import MotorPlan, known_friction
from swgjoint.errors import ComputationError
from swgjoint.joint.prescribed import motor_of_link
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import Task
from swgjoint.typing import Array

RTOL = 1e-9
"""Tolerance of the torque residual relative to rated torque [-]."""
ROUNDS = 3
"""Number of fixed-point iterations for the damping torque, which amounts to a few
percent of the changes of T."""
_CHUNK = 2048  # samples per call, so that the coefficient table fits in the CPU cache
_DEGREE = 5


def flexible_plan(task: Task) -> MotorPlan:
    """Motor motion and torque that make the known drives move the link as commanded.

    A quintic spline through the samples differentiates torsion and kinematic error; the
    derivatives of the ideal motion are those of the task. The planned speed is the
    change of the planned angle over the last period divided by the period, which is the
    speed that an encoder and the integrator ``discrete`` report. It is therefore half a
    period old; the exact speed would differ from the reading by a term of first order
    in the period.

    A motion whose torque jumps would require a torque impulse from the motor. The ramps
    of scenes are smooth enough; steps and trapezoids are not. For a drive of level
    ``rigid``, which has no torsion, the plan compensates only the kinematic error.

    Raises:
        ComputationError: If the map does not reach a torque of the motion.
    """
    joints, i = task.joints, task.joints.ratio
    damping = np.broadcast_to(joints.damping, task.position.shape[1:])
    angle = np.empty_like(task.position)
    for j, drive in enumerate(joints.drives):
        angle[..., j] = _motor_angle(
            drive,
            task.position[..., j],
            task.velocity[..., j],
            task.link_torque[..., j],
            damping=damping[..., j],
            period=task.period,
        )
    _, ahead_rate, ahead_bend = _derivatives(angle - i * task.position, task.period)
    speed = i * task.velocity + ahead_rate
    bend = i * task.acceleration + ahead_bend
    read = np.vstack([speed[:1], np.diff(angle, axis=0) / task.period])
    on_motor = np.empty_like(angle)
    for j, drive in enumerate(joints.drives):
        on_motor[..., j] = _input_torque(
            drive,
            angle[..., j],
            task.position[..., j],
            speed[..., j],
            task.velocity[..., j],
            torque=task.link_torque[..., j],
            damping=damping[..., j],
        )
    wanted = joints.rotor_inertia * bend + on_motor
    wanted += known_friction(joints, speed, task.velocity, task.link_torque)
    return MotorPlan(angle=angle, speed=read, torque=wanted)


def motor_angle(drive: DriveMap, psi: Array, torque: Array) -> Array:
    """Motor angles at which the elastic torque on the output has given values.

    Args:
        drive: Map of the drive.
        psi: Output angles [rad]. Any shape.
        torque: Elastic torques on the output [N·m]. Same shape.

    Returns:
        Motor angles [rad]. Same shape.

    Raises:
        ComputationError: If the mean curve of the map does not reach a torque, or if
            the iteration does not converge.
    """
    at, wanted = psi.reshape(-1), torque.reshape(-1)
    try:
        low, high = (drive.mean_torsion(float(f(wanted))) for f in (np.min, np.max))
    except ValueError as failure:
        raise ComputationError(f"drive {drive.name!r}: {failure}") from None
    torsion = np.linspace(low, high, 65)
    curve = drive.coefficients(torsion, 1)[:, 0, 0]
    mean = np.interp(wanted, curve, torsion)
    parts = [slice(k, k + _CHUNK) for k in range(0, at.size, _CHUNK)]
    pieces = [_solve(drive, at[k], wanted[k], mean[k]) for k in parts]
    return np.concatenate(pieces).reshape(psi.shape)


def _solve(drive: DriveMap, psi: Array, torque: Array, mean: Array) -> Array:
    """Motor angles [rad] by Newton's method from initial torsions ``mean`` [rad]."""
    i, rated = drive.ratio, drive.ratings.rated_torque
    theta = i * (psi + mean - drive.error_at(drive.phases(i * psi, psi))[0])
    softest = 1e-3 * drive.mean_stiffness / i**2
    nudge = 1e-7 * abs(i)  # 1e-7 rad of the output
    for _ in range(50):
        residual = drive.law(theta, psi).output_force - torque
        if np.abs(residual).max() <= RTOL * rated:
            return np.asarray(theta)
        ahead = drive.law(theta + nudge, psi).output_force
        behind = drive.law(theta - nudge, psi).output_force
        # d(torque)/d(theta) times the sign of i, which is never negative
        slope = (ahead - behind) / (2.0 * nudge) * np.sign(i)
        theta = theta - np.sign(i) * residual / np.maximum(slope, softest * abs(i))
    worst = int(np.abs(residual).argmax())
    raise ComputationError(
        f"drive {drive.name!r}: no motor angle for {torque[worst]:.4g} N·m at the"
        f" output (residual: {residual[worst]:.2g} N·m); lower acceleration or load"
    )


def _motor_angle(
    drive: DriveMap,
    psi: Array,
    psi_rate: Array,
    torque: Array,
    *,
    damping: Array,
    period: float,
) -> Array:
    """Motor angles of one joint along motions with damping [rad]. Shape (n, ...)."""
    if drive.level == "rigid":
        return motor_of_link(drive, psi)
    theta = motor_angle(drive, psi, torque)
    for _ in range(ROUNDS if damping.any() else 0):
        theta_rate = (
            drive.ratio * psi_rate + _derivatives(theta - drive.ratio * psi, period)[1]
        )
        rate, _, by_psi = _torsion_rate(drive, theta, psi, theta_rate, psi_rate)
        theta = motor_angle(drive, psi, torque + damping * rate * by_psi)
    return theta


def _input_torque(
    drive: DriveMap,
    theta: Array,
    psi: Array,
    theta_rate: Array,
    psi_rate: Array,
    *,
    torque: Array,
    damping: Array,
) -> Array:
    """Motor torque that balances elastic and damping torque of the drive [N·m]."""
    if drive.level == "rigid":
        return np.asarray(torque / drive.ratio)
    shape = theta.shape
    flat = [x.reshape(-1) for x in (theta, psi, theta_rate, psi_rate)]
    out = np.concatenate(
        [
            -drive.law(a[k : k + _CHUNK], b[k : k + _CHUNK]).input_force
            for a, b in [flat[:2]]
            for k in range(0, flat[0].size, _CHUNK)
        ]
    ).reshape(shape)
    rate, by_theta, _ = _torsion_rate(drive, theta, psi, theta_rate, psi_rate)
    return np.asarray(out + damping * rate * by_theta)


def _torsion_rate(
    drive: DriveMap, theta: Array, psi: Array, theta_rate: Array, psi_rate: Array
) -> tuple[Array, Array, Array]:
    """Torsion rate [rad/s], and torsion derivatives d/d(theta) and d/d(psi) [-]."""
    _, e_theta, e_psi = drive.error_at(drive.phases(theta, psi))
    by_theta, by_psi = 1.0 / drive.ratio + e_theta, -1.0 + e_psi
    return by_theta * theta_rate + by_psi * psi_rate, by_theta, by_psi


def _derivatives(values: Array, period: float) -> tuple[Array, Array, Array]:
    """Values and first two time derivatives along axis 0, by a quintic spline."""
    count = len(values)
    if count <= _DEGREE:
        return values, np.zeros_like(values), np.zeros_like(values)
    time = period * np.arange(count)
    spline = make_interp_spline(time, values, k=_DEGREE)
    return values, spline(time, 1), spline(time, 2)

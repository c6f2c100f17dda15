r"""Optimal point-to-point motions of flexible joints, including the drive maps.

The method is direct collocation. In each of N equal intervals the motor torques are
constant, as with a sampled controller, and angles and rates are polynomials through the
start of the interval and three Gauss-Legendre points. At these points the dynamics are
implicit constraints,

.. math:: M(q)\,a + h(q, v) = F_{drives}(q, v) + \tau_{motors},

so that the inertia matrix is not inverted. The cost is the winding loss of the motion,
:math:`\int \sum_j (\tau_j/\tau_{rated,j})^2 dt`, or the duration. Bounds apply to the
motor torques and, at the collocation points, to the elastic torques of the drives.

The drives follow the smooth law of :func:`swgjoint.control.symbolic.smooth_forces`,
without hysteresis and presliding. Such polynomials cannot represent harmonics whose
phase changes by a large part of a period within an interval; omit these harmonics from
the map (:meth:`~swgjoint.maps.drive_map.DriveMap.with_harmonics`).

Source:
    Betts (2010), "Practical methods for optimal control and estimation using nonlinear
    programming", 2nd ed., ch. 4; Waechter, Biegler (2006), "On the implementation of an
    interior-point filter line-search algorithm", Math. Program. 106, 25-57.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from swgjoint.control.symbolic import casadi
from swgjoint.control.symbolic_arm import SymbolicArm
from swgjoint.errors import ComputationError, InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.typing import Array

DEGREE = 3
"""Number of collocation points per interval; the error at interval ends is of order six
in the length of the interval."""
ITERATIONS = 500
"""Largest number of IPOPT iterations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OptimalMotion:
    """Motion from rest to rest in n intervals.

    The n_q coordinates are in the order of the model.
    """

    time: Array
    """Times of the interval ends [s]. Shape (n + 1,)."""
    position: Array
    """Angles of rotors and links at these times [rad]. Shape (n + 1, n_q)."""
    velocity: Array
    """Speeds of rotors and links at these times [rad/s]. Shape (n + 1, n_q)."""
    motor_torque: Array
    """Motor torques in every interval [N·m]. Shape (n, n_joints)."""
    drive_torque: Array
    """Elastic torques along the torsion at the interval ends [N·m]. Shape (n + 1,
    n_joints)."""
    loss: float
    """Winding loss: time integral of the sum over all joints of the squared motor
    torque, relative to rated torque over ratio [s]."""
    iterations: int
    """Number of IPOPT iterations."""

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.time[-1])


def optimal_motion(
    arm: SymbolicArm,
    drives: list[JointDrive],
    *,
    start: ArrayLike,
    end: ArrayLike,
    duration: float,
    minimise: str = "loss",
    torque_limit: ArrayLike = np.inf,
    drive_limit: ArrayLike = np.inf,
    intervals: int = 50,
) -> OptimalMotion:
    """Compute an optimal motion of an arm from rest to rest.

    Args:
        arm: Arm from :func:`~swgjoint.control.symbolic_arm.symbolic_arm`.
        drives: Drives of the arm, in the same order.
        start: Link angles at the start [rad]. Shape (n_joints,).
        end: Link angles at the end [rad]. Shape (n_joints,).
        duration: Duration of the motion [s]. If it is minimised, this is the initial
            guess, and durations from 0.05 to 20 times the guess are allowed.
        minimise: ``loss`` or ``time``.
        torque_limit: Torque limits of the motors [N·m], finite to minimise the time.
            Shape (n_joints,) or scalar.
        drive_limit: Limits of the elastic torques of the drives [N·m]. Shape
            (n_joints,) or scalar.
        intervals: Number of intervals N.

    Raises:
        InputError: If an argument is not accepted.
        ComputationError: If IPOPT does not converge.
    """
    ca = casadi()
    n, ratio = len(drives), np.array([d.ratio for d in drives])
    psi = [np.broadcast_to(np.asarray(x, float), (n,)) for x in (start, end)]
    top = np.broadcast_to(np.asarray(torque_limit, float), (n,))
    most = np.broadcast_to(np.asarray(drive_limit, float), (n,))
    if minimise not in ("loss", "time"):
        raise InputError(f"minimise {minimise!r}; accepted: loss, time")
    if minimise == "time" and not np.isfinite(top).all():
        raise InputError("minimise 'time' needs a finite torque_limit for every motor")
    if not (0.0 < duration < np.inf and intervals >= 2):
        raise InputError(
            f"duration {duration:g} s, intervals {intervals}; accepted: > 0 s and >= 2"
        )
    size = arm.inverse_dynamics.size1_in(0)
    unit = np.ones(size)
    unit[arm.rotors] = ratio  # motor angles referred to the output side
    rated = np.array([d.drive.ratings.rated_torque for d in drives])
    of_motor = rated / np.abs(ratio)
    point = _dynamics(arm, unit, rated, of_motor)
    rests = [rest_at(arm, drives, x) for x in psi]
    (q0, u0), (q1, u1) = rests

    problem = ca.Opti()
    ends = problem.variable(2 * size, intervals + 1)
    inner = [problem.variable(2 * size, intervals) for _ in range(DEGREE)]
    shares = problem.variable(n, intervals)
    total = problem.variable() if minimise == "time" else duration
    step = total / intervals
    C, D, _ = ca.collocation_coeff(ca.collocation_points(DEGREE, "legendre"))
    every = point.map(intervals)
    states = [ends[:, :-1], *inner]
    for j, here in enumerate(inner):
        slope = sum(C[r, j] * state for r, state in enumerate(states)) / step
        left, torque = every(here[:size, :], here[size:, :], slope[size:, :], shares)
        problem.subject_to(ca.vec(slope[:size, :] - here[size:, :]) == 0)
        problem.subject_to(ca.vec(left) == 0)
        for k in np.flatnonzero(np.isfinite(most)):
            bound = most[k] / rated[k]
            problem.subject_to(problem.bounded(-bound, torque[int(k), :], bound))
    after = sum(D[r] * state for r, state in enumerate(states))
    problem.subject_to(ca.vec(ends[:, 1:] - after) == 0)
    still = np.zeros(size)
    problem.subject_to(ends[:, 0] == np.concatenate([q0 / unit, still]))
    problem.subject_to(ends[:, -1] == np.concatenate([q1 / unit, still]))
    for k in np.flatnonzero(np.isfinite(top)):
        bound = top[k] / of_motor[k]
        problem.subject_to(problem.bounded(-bound, shares[int(k), :], bound))
    loss = step * ca.sumsqr(shares)
    if minimise == "time":
        problem.subject_to(problem.bounded(0.05 * duration, total, 20.0 * duration))
        problem.set_initial(total, duration)
        # a small weight on the loss keeps torques small that do not affect the time
        problem.minimize(total + 1e-3 * loss)
    else:
        problem.minimize(loss)
    between, holding = (q0 / unit, q1 / unit), (u0 / of_motor, u1 / of_motor)
    _guess(problem, ends, inner, shares, between, holding, duration)
    problem.solver(
        "ipopt",
        {"print_time": False, "error_on_fail": False},
        {"print_level": 0, "sb": "yes", "max_iter": ITERATIONS, "tol": 1e-9},
    )
    try:
        solved = problem.solve()
    except RuntimeError:
        reason = problem.return_status()
        raise ComputationError(
            f"no optimal motion: IPOPT reports {reason}; allow more time, higher"
            " limits or another number of intervals"
        ) from None
    found = np.asarray(solved.value(ends)).T
    torque = np.atleast_2d(solved.value(shares)).T * of_motor
    seconds = float(solved.value(total)) if minimise == "time" else duration
    position = found[:, :size] * unit
    return OptimalMotion(
        time=np.linspace(0.0, seconds, intervals + 1),
        position=position,
        velocity=found[:, size:] * unit,
        motor_torque=torque,
        drive_torque=np.column_stack(
            [
                _elastic(d, position[:, r], position[:, k])
                for d, r, k in zip(drives, arm.rotors, arm.links, strict=True)
            ]
        ),
        loss=float(solved.value(loss)),
        iterations=int(problem.stats()["iter_count"]),
    )


def rest_at(
    arm: SymbolicArm, drives: list[JointDrive], psi: Array
) -> tuple[Array, Array]:
    """Equilibrium of an arm at given link angles.

    Args:
        arm: Arm from :func:`~swgjoint.control.symbolic_arm.symbolic_arm`.
        drives: Drives of the arm, in the same order.
        psi: Link angles [rad]. Shape (n_joints,).

    Returns:
        Angles of rotors and links [rad], shape (n_q,), and motor torques that hold the
        arm there [N·m], shape (n_joints,).
    """
    size = arm.inverse_dynamics.size1_in(0)
    q, still = np.zeros(size), np.zeros(size)
    q[arm.links] = psi
    # the gravity torque does not depend on the rotor angles
    load = arm.inverse_dynamics(q, still, still).full().ravel()
    for drive, r, k in zip(drives, arm.rotors, arm.links, strict=True):
        wanted, law, at = load[k], drive.drive, q[k]
        swing = 2.0 * np.abs(law.kinematic_error).sum() + 1e-6
        middle = at + law.mean_torsion(wanted)

        def left(s: float, law: Any = law, at: float = at, T: float = wanted) -> float:
            return float(law.forces(law.ratio * s, at)[1]) - T

        q[r] = law.ratio * brentq(left, middle - swing, middle + swing, xtol=1e-15)
    tau, _ = arm.drive_forces(q, still)
    return q, load[arm.rotors] - tau.full().ravel()[arm.rotors]


def replay(
    model: mujoco.MjModel, arm: SymbolicArm, motion: OptimalMotion, *, parts: int = 50
) -> Array:
    """Simulate a motion open-loop in MuJoCo.

    Args:
        model: Compiled arm. Its integrator is used, and its time step is overwritten.
        arm: Symbolic arm of the same model.
        motion: Motion whose start state and motor torques are used.
        parts: Number of simulation steps per interval.

    Returns:
        Angles of rotors and links at the interval ends [rad]. Shape (n + 1, n_q).
    """
    data = mujoco.MjData(model)
    model.opt.timestep = motion.time[1] / parts
    data.qpos[:], data.qvel[:] = motion.position[0], motion.velocity[0]
    positions = [data.qpos.copy()]
    for torque in motion.motor_torque:
        data.qfrc_applied[arm.rotors] = torque
        mujoco.mj_step(model, data, parts)
        positions.append(data.qpos.copy())
    return np.array(positions)


def _dynamics(arm: SymbolicArm, unit: Array, rated: Array, of_motor: Array) -> Any:
    """Function ``(z, w, a, share) -> (residual of the dynamics, drive torques)``.

    All quantities are scaled: angles, speeds and accelerations refer to the output
    side, ``share`` is the motor torque relative to rated torque over ratio, and drive
    torques are relative to rated torque.
    """
    ca = casadi()
    size, n = len(unit), len(rated)
    z, w, a = (ca.SX.sym(name, size) for name in "zwa")
    share = ca.SX.sym("share", n)
    scale = ca.DM(unit)
    force, _ = arm.drive_forces(z * scale, w * scale)
    needed = arm.inverse_dynamics(z * scale, w * scale, a * scale)
    motors = ca.SX(size, 1)
    motors[arm.rotors.tolist()] = share * ca.DM(of_motor)
    left = (needed - force - motors) * scale / float(rated.mean())
    torque = arm.elastic(z * scale) / ca.DM(rated)
    return ca.Function("point", [z, w, a, share], [left, torque])


def _guess(
    problem: Any,
    ends: Any,
    inner: list[Any],
    shares: Any,
    between: tuple[Array, Array],
    holding: tuple[Array, Array],
    duration: float,
) -> None:
    """Set the initial guess: a quintic motion and interpolated holding torques."""
    count = ends.size2() - 1
    low, high = (x[:, None] for x in between)
    for variable, t in (
        (ends, np.linspace(0.0, 1.0, count + 1)),
        *((x, (np.arange(count) + 0.5) / count) for x in inner),
    ):
        way = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
        rate = 30.0 * t**2 * (1.0 - t) ** 2 / duration
        problem.set_initial(
            variable, np.vstack([low + (high - low) * way, (high - low) * rate])
        )
    way = (np.arange(count) + 0.5) / count
    held = [u[:, None] for u in holding]
    problem.set_initial(shares, held[0] * (1.0 - way) + held[1] * way)


def _elastic(drive: JointDrive, theta: Array, psi: Array) -> Array:
    """Elastic torque along the torsion [N·m]."""
    law = drive.drive
    return law.torque(law.torsion(theta, psi), theta, psi)

r"""Optimal point-to-point motions of flexible joints, the map of the drives included.

Direct collocation: in each of N equal intervals the motor torques stand still, as a
sampled controller holds them, and angles and rates are polynomials through three
Gauss-Legendre points. The dynamics stay implicit there,

.. math:: M(q)\,a + h(q, v) = F_{drives}(q, v) + \tau_{motors},

so that no inertia is inverted. Cost is the loss in the windings over the motion,
:math:`\int \sum_j (\tau_j/\tau_{rated,j})^2 dt`, or the time. Bounds are those of the
motors and of the torque through the drives (by their elastic torque, which is what
turns the torsion).

The drives have the smooth law of :func:`swgjoint.control.symbolic.smooth_forces`: no
hysteresis, and friction without presliding. Harmonics that turn by a good part of a
wave in an interval have to be left out of the map
(:meth:`~swgjoint.maps.drive_map.DriveMap.with_harmonics`): polynomials through three
points do not follow them.

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
"""Points of an interval: of sixth order at its end."""
ITERATIONS = 500


@dataclass(frozen=True, kw_only=True, eq=False)
class OptimalMotion:
    """Motion from rest to rest; n intervals, q and v in the order of the model."""

    time: Array
    """Ends of the intervals [s]. Shape (n + 1,)."""
    position: Array
    """[rad]. Shape (n + 1, n_q)."""
    velocity: Array
    """[rad/s]. Same shape."""
    motor_torque: Array
    """In every interval [N·m]. Shape (n, n_joints)."""
    drive_torque: Array
    """Elastic torque along the torsion, at the ends [N·m]. Shape (n + 1, n_joints)."""
    loss: float
    """Integral of the squared shares of rated motor torque [s]."""
    iterations: int

    @property
    def duration(self) -> float:
        """[s]."""
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
    """Motor torques that take an arm from rest to rest.

    Args:
        arm: From :func:`~swgjoint.control.symbolic_arm.symbolic_arm`.
        drives: Its drives.
        start: Link angles [rad]. Shape (n_joints,).
        end: Link angles [rad]. Shape (n_joints,).
        duration: Of the motion; where the time is minimised, a guess [s].
        minimise: ``loss`` or ``time``.
        torque_limit: Of the motors [N·m]. Shape (n_joints,).
        drive_limit: Of the torque through the drives [N·m]. Shape (n_joints,).
        intervals: N.

    Raises:
        InputError: If an argument cannot be used.
        ComputationError: If no such motion is found.
    """
    ca = casadi()
    n, ratio = len(drives), np.array([d.ratio for d in drives])
    psi = [np.broadcast_to(np.asarray(x, float), (n,)) for x in (start, end)]
    top = np.broadcast_to(np.asarray(torque_limit, float), (n,))
    most = np.broadcast_to(np.asarray(drive_limit, float), (n,))
    if minimise not in ("loss", "time"):
        raise InputError(f"minimise {minimise!r}; accepted: loss, time")
    if minimise == "time" and not np.isfinite(top).all():
        raise InputError("the shortest time needs a torque_limit of every motor")
    if not (0.0 < duration < np.inf and intervals >= 2):
        raise InputError(
            f"duration {duration:g} s, intervals {intervals}; accepted: > 0 s, at least"
            " 2"
        )
    size = arm.inverse_dynamics.size1_in(0)
    unit = np.ones(size)
    unit[arm.rotors] = ratio  # motors count on the output side
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
        # a thousandth of the loss: torques that do not matter are small
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
            f"no optimal motion: IPOPT says {reason}; give more time, higher limits or"
            " another number of intervals"
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
    """Positions of the model and motor torques that hold links at angles."""
    size = arm.inverse_dynamics.size1_in(0)
    q, still = np.zeros(size), np.zeros(size)
    q[arm.links] = psi
    # the weight of a rotor does not depend on where it stands
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
    """Positions of the engine under the torques of a motion, nothing fed back [rad].

    Args:
        model: With its integrator; the step is set.
        arm: Of that model.
        motion: Held torques.
        parts: Steps of the engine in an interval.

    Returns:
        At the ends of the intervals. Shape (n + 1, n_q).
    """
    data = mujoco.MjData(model)
    model.opt.timestep = motion.time[1] / parts
    data.qpos[:], data.qvel[:] = motion.position[0], motion.velocity[0]
    found = [data.qpos.copy()]
    for torque in motion.motor_torque:
        data.qfrc_applied[arm.rotors] = torque
        mujoco.mj_step(model, data, parts)
        found.append(data.qpos.copy())
    return np.array(found)


def _dynamics(arm: SymbolicArm, unit: Array, rated: Array, of_motor: Array) -> Any:
    """``(z, w, a, share) -> (what is left of the dynamics, drive torques)``, scaled."""
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
    """A smooth motion: the quintic from rest to rest, and the torques that hold."""
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
    law = drive.drive
    return law.torque(law.torsion(theta, psi), theta, psi)

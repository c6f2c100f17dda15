r"""Model-predictive control of flexible joints with torque limits of motor and drive.

The plan of :func:`swgjoint.control.flexible.flexible_plan` contains the nonlinear map.
A linear two-mass model of every joint describes deviations from the plan. With motor
quantities referred to the output side, the state consists of :math:`x =
(\delta\theta/i, \delta\psi)` and its rates, and

.. math::
    i^2 J_m \ddot x_1 = i\,(u + d_m) - \delta T, \quad
    J_l \ddot x_2 = \delta T + d_l, \quad
    \delta T = k\,(x_1 - x_2) + C\,(\dot x_1 - \dot x_2),

where u is the motor torque in addition to the plan and k is the stiffness of the map at
the current point of the plan. A Kalman filter estimates the state and the disturbances
:math:`d_m, d_l` (friction, load and other model errors) from the readings. The
set-point compensates the disturbances, so that a constant disturbance causes no steady
error of the measured quantity. At every instant, the controller solves

.. math::
    \min_u \sum_{j<N} \left( \frac{x_{2,j}^2}{e^2} + \frac{u_j^2}{f^2} \right)
    + x_N^T P x_N, \quad |\tau_r + u_j| \le \tau_{max}, \quad
    |T_r + \delta T_j| \le T_{max}

with :math:`x_1` in place of :math:`x_2` if there is no sensor at the link. P is the
terminal cost of the infinite horizon, and the weights satisfy :math:`|i| f/e = (i^2 J_m
+ J_l)\,\omega^2`, so that a rigid joint would respond with the bandwidth
:math:`\omega`. If the unconstrained optimum satisfies all limits within the horizon,
the controller is a linear feedback, which takes one matrix product. Otherwise ADMM
solves the dense quadratic programme of the N torques, at once for all joints and
motions in which a limit is exceeded.

Delayed readings are compared with the plan at the instant at which they were taken and
correct the state at that instant. The model then predicts the current state from the
torques applied since then. All readings are delayed to the age of the oldest one.

The plan contains the coupling of the joints of an arm. The controller treats the
remaining coupling as a disturbance of each joint. A drive then acts on less than the
inertia about its joint, because the other joints yield. With the defaults the shoulder
and elbow of a UR5e diverge; with :func:`free_inertia`, a frequency of 10 Hz and a drift
of 0.2 they do not.

Source:
    Rawlings, Mayne, Diehl (2017), "Model predictive control", 2nd ed., ch. 1 and 2
    (terminal cost, offset-free disturbance models); Stellato et al. (2020), "OSQP: an
    operator splitting solver for quadratic programs", Math. Prog. Comp. 12, 637-672.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import Planner
from swgjoint.control.mpc_design import DRIFT, PredictionMatrices, TwoMassModel, design
from swgjoint.control.mpc_solver import solve
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import KnownJoints, Measured, Task
from swgjoint.typing import Array

HORIZON = 20
"""Default prediction horizon [control instants]."""
FREQUENCY = 20.0
"""Default bandwidth [Hz]."""
UNIT = 0.1
"""Unit of the motor torques in the programme, relative to rated torque over ratio
[-]."""
LEVELS = 8
"""Number of stiffness values for which feedback matrices are computed, between the
smallest and the largest stiffness along the plan."""


class PredictiveController:
    """Model-predictive controller of all joints of a task, see the module docstring."""

    def __init__(
        self,
        plan: Planner = flexible_plan,
        *,
        horizon: int = HORIZON,
        frequency: float = FREQUENCY,
        peak: float = 1.0,
        link_inertia: ArrayLike | None = None,
        drift: float = DRIFT,
    ) -> None:
        """Set horizon, weights and limits.

        Args:
            plan: Planner that is called at the start of every task.
            horizon: Prediction horizon N [control instants].
            frequency: Bandwidth with which a rigid joint without limits would respond
                [Hz]; it determines the ratio f/e of the weights.
            peak: Torque limit of the drive relative to its momentary peak torque [-].
            link_inertia: Inertia that every drive accelerates [kg·m²], for example
                from :func:`free_inertia` for an arm. Shape (n_joints,). None uses the
                inertia of the task, which assumes that the other joints are locked.
            drift: Standard deviation of the change of a disturbance within one second,
                relative to rated torque [-].

        Raises:
            InputError: If the horizon is less than 1 or another argument is not
                positive.
        """
        if not (horizon >= 1 and min(frequency, peak, drift) > 0.0):
            raise InputError(
                f"horizon {horizon}, frequency {frequency:g} Hz, peak {peak:g},"
                f" drift {drift:g}; accepted: > 0"
            )
        self.plan, self.horizon, self.peak = plan, int(horizon), peak
        self.frequency, self.drift = frequency, drift
        self.link_inertia = None if link_inertia is None else np.array(link_inertia)

    def start(self, task: Task) -> None:
        """Make the plan and determine the stiffness levels along it."""
        self.planned = self.plan(task)
        if self.link_inertia is not None:
            adapted = replace(task.joints, link_inertia=self.link_inertia)
            task = replace(task, joints=adapted)
        joints = task.joints
        self._task = task
        self._count, *shape = task.position.shape
        self._joint = np.broadcast_to(np.arange(len(joints.names)), shape).reshape(-1)
        level = np.empty(task.position.shape, dtype=np.intp)
        self._grids = []
        for j, drive in enumerate(joints.drives):
            stiffness = _stiffness(
                drive, self.planned.angle[..., j], task.position[..., j]
            )
            grid = np.geomspace(stiffness.min(), stiffness.max(), LEVELS)
            between = np.sqrt(grid[1:] * grid[:-1])
            level[..., j] = np.searchsorted(between, stiffness)
            self._grids.append(grid)
        self._level = level.reshape(self._count, -1)
        self._design: PredictionMatrices | None = None
        self._parts: PredictionMatrices | None = None
        self._state: Array = np.empty((0, 6))
        limit = np.broadcast_to(joints.torque_limit, shape).reshape(-1)
        rated = np.array([d.ratings.rated_torque for d in joints.drives])[self._joint]
        largest = np.array([d.ratings.momentary_peak for d in joints.drives])
        self._unit = UNIT * rated / np.abs(joints.ratio[self._joint])
        self._rated, self._limit = rated, limit
        self._peak = self.peak * largest[self._joint]
        self._angle = task.as_read(self.planned.angle, "motor")
        self._link = task.as_read(task.position, "link")
        self._drive = task.as_read(task.link_torque, "torque")
        self.limited = 0
        """Number of pairs of joint and instant with an active limit in the horizon."""

    def torque(self, k: int, measured: Measured) -> Array:
        """Motor torques, feed-forward plus feedback [N·m]. Shape (..., n_joints).

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.
        """
        task, plan = self._task, self.planned
        readings = self._off_plan(k, measured)
        assert self._design is not None
        if self._parts is None or (self._level[k] != self._level[k - 1]).any():
            self._parts = self._design.select((self._joint, self._level[k]))
        parts = self._parts

        x = self._state
        corrected = x + _times(parts.gain, readings - _times(parts.reads, x))
        x = corrected
        for push in self._given:  # torques applied since the readings were taken
            x = _times(parts.transition, x) + parts.by_torque * push
        off = x[:, :4] - _times(parts.target, x[:, 4:])
        steady = np.einsum("ij,ij->i", parts.steady, x[:, 4:])
        ahead = _times(parts.ahead, off)
        u = ahead[:, 0]
        low, high = self._bounds(k, steady, x[:, 5])
        beyond = ((ahead < low) | (ahead > high)).any(axis=-1)
        if beyond.any():
            self.limited += int(beyond.sum())
            some = parts.select((np.flatnonzero(beyond),))
            free = _times(some.free, off[beyond])
            u[beyond] = solve(
                some.inverse,
                some.weight,
                some.rows,
                _times(some.slope, off[beyond]),
                low[beyond] - free,
                high[beyond] - free,
            )[:, 0]
        planned = plan.torque[k].reshape(-1)
        wanted = np.clip(planned + steady + u * self._unit, -self._limit, self._limit)
        self._given.append((wanted - planned)[:, None])
        self._state = (
            _times(parts.transition, corrected)
            + parts.by_torque * self._given.popleft()
        )
        return np.asarray(wanted.reshape(task.position.shape[1:]))

    def _off_plan(self, k: int, measured: Measured) -> Array:
        """Deviations of the readings from the plan, at the age of the oldest one."""
        ratio = self._task.joints.ratio
        seen = {"motor": (measured.motor_angle - self._angle[k]) / ratio}
        if measured.link_angle is not None:
            seen["link"] = measured.link_angle - self._link[k]
        if measured.output_torque is not None:
            seen["torque"] = measured.output_torque - self._drive[k]
        now = {key: np.reshape(x, -1) for key, x in seen.items()}
        if self._design is None:
            self._begin(now, measured)
        for key, x in now.items():
            self._seen[key].append(x)
        return np.stack([self._seen[key].popleft() for key in now], axis=-1)

    def _begin(self, now: dict[str, Array], measured: Measured) -> None:
        """Compute the feedback for the available sensors; joints start at rest."""
        task = self._task
        readings = np.stack(list(now.values()), axis=-1)
        old = {key: task.periods_old(key) for key in now}  # type: ignore[arg-type]
        oldest = max(old.values())
        self._seen = {key: deque([x] * (oldest - old[key])) for key, x in now.items()}
        self._given = deque([np.zeros((len(readings), 1))] * oldest)
        self._state = np.zeros((len(readings), 6))
        self._state[:, 0] = readings[:, 0]
        reads_link = measured.link_angle is not None
        self._state[:, 1] = readings[:, 1 if reads_link else 0]
        self._design = PredictionMatrices.stack(
            [
                [
                    design(
                        _model(task.joints, j, float(stiffness), task.period),
                        horizon=self.horizon,
                        frequency=self.frequency,
                        drift=self.drift,
                        unit=UNIT * drive.ratings.rated_torque / abs(drive.ratio),
                        reads_link=reads_link,
                        reads_torque=measured.output_torque is not None,
                    )
                    for stiffness in self._grids[j]
                ]
                for j, drive in enumerate(task.joints.drives)
            ]
        )

    def _bounds(self, k: int, steady: Array, link: Array) -> tuple[Array, Array]:
        """Scaled bounds of motor and drive torques minus set-point. Shapes (m, 2 N)."""
        ahead = np.minimum(np.arange(k, k + self.horizon + 1), self._count - 1)
        plan, task = self.planned, self._task
        motor = plan.torque[ahead[:-1]].reshape(self.horizon, -1).T + steady[:, None]
        drive = task.link_torque[ahead[1:]].reshape(self.horizon, -1).T - link[:, None]
        limits = [(self._limit, self._unit, motor), (self._peak, self._rated, drive)]
        low, high = (
            np.hstack(
                [(sign * top[:, None] - at) / unit[:, None] for top, unit, at in limits]
            )
            for sign in (-1.0, 1.0)
        )
        return low, high


def free_inertia(model: mujoco.MjModel, position: ArrayLike) -> Array:
    r"""Inertia that a torque at a joint accelerates if the other joints are free.

    It is :math:`1/(M^{-1})_{jj}`, which never exceeds :math:`M_{jj}`.

    Args:
        model: Model of the rigid arm.
        position: Joint angles [rad]. Shape (n_joints,).

    Returns:
        Inertia of every joint [kg·m²]. Shape (n_joints,).
    """
    data, whole = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:] = position
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, whole)
    return np.asarray(1.0 / np.diag(np.linalg.inv(whole)))


def _times(matrices: Array, vectors: Array) -> Array:
    """Product of every matrix with its vector. Shape (k, rows)."""
    return np.asarray(np.einsum("kij,kj->ki", matrices, vectors))


def _stiffness(drive: DriveMap, theta: Array, psi: Array) -> Array:
    """Stiffness of the map along a plan, at least 0.1 % of its mean [N·m/rad]."""
    along = drive.stiffness(drive.torsion(theta, psi), theta, psi)
    # within a clearance the stiffness of the map is zero
    return np.maximum(along, 1e-3 * drive.mean_stiffness)


def _model(
    joints: KnownJoints, j: int, stiffness: float, period: float
) -> TwoMassModel:
    """Two-mass model of joint j at one stiffness [N·m/rad]."""

    def known(values: Array) -> float:
        return float(np.reshape(values, (-1, len(joints.names)))[0, j])

    drive = joints.drives[j]
    return TwoMassModel(
        ratio=drive.ratio,
        rotor_inertia=known(joints.rotor_inertia),
        link_inertia=known(joints.link_inertia),
        stiffness=stiffness,
        damping=known(joints.damping),
        period=period,
        rated_torque=drive.ratings.rated_torque,
    )

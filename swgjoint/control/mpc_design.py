"""Matrices of model-predictive control for one joint at one stiffness.

Source:
    Doyle, Stein (1979), "Robustness with observers", IEEE Trans. Autom. Control 24,
    607-611, for the process noise of the Kalman filter.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from swgjoint.control.mpc_solver import prepare
from swgjoint.typing import Array

ENCODER = 1e-3
"""Assumed standard deviation of the motor encoder, and of the link encoder times the
ratio [rad].

It is larger than the encoder noise in order to limit the bandwidth of the filter to
about 60 Hz for a shoulder joint of a cobot. Effects that the model omits (the delay of
half a period and the kinematic error) then do not make the estimate noisy."""
SENSOR = 2e-3
"""Standard deviation of a torque sensor relative to rated torque [-]."""
DRIFT = 2.0
"""Default standard deviation of the change of a disturbance within one second, relative
to rated torque [-]."""
DRIFT_ALONE = 0.2
"""Upper bound of the drift without a sensor at the link [-], because the motor encoder
alone cannot distinguish the effect of the torsion from a disturbance."""
SHAKE = 0.1
"""Standard deviation of the white torque noise on either body, relative to rated torque
[-]. Input noise above its real level restores the stability margins that a filter
reduces (Doyle, Stein 1979); with 0.1 the loop tolerates stiffness errors of ±20 %."""


@dataclass(frozen=True, kw_only=True)
class TwoMassModel:
    """Linear model of a joint about its plan, see :mod:`swgjoint.control.mpc`."""

    ratio: float
    """Signed ratio i [-]."""
    rotor_inertia: float
    """Inertia of rotor and wave generator about the motor axis [kg·m²]."""
    link_inertia: float
    """Link inertia about the joint [kg·m²]."""
    stiffness: float
    """Torsional stiffness k at the output [N·m/rad]."""
    damping: float
    """Damping C along the torsion [N·m·s/rad]."""
    period: float
    """Control period [s]."""
    rated_torque: float
    """Rated torque of the drive at the output [N·m]."""

    def discretise(self) -> tuple[Array, Array]:
        """Discrete-time model of the state (x1, x2, rates, d_m, d_l) over one period.

        Angles are those of motor and link at the output side; d_m acts on the motor and
        d_l on the link.

        Returns:
            Transition matrix, shape (6, 6), and change of the state per motor torque,
            shape (6,).
        """
        i, k, c = self.ratio, self.stiffness, self.damping
        rotor, link = i**2 * self.rotor_inertia, self.link_inertia
        whole = np.zeros((7, 7))
        whole[0, 2] = whole[1, 3] = 1.0
        whole[2, :4] = np.array([-k, k, -c, c]) / rotor
        whole[3, :4] = np.array([k, -k, c, -c]) / link
        whole[2, 4] = whole[2, 6] = i / rotor
        whole[3, 5] = 1.0 / link
        moved = expm(whole * self.period)
        return moved[:6, :6], moved[:6, 6]

    @property
    def torque_row(self) -> Array:
        """Row that maps (x1, x2, rates) to the drive torque [N·m]. Shape (4,)."""
        k, c = self.stiffness, self.damping
        return np.array([k, -k, c, -c])


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionMatrices:
    """Matrices of the controller; leading axes are joints and stiffness levels.

    The state is (x1, x2, rates, d_m, d_l). Scaled torques are N motor torques divided
    by their unit, followed by N drive torques divided by rated torque. Deviations are
    those of (x1, x2, rates) from the set-point.
    """

    transition: Array
    """Matrix that advances the state by one period. Shape (6, 6)."""
    by_torque: Array
    """Change of the state over one period per motor torque. Shape (6,)."""
    reads: Array
    """Matrix that maps the state to the readings. Shape (n_readings, 6)."""
    gain: Array
    """Gain of the Kalman filter. Shape (6, n_readings)."""
    target: Array
    """Matrix that maps the disturbances to the set-point. Shape (4, 2)."""
    steady: Array
    """Motor torque at the set-point per disturbance [-]. Shape (2,)."""
    ahead: Array
    """Matrix that maps the deviation to the scaled torques of the optimum without
    limits. Shape (2 N, 4)."""
    rows: Array
    """Matrix that maps the N scaled motor torques to the scaled torques. Shape
    (2 N, N)."""
    free: Array
    """Matrix that maps the deviation to the scaled torques if the motor torques are
    zero. Shape (2 N, 4)."""
    slope: Array
    """Matrix that maps the deviation to the linear term g of the programme. Shape
    (N, 4)."""
    inverse: Array
    """Inverse from :func:`swgjoint.control.mpc_solver.prepare`. Shape (N, N)."""
    weight: Array
    """Weights from :func:`swgjoint.control.mpc_solver.prepare`. Shape (2 N,)."""

    @classmethod
    def stack(cls, designs: list[list[PredictionMatrices]]) -> PredictionMatrices:
        """Stack matrices of all joints (outer list) and stiffness levels (inner)."""
        return cls(
            **{
                f.name: np.array([[getattr(d, f.name) for d in row] for row in designs])
                for f in fields(cls)
            }
        )

    def select(self, index: tuple[NDArray[Any], ...]) -> PredictionMatrices:
        """Select entries of the leading axes, e.g. by joint and stiffness level."""
        return PredictionMatrices(
            **{f.name: getattr(self, f.name)[index] for f in fields(self)}
        )


def design(
    joint: TwoMassModel,
    *,
    horizon: int,
    frequency: float,
    drift: float = DRIFT,
    unit: float,
    reads_link: bool,
    reads_torque: bool,
) -> PredictionMatrices:
    """Compute the matrices of feedback, filter and quadratic programme.

    Without a sensor at the link, the cost weights the motor angle instead of the link
    angle, because kinematic error and hysteresis then make the link angle uncertain.

    Args:
        joint: Linear model of the joint.
        horizon: Prediction horizon N [control instants].
        frequency: Bandwidth with which a rigid joint without limits would respond [Hz].
        drift: Standard deviation of the change of a disturbance within one second,
            relative to rated torque [-].
        unit: Unit f of the motor torques [N·m].
        reads_link: Whether there is a link encoder.
        reads_torque: Whether there is an output torque sensor.
    """
    whole, push = joint.discretise()
    A, B = whole[:4, :4], push[:4, None]
    Q = np.zeros((4, 4))
    followed = 1 if reads_link or reads_torque else 0
    inertia = joint.ratio**2 * joint.rotor_inertia + joint.link_inertia
    omega = 2.0 * np.pi * frequency
    worth = unit * abs(joint.ratio) / (inertia * omega**2)  # e [rad]
    Q[followed, followed] = 1.0 / worth**2
    R = np.array([[1.0 / unit**2]])
    P = solve_discrete_are(A, B, Q, R)
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)  # (1, 4)

    # states x_1 ... x_N as functions of x_0 and the torques
    powers = [np.eye(4)]
    for _ in range(horizon):
        powers.append(A @ powers[-1])
    free = np.array(powers[1:])  # (N, 4, 4)
    forced = np.zeros((horizon, 4, horizon))
    for j in range(horizon):
        for m in range(j + 1):
            forced[j, :, m] = (powers[j - m] @ B)[:, 0]
    weights = np.array([Q] * (horizon - 1) + [P])
    hessian = np.einsum("jam,jab,jbn->mn", forced, weights, forced)
    hessian = unit**2 * hessian + np.eye(horizon)  # for torques divided by their unit
    slope = unit * np.einsum("jam,jab,jbc->mc", forced, weights, free)
    on_drive = joint.torque_row / joint.rated_torque
    rows = np.vstack([np.eye(horizon), unit * np.einsum("a,jam->jm", on_drive, forced)])
    still = np.vstack([np.zeros((horizon, 4)), np.einsum("a,jab->jb", on_drive, free)])
    best = -np.linalg.solve(hessian, slope)  # (N, 4)
    assert np.allclose(unit * best[0], -K[0], rtol=1e-6, atol=1e-9 * np.abs(K).max())
    inverse, weight = prepare(hessian, rows)
    reads, gain = _filter(joint, whole, push, drift, reads_link, reads_torque)
    k, i = joint.stiffness, joint.ratio
    return PredictionMatrices(
        transition=whole,
        by_torque=push,
        reads=reads,
        gain=gain,
        target=np.array([[0.0, -1.0 / k], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]),
        steady=np.array([-1.0, -1.0 / i]),
        ahead=still + rows @ best,
        rows=rows,
        free=still,
        slope=slope,
        inverse=inverse,
        weight=weight,
    )


def _filter(
    joint: TwoMassModel,
    whole: Array,
    push: Array,
    drift: float,
    reads_link: bool,
    reads_torque: bool,
) -> tuple[Array, Array]:
    """Matrix of the readings and steady-state gain of the Kalman filter.

    Without a sensor at the link, the disturbance of the link is not observable and is
    omitted.
    """
    rated, h, i = joint.rated_torque, joint.period, joint.ratio
    rows, noise = [[1.0, 0, 0, 0, 0, 0]], [ENCODER / i]
    if reads_link:
        rows.append([0, 1.0, 0, 0, 0, 0])
        noise.append(ENCODER / i)
    if reads_torque:
        rows.append([*joint.torque_row, 0, 0])
        noise.append(SENSOR * rated)
    reads = np.array(rows)
    count = 6 if reads_link or reads_torque else 5
    on_link = np.zeros(6)
    on_link[3] = h / joint.link_inertia
    shake = SHAKE * rated
    rate = np.zeros(6)
    if not (reads_link or reads_torque):
        drift = min(drift, DRIFT_ALONE)
    rate[4], rate[5] = drift * rated / i, drift * rated
    process = (
        np.outer(push, push) * (shake / i) ** 2
        + np.outer(on_link, on_link) * shake**2
        + np.diag(rate**2) * h
    )
    part = slice(0, count)
    A, C = whole[part, part], reads[:, part]
    R = np.diag(np.array(noise) ** 2)
    P = solve_discrete_are(A.T, C.T, process[part, part], R)
    gain = np.zeros((6, len(reads)))
    gain[part] = np.linalg.solve(R + C @ P @ C.T, C @ P).T
    return reads, gain

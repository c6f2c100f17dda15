"""Matrices of predictive control of one joint at one stiffness.

Source:
    Doyle, Stein (1979), "Robustness with observers", IEEE Trans. Autom. Control 24,
    607-611, for the noise of the filter.
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
"""What the motor's encoder, and the link's times the ratio, may be off [rad].

More than their noise: it bounds how fast the filter is, some 60 Hz for a joint of a
cobot's shoulder, so that what the model lacks (delay of half a period, kinematic error)
does not make it restless."""
SENSOR = 2e-3
"""Noise of a torque sensor, parts of rated torque."""
DRIFT = 2.0
"""Change of a disturbance in a second, parts of rated torque."""
DRIFT_ALONE = 0.2
"""The same where nothing is read at the link: what the torsion does to the motor looks
like a disturbance there."""
SHAKE = 0.1
"""Torque on either body that is no disturbance, parts of rated torque. Noise at the
input that is larger than real gives the feedback back the margins that a filter takes
(Doyle, Stein 1979): a tenth holds 20 % of stiffness either way."""


@dataclass(frozen=True, kw_only=True)
class TwoMassModel:
    """A joint about its plan, motor on the output side."""

    ratio: float
    rotor_inertia: float
    link_inertia: float
    stiffness: float
    damping: float
    period: float
    rated_torque: float

    def discretise(self) -> tuple[Array, Array]:
        """Transition of (x1, x2, rates, d_m, d_l), and of the motor torque. (6, 7)."""
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
        """Torque of the drive from (x1, x2, rates)."""
        k, c = self.stiffness, self.damping
        return np.array([k, -k, c, -c])


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionMatrices:
    """What the controller multiplies with; stacked, axes in front are designs."""

    transition: Array
    """(6, 6)."""
    by_torque: Array
    """(6,)."""
    reads: Array
    """Readings from the state (n_readings, 6)."""
    gain: Array
    """Gain of the Kalman filter (6, n_readings)."""
    target: Array
    """Set-point of (x1, x2, rates) from the disturbances (4, 2)."""
    steady: Array
    """Motor torque there (2,)."""
    ahead: Array
    """Torques of the motor, then of the drive, of the optimum without limits, over
    their units, from the state off its set-point (2 N, 4)."""
    rows: Array
    """The same from the motor torques of the horizon (2 N, N)."""
    free: Array
    """The same from the state, without motor torque (2 N, 4)."""
    slope: Array
    """Linear part g of the programme from the state (N, 4)."""
    inverse: Array
    weight: Array

    @classmethod
    def stack(cls, designs: list[list[PredictionMatrices]]) -> PredictionMatrices:
        """Designs of all joints and stiffnesses, axes in front."""
        return cls(
            **{
                f.name: np.array([[getattr(d, f.name) for d in row] for row in designs])
                for f in fields(cls)
            }
        )

    def select(self, index: tuple[NDArray[Any], ...]) -> PredictionMatrices:
        """Those of joints and stiffnesses."""
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
    """Feedback, filter and programme.

    Args:
        joint: The model.
        horizon: N.
        frequency: Bandwidth of a rigid joint with this feedback [Hz]. Where nothing is
            read at the link, the motor's angle is what is held: what kinematic error
            and hysteresis do to the torque is then no knowledge of the link.
        drift: Of a disturbance in a second, parts of rated torque.
        unit: f, that motor torques are counted in [N·m].
        reads_link: Whether there is a link encoder.
        reads_torque: Whether there is a torque sensor.
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

    # states x_1 .. x_N from x_0 and the torques
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
    hessian = unit**2 * hessian + np.eye(horizon)  # torques over their unit
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
    """Rows of the readings, and the stationary gain of the Kalman filter.

    Without a reading at the link its disturbance cannot be told, and is left out.
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

r"""Identification and compensation of the kinematic error by a table of harmonics.

The kinematic error of a drive is a sum of harmonics of alpha and beta, the angles of
the wave generator relative to the two toothed members,
:math:`e_0 = \sum_k a_k \cos\varphi_k + b_k \sin\varphi_k` with
:math:`\varphi_k = p_k \alpha + q_k \beta`. A record of one slow output turn therefore
determines the kinematic error for all loads and motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.arrays import frozen_array
from swgjoint.control.flexible import flexible_plan
from swgjoint.control.motor_side import MotorPlan, Planner
from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_fit import ORDERS
from swgjoint.maps.fit.error_spectrum import peak_to_peak, with_error
from swgjoint.sim.controller import Controller, Measured, Task
from swgjoint.typing import Array
from swgjoint.units import deg

SEARCHED: tuple[tuple[int, int], ...] = (*ORDERS, (1, 1), (8, 0), (0, 8))
"""Default orders (p, q) of the identification: one to six and eight cycles per turn of
alpha and of beta, one and two cycles per output turn, and the sum alpha + beta, which
an eccentric wave generator excites."""
SURE = 4.0
"""Smallest amplitude of a harmonic that is kept, in standard errors [-]. If a drive has
none of 20 searched harmonics, noise exceeds this threshold in fewer than one
table out of a hundred."""
_TURN = 0.98  # fraction of an output turn that a record must cover
_PER_WAVE = 4.0  # samples per period of the highest order
_LEVERAGE = 1e4  # largest condition number at which the orders can be separated


@dataclass(frozen=True, kw_only=True, eq=False)
class JointRecord:
    """Encoder readings of one joint."""

    motor_angle: Array
    """Motor angle [rad]. Shape (n,)."""
    link_angle: Array
    """Link angle [rad]. Shape (n,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KinematicErrorTable:
    """Harmonics of the kinematic error e0 of one drive."""

    orders: NDArray[np.int64]
    """Orders (p, q) of the phases p alpha + q beta. Shape (n, 2)."""
    amplitudes: Array
    """Cosine and sine amplitudes [rad]. Shape (n, 2)."""
    deviation: float = 0.0
    """Standard error of the amplitudes if the residual of the fit is white noise
    [rad]."""

    def __post_init__(self) -> None:
        orders = np.array(self.orders, dtype=np.int64).reshape(-1, 2)
        orders.setflags(write=False)
        object.__setattr__(self, "orders", orders)
        pairs = frozen_array(self.amplitudes, "amplitudes [rad]", shape=orders.shape)
        object.__setattr__(self, "amplitudes", pairs)

    def apply_to(self, drive: DriveMap) -> DriveMap:
        """Copy a drive map with this kinematic error instead of its own."""
        return with_error(drive, self.orders, self.amplitudes)

    def scale_to(self, drive: DriveMap, wanted: float) -> KinematicErrorTable:
        """Scale all amplitudes to a given peak-to-peak kinematic error.

        Args:
            drive: Drive whose layout and numbers of teeth determine the peak-to-peak
                value.
            wanted: Peak-to-peak kinematic error over one output turn [rad].

        Returns:
            The scaled table.
        """
        sized = self.amplitudes * wanted / peak_to_peak(self.apply_to(drive))
        return replace(self, amplitudes=sized)


def identify_kinematic_error(
    record: JointRecord,
    drive: DriveMap,
    *,
    orders: Sequence[tuple[int, int]] = SEARCHED,
) -> KinematicErrorTable:
    """Fit harmonics of alpha and beta to a slow record of one output turn.

    The least-squares fit includes a constant, which absorbs the torsion under a
    constant load, and a linear trend, which absorbs slow changes of this torsion. Only
    the orders whose amplitudes exceed the noise of the record are kept (see
    :data:`SURE`), and these are fitted again.

    Args:
        record: Readings over at least one output turn in one direction of rotation.
        drive: Drive whose ratio and layout are used; its kinematic error is not.
        orders: Orders (p, q) to search for.

    Raises:
        InputError: If the record is too short or too coarse, or if it cannot separate
            the orders.
    """
    theta, psi = (
        frozen_array(x, name, ndim=1)
        for x, name in (
            (record.motor_angle, "motor angle [rad]"),
            (record.link_angle, "link angle [rad]"),
        )
    )
    wanted = np.array([pq for pq in orders if tuple(pq) != (0, 0)], dtype=np.int64)
    span = float(np.ptp(psi)) if psi.size else 0.0
    by = wanted @ np.array(angle_coefficients(drive.layout), dtype=np.int64)
    most = float(np.abs(by @ [drive.ratio, 1.0]).max()) * span / (2.0 * np.pi)
    if theta.shape != psi.shape or span < _TURN * 2.0 * np.pi:
        raise InputError(
            f"record of {psi.size} link and {theta.size} motor angles over"
            f" {span / deg:.4g} deg of the output; accepted: equal numbers of both"
            " over at least one output turn (360 deg)"
        )
    if psi.size < _PER_WAVE * most:
        raise InputError(
            f"record of {psi.size} samples over {span / deg:.4g} deg of the output;"
            f" accepted: at least {_PER_WAVE * most:.0f} for the requested orders"
        )
    phases = np.stack([theta, psi], axis=-1) @ by.T.astype(float)
    error = psi - theta / drive.ratio
    basis = _basis(phases, psi)
    pairs, deviation = _fit(basis, error, len(wanted))
    keep = np.hypot(*pairs.T) > SURE * deviation
    pairs, deviation = _fit(_basis(phases[:, keep], psi), error, int(keep.sum()))
    return KinematicErrorTable(
        orders=wanted[keep], amplitudes=pairs, deviation=deviation
    )


def _basis(phases: Array, psi: Array) -> Array:
    """Columns of the fit: constant, linear trend, cosines and sines."""
    line = np.stack([np.ones_like(psi), (psi - psi.mean()) / np.ptp(psi)], axis=-1)
    return np.hstack([line, np.cos(phases), np.sin(phases)])


def _fit(basis: Array, error: Array, count: int) -> tuple[Array, float]:
    """Cosine and sine amplitudes [rad], shape (count, 2), and their standard error."""
    weights, _, rank, sizes = np.linalg.lstsq(basis, error, rcond=None)
    if rank < basis.shape[1] or sizes[0] > _LEVERAGE * sizes[-1]:
        raise InputError(
            "the record cannot separate the orders; accepted: fewer orders, or a"
            " record at constant speed"
        )
    residual = error - basis @ weights
    spread = float(np.sqrt(residual @ residual / max(error.size - basis.shape[1], 1)))
    pairs = np.stack([weights[2 : 2 + count], weights[2 + count :]], axis=-1)
    return pairs, spread * float(np.sqrt(2.0 / error.size))


def compensate(
    tables: Sequence[KinematicErrorTable], plan: Planner = flexible_plan
) -> Planner:
    """Make a planner that compensates identified kinematic errors.

    Args:
        tables: Identified kinematic errors, one per joint.
        plan: Planner that uses the drive maps of the task.

    Returns:
        Planner that calls ``plan`` with drive maps whose kinematic errors are those of
        the tables.
    """

    def planned(task: Task) -> MotorPlan:
        joints = task.joints
        drives = tuple(
            t.apply_to(d) for t, d in zip(tables, joints.drives, strict=True)
        )
        return plan(replace(task, joints=replace(joints, drives=drives)))

    return planned


class TurnRecorder:
    """Controller that records the readings of another one and needs a link encoder."""

    def __init__(self, inner: Controller) -> None:
        """Wrap the controller ``inner``, which computes the torques."""
        self.inner = inner

    def start(self, task: Task) -> None:
        """Discard the previous record and start the inner controller."""
        self._read: list[tuple[Array, Array]] = []
        self.inner.start(task)

    def torque(self, k: int, measured: Measured) -> Array:
        """Record the readings and return the torque of the inner controller [N·m].

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.

        Raises:
            InputError: If there is no link encoder.
        """
        if measured.link_angle is None:
            raise InputError(
                "recording the link angle needs a link encoder; accepted: a scene with"
                " controller.feedback = 'link'"
            )
        self._read.append((measured.motor_angle, measured.link_angle))
        return self.inner.torque(k, measured)

    def record(self, joint: int = 0, skip: int = 0) -> JointRecord:
        """Recorded readings of one joint.

        Args:
            joint: Index of the joint.
            skip: Number of control instants that are omitted at the start.
        """
        motor, link = np.moveaxis(np.array(self._read[skip:]), 1, 0)
        return JointRecord(motor_angle=motor[..., joint], link_angle=link[..., joint])

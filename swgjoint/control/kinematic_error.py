r"""Kinematic error by look-up in the angles of the wave generator.

The error of one drive is a sum over the angles of the wave generator against both
toothed members, :math:`e_0 = \sum_k a_k \cos\varphi_k + b_k \sin\varphi_k` with
:math:`\varphi_k = p_k \alpha + q_k \beta`, so that a record of one slow output turn
tells it for all loads and motions; makers of drives compensate accuracy this way.
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
"""(p, q) that a record is searched for: low orders of either member, the output turn,
and what an eccentric wave generator makes of both."""
SURE = 4.0
"""A harmonic is kept from this many of its standard errors: of a score that are not
there, noise passes one in a hundred tables."""
_TURN = 0.98  # of an output turn that a record must cover
_PER_WAVE = 4.0  # samples that tell a wave
_LEVERAGE = 1e4  # beyond, two orders of the record cannot be told apart


@dataclass(frozen=True, kw_only=True, eq=False)
class JointRecord:
    """What the encoders of one joint read; shapes (n,)."""

    motor_angle: Array
    """[rad]."""
    link_angle: Array
    """[rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KinematicErrorTable:
    """Harmonics of e0 of one drive."""

    orders: NDArray[np.int64]
    """(p, q) of p alpha + q beta. Shape (n, 2)."""
    amplitudes: Array
    """Cosine and sine [rad]. Shape (n, 2)."""
    deviation: float = 0.0
    """Standard error of an amplitude, as if all that is left were noise [rad]."""

    def __post_init__(self) -> None:
        orders = np.array(self.orders, dtype=np.int64).reshape(-1, 2)
        orders.setflags(write=False)
        object.__setattr__(self, "orders", orders)
        pairs = frozen_array(self.amplitudes, "amplitudes [rad]", shape=orders.shape)
        object.__setattr__(self, "amplitudes", pairs)

    def apply_to(self, drive: DriveMap) -> DriveMap:
        """The drive with this kinematic error in place of its own."""
        return with_error(drive, self.orders, self.amplitudes)

    def scale_to(self, drive: DriveMap, wanted: float) -> KinematicErrorTable:
        """The same in proportion: on a drive its peak to peak is that wanted [rad]."""
        sized = self.amplitudes * wanted / peak_to_peak(self.apply_to(drive))
        return replace(self, amplitudes=sized)


def identify_kinematic_error(
    record: JointRecord,
    drive: DriveMap,
    *,
    orders: Sequence[tuple[int, int]] = SEARCHED,
) -> KinematicErrorTable:
    """Harmonics of alpha and beta in a slow record of one output turn, least squares.

    The load may be any that stays the same: its torsion goes into the constant, and a
    straight line takes its slow change. The record may be noisy; of the orders searched
    those are kept that stand out of it.

    Args:
        record: Readings along one direction, at least one turn of the output.
        drive: Layout and teeth; its own error is not used.
        orders: (p, q) to look for.

    Raises:
        InputError: If the record is too short, too coarse, or does not tell the orders.
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
            f" {span / deg:.4g} deg of the output; accepted: as many of both, over one"
            " turn, 360 deg"
        )
    if psi.size < _PER_WAVE * most:
        raise InputError(
            f"record of {psi.size} samples over {span / deg:.4g} deg of the output;"
            f" accepted: at least {_PER_WAVE * most:.0f} for the orders asked for"
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
    line = np.stack([np.ones_like(psi), (psi - psi.mean()) / np.ptp(psi)], axis=-1)
    return np.hstack([line, np.cos(phases), np.sin(phases)])


def _fit(basis: Array, error: Array, count: int) -> tuple[Array, float]:
    """Pairs of amplitudes and their standard error."""
    weights, _, rank, sizes = np.linalg.lstsq(basis, error, rcond=None)
    if rank < basis.shape[1] or sizes[0] > _LEVERAGE * sizes[-1]:
        raise InputError(
            "record whose orders cannot be told apart; accepted: fewer orders, or a"
            " record at even speed"
        )
    left = error - basis @ weights
    spread = float(np.sqrt(left @ left / max(error.size - basis.shape[1], 1)))
    pairs = np.stack([weights[2 : 2 + count], weights[2 + count :]], axis=-1)
    return pairs, spread * float(np.sqrt(2.0 / error.size))


def compensate(
    tables: Sequence[KinematicErrorTable], plan: Planner = flexible_plan
) -> Planner:
    """A plan whose drives have the kinematic error of tables.

    Args:
        tables: One for every joint.
        plan: One that uses the map of the drives.
    """

    def planned(task: Task) -> MotorPlan:
        joints = task.joints
        drives = tuple(
            t.apply_to(d) for t, d in zip(tables, joints.drives, strict=True)
        )
        return plan(replace(task, joints=replace(joints, drives=drives)))

    return planned


class TurnRecorder:
    """Keeps what another controller reads; needs a link encoder."""

    def __init__(self, inner: Controller) -> None:
        """Record the readings that ``inner`` acts on."""
        self.inner = inner

    def start(self, task: Task) -> None:
        """Forget the last record."""
        self._read: list[tuple[Array, Array]] = []
        self.inner.start(task)

    def torque(self, k: int, measured: Measured) -> Array:
        """That of the controller whose readings are kept."""
        if measured.link_angle is None:
            raise InputError(
                "a record of the link without link encoder; accepted: a scene with"
                " controller.feedback = 'link'"
            )
        self._read.append((measured.motor_angle, measured.link_angle))
        return self.inner.torque(k, measured)

    def record(self, joint: int = 0, skip: int = 0) -> JointRecord:
        """Readings of one joint.

        Args:
            joint: Its number.
            skip: Instants at the start that are left out.
        """
        motor, link = np.moveaxis(np.array(self._read[skip:]), 1, 0)
        return JointRecord(motor_angle=motor[..., joint], link_angle=link[..., joint])

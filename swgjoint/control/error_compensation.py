r"""Compensation of an estimated kinematic error through the motor loop.

At constant speed the kinematic error e of a drive turns its link unless the motor turns
by :math:`-i\,e` against it. For a wave of e of order n, with :math:`\omega = n \dot
\theta`, a motor loop needs the added torque

.. math:: \tau = -i\,\big((k_p - J \omega^2)\,e + k_d \dot e\big)
    + T\,\dot e/\dot\theta,

where the last term is the torque T of the drive that acts on the motor through the
slope of the error. The estimate comes from the motor encoder, see
:mod:`swgjoint.envs.identification`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError
from swgjoint.sim.controller import Measured, Task
from swgjoint.typing import Array

ORDERS = (2, 4)
"""Orders of the wave-generator angle: lobes, and twice as many."""
AFTER = 0.8
"""Time before the first compensation, in which the estimate settles [s]."""
_SLOWEST = 1e-9  # speed of the link [rad/s] instead of zero


class ErrorCompensation:
    """Torque against the estimated error, in addition to that of a motor loop.

    It needs :attr:`~swgjoint.sim.controller.Task.loop` and
    :attr:`~swgjoint.sim.controller.Measured.error_estimate`, which
    ``RippleSuppression-v0`` with ``identify=True`` has. All arguments may be arrays
    that broadcast to shape (..., n_joints).
    """

    def __init__(
        self,
        *,
        share_order_2: ArrayLike = 1.0,
        share_order_4: ArrayLike = 1.0,
        load_share: ArrayLike = 1.0,
        lead_s: ArrayLike = 0.0,
    ) -> None:
        """Set the shares.

        Args:
            share_order_2: Share of the error of order 2 [-].
            share_order_4: Share of the error of order 4 [-].
            load_share: Share of the torque of the drive through the slope [-].
            lead_s: Time by which the estimate is advanced [s].
        """
        self._shares = np.asarray(share_order_2), np.asarray(share_order_4)
        self._load, self._lead = np.asarray(load_share), np.asarray(lead_s)

    def start(self, task: Task) -> None:
        """Take over the motion.

        Raises:
            InputError: If the task has no motor loop.
        """
        if task.loop is None:
            raise InputError(
                "compensation of an estimated error without a motor loop; accepted:"
                " RippleSuppression-v0"
            )
        self._task, ratio = task, task.joints.ratio
        still = np.where(task.velocity < 0.0, -_SLOWEST, _SLOWEST)
        self._speed = ratio * (task.velocity + still)

    def torque(self, k: int, measured: Measured) -> Array:
        """Added motor torques [N·m]. Shape (..., n_joints).

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.

        Raises:
            InputError: If there is no estimate.
        """
        task, loop, speed = self._task, self._task.loop, self._speed[k]
        if measured.error_estimate is None or loop is None:
            raise InputError(
                "compensation without an estimate of the error; accepted:"
                " RippleSuppression-v0 with identify=True"
            )
        total: Array = np.zeros_like(speed)
        if k * task.period <= AFTER:
            return total
        ratio, joints = task.joints.ratio, task.joints
        for n, (order, share) in enumerate(zip(ORDERS, self._shares, strict=True)):
            omega = order * speed
            error, rate = (
                measured.error_estimate[..., 2 * n + m, None] for m in range(2)
            )
            cos, sin = np.cos(omega * self._lead), np.sin(omega * self._lead)
            error, rate = (
                error * cos + rate / omega * sin,
                rate * cos - error * omega * sin,
            )
            dynamic = loop.stiffness - joints.rotor_inertia * omega**2
            own = -ratio * (dynamic * error + loop.damping * rate)
            pushed = self._load * task.link_torque[k] * rate / speed
            total = total + share * (own + pushed)
        return total

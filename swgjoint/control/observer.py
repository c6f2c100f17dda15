r"""Disturbance observer on the motors.

From the momentum :math:`p = J_m \dot\theta` of the rotor and the torques that are
known, the motor's and :math:`n` of the drive, the observer

.. math:: \hat d = L \left( p(t) - p(0) - \int_0^t (\tau - n + \hat d)\,dt \right)

has :math:`\dot{\hat d} = L (d - \hat d)`: it follows friction and unknown load, d, like
a low-pass of bandwidth L, without accelerations. It is taken off the motor's torque.
n is :math:`T/i` with T of the torque sensor where there is one, else that of the known
arm on the motion; what a drive swings against that is then taken for a disturbance, so
that the bandwidth must stay below the joint's resonance. Speeds that are old are held
against the torques of then; d is as old.

Source:
    De Luca, Mattone (2003), "Actuator failure detection and isolation using generalized
    momenta", IEEE ICRA, 634-639, for the momentum form.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.controller import Controller, Measured, Task
from swgjoint.typing import Array

FASTEST = 0.25
"""Largest bandwidth times period; the sum in place of the integral rings from 1 on."""


class DisturbanceObserver:
    """Another controller, and the disturbance of its motors taken off."""

    def __init__(
        self, inner: Controller, *, bandwidth: float = 5.0, limit: float = np.inf
    ) -> None:
        """Observe the motors of a controller.

        Args:
            inner: Gives the torques without the observer.
            bandwidth: L over 2 pi [Hz].
            limit: Largest torque that is taken off [N·m].
        """
        self.inner, self.bandwidth, self.limit = inner, bandwidth, limit

    def start(self, task: Task) -> None:
        """Start from no disturbance."""
        self._gain = 2.0 * np.pi * self.bandwidth
        if not 0.0 < self._gain * task.period <= FASTEST:
            highest = FASTEST / (2.0 * np.pi * task.period)
            raise InputError(
                f"observer bandwidth {self.bandwidth:g} Hz at a period of"
                f" {task.period:g} s; accepted: > 0 and <= {highest:.3g} Hz"
            )
        self._task = task
        self._sum: Array | None = None
        self._known = task.as_read(task.link_torque, "motor")
        self._late = task.periods_old("motor")
        self._applied: deque[Array] = deque(maxlen=self._late + 1)
        self.estimate: Array = np.zeros(task.position.shape[1:])
        """Disturbance that acts along the motors' rotation [N·m]. (..., n_joints)."""
        self.inner.start(task)

    def torque(self, k: int, measured: Measured) -> Array:
        """See :class:`swgjoint.sim.controller.Controller`."""
        joints, period = self._task.joints, self._task.period
        momentum = joints.rotor_inertia * measured.motor_speed
        if self._sum is None or k <= self._late:  # the first reading, still
            self._sum = momentum
        else:
            if measured.output_torque is None:
                known = self._known[k - 1]
            else:
                known = measured.output_torque
            self._sum = self._sum + period * (
                self._applied[0] - known / joints.ratio + self.estimate
            )
        self.estimate = self._gain * (momentum - self._sum)
        taken = np.clip(self.estimate, -self.limit, self.limit)
        wanted = self.inner.torque(k, measured) - taken
        applied = np.clip(wanted, -joints.torque_limit, joints.torque_limit)
        self._applied.append(applied)
        return np.asarray(wanted)

r"""Disturbance observer of the motors.

From the momentum :math:`p = J_m \dot\theta` of the rotor, the motor torque
:math:`\tau` and the torque :math:`n` with which the drive loads the rotor, the observer

.. math:: \hat d = L \left( p(t) - p(0) - \int_0^t (\tau - n + \hat d)\,dt \right)

estimates the disturbance torque d, which consists of friction and unknown load. It
needs no accelerations. Since :math:`\dot{\hat d} = L (d - \hat d)`, the estimate is d
after a first-order low-pass filter of bandwidth L. It is subtracted from the motor
torque.

The drive loads the rotor with :math:`n = T/i`, where T is the reading of the torque
sensor or, without a sensor, the known link torque of the motion. In the second case
oscillations of the drive torque count as disturbance, so that the bandwidth must stay
below the joint resonance. Delayed speeds are compared with the torques of the same
instant, so that the estimate has the same delay.

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
"""Largest product of bandwidth L and period [-]. At products above 1 the estimate would
oscillate, because a sum over the periods replaces the integral."""


class DisturbanceObserver:
    """Controller that subtracts the estimated disturbances from the motor torques."""

    def __init__(
        self, inner: Controller, *, bandwidth: float = 5.0, limit: float = np.inf
    ) -> None:
        """Extend a controller.

        Args:
            inner: Controller that computes the torques without the observer.
            bandwidth: Bandwidth L/(2 pi) [Hz].
            limit: Largest magnitude of the subtracted torque [N·m].
        """
        self.inner, self.bandwidth, self.limit = inner, bandwidth, limit

    def start(self, task: Task) -> None:
        """Reset the estimate to zero.

        Raises:
            InputError: If the bandwidth is not positive or too high for the period.
        """
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
        """Disturbance torque on the motors, positive in the direction of rotation
        [N·m]. Shape (..., n_joints)."""
        self.inner.start(task)

    def torque(self, k: int, measured: Measured) -> Array:
        """Torque of the inner controller minus the estimated disturbance [N·m].

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.
        """
        joints, period = self._task.joints, self._task.period
        momentum = joints.rotor_inertia * measured.motor_speed
        if self._sum is None or k <= self._late:  # readings from before the motion
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
        correction = np.clip(self.estimate, -self.limit, self.limit)
        wanted = self.inner.torque(k, measured) - correction
        applied = np.clip(wanted, -joints.torque_limit, joints.torque_limit)
        self._applied.append(applied)
        return np.asarray(wanted)

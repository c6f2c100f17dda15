"""The motor-side loop on which a residual action acts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.controller import KnownJoints

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorLoop:
    r"""PD on the motor angle with known torques fed forward.

    .. math:: u = k_p (i\,q_d - \theta) + k_d (i\,\dot q_d - \dot\theta)
        + \tau_d/i + i J \ddot q_d

    Arrays of shape (n_joints,).
    """

    stiffness: Array
    """k_p [N·m/rad]."""
    damping: Array
    """k_d [N·m·s/rad]."""
    ratio: Array
    rotor_inertia: Array

    @classmethod
    def of(cls, joints: KnownJoints, *, frequency: float, damping_ratio: float) -> Self:
        """Gains for motor and link together on a rigid drive.

        Args:
            joints: Nominal data.
            frequency: Natural frequency [Hz].
            damping_ratio: Of the loop [-].
        """
        ratio, rotor = joints.ratio, joints.rotor_inertia
        inertia, omega = rotor + joints.link_inertia / ratio**2, 2.0 * np.pi * frequency
        return cls(
            stiffness=inertia * omega**2,
            damping=2.0 * damping_ratio * omega * inertia,
            ratio=ratio,
            rotor_inertia=rotor,
        )

    def torque(self, plan: Array, angle: Array, speed: Array, shift: Array) -> Array:
        """Motor torques [N·m]. Shape (n, n_joints).

        Args:
            plan: Position, velocity, acceleration, load and known torque of the links.
                Shape (n, 5, n_joints).
            angle: Motor angles that are read [rad]. Shape (n, n_joints).
            speed: Motor speeds that are read [rad/s]. Same shape.
            shift: Of the link's set-point [rad]. Same shape.
        """
        i = self.ratio
        return np.asarray(
            self.stiffness * (i * (plan[:, 0] + shift) - angle)
            + self.damping * (i * plan[:, 1] - speed)
            + plan[:, 4] / i
            + i * self.rotor_inertia * plan[:, 2]
        )

"""The loop of a servo drive, to which an action is added."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from swgjoint.sim.controller import KnownJoints
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorLoop:
    r"""PD on the motor angle, inside the engine's step.

    .. math:: u = c - k_p \theta - k_d \dot\theta, \quad
        c = k_p\,i\,q_d + k_d\,i\,\dot q_d + u_\mathrm{ff}

    It stands for the loop that a servo drive runs itself, many times per control
    period on its own encoder: without the sensors' resolution, noise and delay. Arrays
    of shape (n_joints,).
    """

    stiffness: Array
    """k_p [N·m/rad]."""
    damping: Array
    """k_d [N·m·s/rad]."""
    ratio: Array

    @classmethod
    def none(cls, ratio: Array) -> Self:
        """Motors that only take torques."""
        return cls(stiffness=0.0 * ratio, damping=0.0 * ratio, ratio=ratio)

    @classmethod
    def from_frequency(
        cls, joints: KnownJoints, *, frequency: float, damping_ratio: float
    ) -> Self:
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
        )

    def command(self, position: Array, velocity: Array) -> Array:
        """C without feed-forward [N·m], of the reference of the links."""
        i = self.ratio
        return np.asarray(
            self.stiffness * (i * position) + self.damping * (i * velocity)
        )

    def torque(self, command: Array, angle: Array, speed: Array) -> Array:
        """Torque of the motors over the step that led to a state [N·m]."""
        return np.asarray(command - self.stiffness * angle - self.damping * speed)

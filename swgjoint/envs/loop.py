"""Motor control loop of a servo drive, to which an action is added."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from swgjoint.sim.controller import KnownJoints
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorLoop:
    r"""PD control of the motor angle within the engine's step.

    .. math:: u = c - k_p \theta - k_d \dot\theta, \quad
        c = k_p\,i\,q_d + k_d\,i\,\dot q_d + u_\mathrm{ff}

    It represents the internal loop of a servo drive, which runs many times per control
    period with the motor encoder. The resolution, noise and delay of the sensors do not
    affect it. Arrays have shape (n_joints,).
    """

    stiffness: Array
    """Position gain k_p [N·m/rad]."""
    damping: Array
    """Speed gain k_d [N·m·s/rad]."""
    ratio: Array
    """Signed ratio i [-]."""

    @classmethod
    def none(cls, ratio: Array) -> Self:
        """Zero gains: the motors apply the commanded torques."""
        return cls(stiffness=0.0 * ratio, damping=0.0 * ratio, ratio=ratio)

    @classmethod
    def from_frequency(
        cls, joints: KnownJoints, *, frequency: float, damping_ratio: float
    ) -> Self:
        """Gains for the total inertia of motor and link with a rigid drive.

        Args:
            joints: Nominal data of the joints.
            frequency: Natural frequency of the loop [Hz].
            damping_ratio: Damping ratio of the loop [-].
        """
        ratio, rotor = joints.ratio, joints.rotor_inertia
        inertia, omega = rotor + joints.link_inertia / ratio**2, 2.0 * np.pi * frequency
        return cls(
            stiffness=inertia * omega**2,
            damping=2.0 * damping_ratio * omega * inertia,
            ratio=ratio,
        )

    def command(self, position: Array, velocity: Array) -> Array:
        """Command c without feed-forward, for a reference of the links [N·m].

        Args:
            position: Reference angle q_d of the links [rad].
            velocity: Reference speed of the links [rad/s].
        """
        i = self.ratio
        return np.asarray(
            self.stiffness * (i * position) + self.damping * (i * velocity)
        )

    def torque(self, command: Array, angle: Array, speed: Array) -> Array:
        """Motor torque over the step that ended in a state [N·m].

        Args:
            command: Command c [N·m].
            angle: Motor angle at the end of the step [rad].
            speed: Motor speed at the end of the step [rad/s].
        """
        return np.asarray(command - self.stiffness * angle - self.damping * speed)

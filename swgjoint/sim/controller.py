"""What a sampled controller receives before a motion and measures during it.

Arrays end with the joints; axes in front of them are motions that run side by side, so
that one controller drives a single joint, an arm or a batch of either.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array

Number = TypeVar("Number", np.float64, np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownJoints:
    """Nominal data of the driven joints; the true ones may differ."""

    names: tuple[str, ...]
    drives: tuple[DriveMap, ...]
    """Maps of all joints; ratio, layout and ratings are theirs."""
    rotor_inertia: Array
    """Motor rotor and wave generator [kg·m²]. Shape (n_joints,)."""
    link_inertia: Array
    """About every joint where the motion starts, others locked [kg·m²]. Same shape."""
    damping: Array
    """Damping of rotor against link along the torsion [N·m·s/rad]. Same shape."""
    torque_limit: Array
    """Torque limit of the motors [N·m], inf where there is none. Same shape."""

    @property
    def ratio(self) -> Array:
        """Signed ratios, output = input / i. Shape (n_joints,)."""
        return np.array([drive.ratio for drive in self.drives])


class KnownArm(Protocol):
    """What a controller takes the arm for, without drives.

    :class:`swgjoint.sim.arm.rigid_arm.RigidArm` is one, and
    :class:`swgjoint.control.pinocchio_arm.PinocchioArm`.
    """

    @property
    def joints(self) -> tuple[str, ...]:
        """Names, in the order of all arrays."""

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques that a motion needs [N·m]. All shapes (n, n_joints)."""

    def inertia(self, position: Array) -> Array:
        """About every joint, the others locked [kg·m²]. Shapes (n_joints,)."""


@dataclass(frozen=True, kw_only=True)
class ReadingAge:
    """How old the readings of the sensors are when the controller gets them [s].

    A nominal datum of the sensors: what their delay is stated to be. Before the motion
    sensors read its beginning. The speed of a motor from a difference of its angles is
    half a period older than these.
    """

    motor: float = 0.0
    link: float = 0.0
    torque: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """A commanded motion of the links at the instants of the control, n of them."""

    period: float
    """Between two instants [s]."""
    position: Array
    """[rad]. Shape (n, ..., n_joints)."""
    velocity: Array
    """[rad/s]. Same shape."""
    acceleration: Array
    """[rad/s²]. Same shape."""
    link_torque: Array
    """That the known arm, its weight and the known load ask of the drives on this
    motion, inertia of the links included [N·m]. Same shape."""
    joints: KnownJoints
    reading_age: ReadingAge = ReadingAge()

    def as_read(
        self, values: NDArray[Number], sensor: Literal["motor", "link", "torque"]
    ) -> NDArray[Number]:
        """What a sensor would read at the instants if values were what it measures.

        Those of an instant before, as old as the readings are, between two instants on
        the line; at the beginning the first ones.

        Args:
            values: At the instants. Shape (n, ...).
            sensor: Whose readings.
        """
        age: float = getattr(self.reading_age, sensor) / self.period
        if age == 0.0:
            return values
        whole = int(age + 1e-6)
        part = max(age - whole, 0.0)
        at = np.maximum(np.arange(len(values)) - whole, 0)
        if part < 1e-6:
            return values[at]
        before = values[np.maximum(at - 1, 0)]
        return np.asarray((1.0 - part) * values[at] + part * before)

    def periods_old(self, sensor: Literal["motor", "link", "torque"]) -> int:
        """Age of the readings of a sensor in periods, the nearest whole number."""
        age: float = getattr(self.reading_age, sensor)
        return round(age / self.period)


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Readings of the sensors that are there at one instant; shapes (..., n_joints).

    They were taken :attr:`Task.reading_age` before.
    """

    motor_angle: Array
    """[rad]."""
    motor_speed: Array
    """[rad/s]."""
    link_angle: Array | None = None
    """Reading of a link encoder [rad]; None where there is none."""
    output_torque: Array | None = None
    """Reading of a torque sensor behind the drive [N·m]; None where there is none."""


class Controller(Protocol):
    """Motor torques from readings, once a control period."""

    def start(self, task: Task) -> None:
        """Forget the last motion and prepare the next one."""

    def torque(self, k: int, measured: Measured) -> Array:
        """Torque of every motor until the next instant [N·m]. Shape (..., n_joints).

        Args:
            k: Instant of the task.
            measured: What the sensors read there.
        """

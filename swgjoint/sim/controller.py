"""Interface of sampled controllers: task, nominal joint data and measurements.

The last axis of every array counts the joints. Leading axes count simultaneous motions,
so that one controller drives a single joint, an arm, or a batch of either.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array

Number = TypeVar("Number", np.float64, np.complex128)


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownJoints:
    """Nominal data of the driven joints; the true data may differ."""

    names: tuple[str, ...]
    """Joint names, in the order of the last axis of all arrays."""
    drives: tuple[DriveMap, ...]
    """Drive maps of all joints, which include ratio, layout and ratings."""
    rotor_inertia: Array
    """Inertia of motor rotor and wave generator about the motor axis [kg·m²]. Shape
    (n_joints,)."""
    link_inertia: Array
    """Link inertia about every joint at the start of the motion, other joints locked
    [kg·m²]. Shape (n_joints,)."""
    damping: Array
    """Damping between rotor and link along the torsion [N·m·s/rad]. Shape
    (n_joints,)."""
    torque_limit: Array
    """Torque limit of the motors [N·m], inf without a limit. Shape (n_joints,)."""

    @property
    def ratio(self) -> Array:
        """Signed ratios i, output = input / i. Shape (n_joints,)."""
        return np.array([drive.ratio for drive in self.drives])


class KnownArm(Protocol):
    """A controller's model of the arm without its drives.

    :class:`swgjoint.sim.arm.rigid_arm.RigidArm` and
    :class:`swgjoint.control.pinocchio_arm.PinocchioArm` implement it.
    """

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint names, in the order of the last axis of all arrays."""

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques of a motion by inverse dynamics [N·m]. Shape (n, n_joints).

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).
            velocity: Joint speeds [rad/s]. Shape (n, n_joints).
            acceleration: Joint accelerations [rad/s²]. Shape (n, n_joints).
        """

    def inertia(self, position: Array) -> Array:
        """Inertia about every joint, the others locked [kg·m²]. Shape (n_joints,).

        Args:
            position: Joint angles [rad]. Shape (n_joints,).
        """


@dataclass(frozen=True, kw_only=True)
class ReadingAge:
    """Age of the sensor readings when the controller receives them [s].

    The ages are nominal data, namely the delays that the scene states for its sensors.
    Until a delay has elapsed, the sensor returns the first sample of the motion. A
    motor speed computed as a difference of two angle readings is half a control period
    older than ``motor``.
    """

    motor: float = 0.0
    """Age of the motor encoder readings [s]."""
    link: float = 0.0
    """Age of the link encoder readings [s]."""
    torque: float = 0.0
    """Age of the torque sensor readings [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownLoop:
    r"""Motor loop within the engine's step, to which a controller adds its torque.

    .. math:: u = k_p (i q - \theta) + k_d (i \dot q - \dot\theta) + u_\mathrm{ff}
    """

    stiffness: Array
    """Position gain k_p [N·m/rad]. Shape (n_joints,)."""
    damping: Array
    """Speed gain k_d [N·m·s/rad]. Shape (n_joints,)."""
    feedforward: Array
    """Feed-forward torque of the motors [N·m]. Shape (n, ..., n_joints)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """A commanded motion of the links at the n control instants."""

    period: float
    """Control period: time between two instants [s]."""
    position: Array
    """Commanded link angles [rad]. Shape (n, ..., n_joints)."""
    velocity: Array
    """Commanded link speeds [rad/s]. Shape (n, ..., n_joints)."""
    acceleration: Array
    """Commanded link accelerations [rad/s²]. Shape (n, ..., n_joints)."""
    link_torque: Array
    """Drive torques that this motion requires in the controller's model: inertia and
    weight of the arm, and the load [N·m]. Shape (n, ..., n_joints)."""
    joints: KnownJoints
    """Nominal data of the driven joints."""
    reading_age: ReadingAge = ReadingAge()
    """Age of the sensor readings."""
    loop: KnownLoop | None = None
    """Motor loop to which torques are added; None if they are the whole torques."""

    def select(self, episodes: int | slice) -> Task:
        """Motion of one or some of several episodes, the second axis of all arrays."""
        loop = self.loop
        if loop is not None:
            loop = replace(loop, feedforward=loop.feedforward[:, episodes])
        return replace(
            self,
            position=self.position[:, episodes],
            velocity=self.velocity[:, episodes],
            acceleration=self.acceleration[:, episodes],
            link_torque=self.link_torque[:, episodes],
            loop=loop,
        )

    def as_read(
        self, values: NDArray[Number], sensor: Literal["motor", "link", "torque"]
    ) -> NDArray[Number]:
        """Readings that a sensor would return for exact values at the instants.

        Each reading is the value one reading age earlier, interpolated linearly between
        instants. Readings taken before the motion equal the first value.

        Args:
            values: Exact values at the instants. Shape (n, ...).
            sensor: Sensor whose age applies.

        Returns:
            Delayed values. Shape (n, ...).
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
        """Age of the readings of a sensor, rounded to whole control periods."""
        age: float = getattr(self.reading_age, sensor)
        return round(age / self.period)


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Sensor readings available at one instant. Shapes (..., n_joints).

    The sensors took them :attr:`Task.reading_age` earlier.
    """

    motor_angle: Array
    """Motor angle [rad]."""
    motor_speed: Array
    """Motor speed [rad/s]."""
    link_angle: Array | None = None
    """Link encoder reading [rad]; None without a link encoder."""
    output_torque: Array | None = None
    """Output torque sensor reading [N·m]; None without a torque sensor."""
    error_estimate: Array | None = None
    """Estimated kinematic error [rad] and its rate [rad/s] for every order, see
    :mod:`swgjoint.envs.identification`; None without an estimate. Shape (...,
    n_values)."""


class Controller(Protocol):
    """Control law: motor torques from sensor readings, once per control period."""

    def start(self, task: Task) -> None:
        """Reset the controller and prepare it for a motion."""

    def torque(self, k: int, measured: Measured) -> Array:
        """Torque of every motor until the next instant [N·m]. Shape (..., n_joints).

        With a :attr:`Task.loop` it is added to the torque of the loop.

        Args:
            k: Index of the control instant.
            measured: Sensor readings at this instant.
        """

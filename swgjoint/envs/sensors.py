"""Sensor readings of simulated joints, with resolution, noise and delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.arguments import format_value, is_flag, is_number, is_whole
from swgjoint.errors import InputError
from swgjoint.typing import Array
from swgjoint.units import arcsec


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Sensors of every joint; the motor encoder is always present.

    The defaults have the order of magnitude that is typical of servo drives; they do
    not describe one product.
    """

    motor_counts: int = 2**17
    """Counts of the motor encoder per turn; 0 means no rounding to counts."""
    motor_noise_rad: float = 2e-5
    """Standard deviation of the motor angle before it is rounded to counts [rad]."""
    link_encoder: bool = False
    """Whether there is a link encoder."""
    link_counts: int = 2**20
    """Counts of the link encoder per turn; 0 means no rounding to counts."""
    link_noise_rad: float = arcsec
    """Standard deviation of the link angle before it is rounded to counts [rad]."""
    torque_sensor: bool = False
    """Whether there is an output torque sensor."""
    torque_noise_of_rated: float = 1e-3
    """Standard deviation of a torque reading, that of gauges included, relative to
    rated torque [-]."""
    delay_periods: int = 1
    """Age of every reading when the controller receives it [control periods], at most
    the length of an episode."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, kind = getattr(self, field.name), str(field.type)
            fits, accepted = {
                "int": (is_whole, "an integer >= 0"),
                "float": (is_number, "a finite number >= 0"),
                "bool": (is_flag, "True, False"),
            }[kind]
            if not (fits(value) and value >= 0):
                raise InputError(
                    f"sensor {field.name} {format_value(value)}; accepted: {accepted}"
                )
            if kind == "int":  # accepts 2.0, as from a file or a division
                object.__setattr__(self, field.name, int(value))

    @classmethod
    def from_argument(cls, argument: Mapping[str, float] | Sensors | None) -> Sensors:
        """Sensors from the argument ``sensors`` of an environment.

        None means the defaults.

        Raises:
            InputError: If the argument has another type or an unknown key, or if a
                value is not accepted.
        """
        if argument is None or isinstance(argument, Sensors):
            return argument or cls()
        known = {field.name for field in fields(cls)}
        if not isinstance(argument, Mapping):
            raise InputError(
                f"sensors {format_value(argument)}; accepted: None or a mapping with"
                f" {', '.join(sorted(known))}"
            )
        if unknown := [key for key in argument if key not in known]:
            raise InputError(
                f"sensor {format_value(unknown[0])}; accepted:"
                f" {', '.join(sorted(known))}"
            )
        return cls(**argument)  # type: ignore[arg-type]


class Readout:
    """Readings of n simulations over time.

    The channels are the motor angles of all joints, followed by the link angles and the
    output torques if there are such sensors, and by the torques that strain gauges
    read at the joints that have them.
    """

    def __init__(
        self,
        sensors: Sensors,
        count: int,
        rated_torque: Array,
        period: float,
        *,
        gauges: Sequence[int] = (),
    ) -> None:
        """Prepare the channels of all simulations.

        Args:
            sensors: Sensors of every joint.
            count: Number of simulations.
            rated_torque: Rated torque of every drive [N·m]. Shape (n_joints,).
            period: Control period [s].
            gauges: Numbers of the joints with strain gauges.
        """
        joints, self._period = len(rated_torque), period
        one = np.ones(joints)
        parts = [
            (_count(sensors.motor_counts) * one, sensors.motor_noise_rad * one),
        ]
        if sensors.link_encoder:
            parts.append(
                (_count(sensors.link_counts) * one, sensors.link_noise_rad * one)
            )
        noise = sensors.torque_noise_of_rated * rated_torque
        if sensors.torque_sensor:
            parts.append((0.0 * one, noise))
        parts.append((0.0 * one[list(gauges)], noise[list(gauges)]))
        self._resolution, self._noise = map(np.concatenate, zip(*parts, strict=True))
        self._coarse = self._resolution > 0.0
        self._rounds = self._resolution[self._coarse]
        self.channels = self._noise.size
        """Number of channels."""
        self._motor = slice(0, joints)
        self._ages = sensors.delay_periods + 1
        # ring buffer of the last readings, of which the oldest is returned
        self._ring = np.zeros((self._ages, count, self.channels))
        self._now = 0
        self._last = np.zeros((count, joints))
        self.value = np.zeros((count, self.channels))
        """Delayed readings that the controller receives. Shape (n, channels)."""
        self.motor_speed = np.zeros((count, joints))
        """Change of the motor reading per control period [rad/s]. Shape
        (n, n_joints)."""

    def _sense(self, true: Array, normal: Array) -> Array:
        """Readings with noise and resolution but without delay."""
        reading = true + self._noise * normal
        reading[:, self._coarse] = (
            np.floor(reading[:, self._coarse] / self._rounds) * self._rounds
        )
        return reading

    def channel_errors(self) -> list[tuple[float, float]]:
        """Standard deviation of the noise and angle of one count of every channel."""
        return list(zip(self._noise.tolist(), self._resolution.tolist(), strict=True))

    def list_past(self) -> deque[list[float]]:
        """Readings of the first simulation after its restart, the oldest first."""
        return deque(self._ring[:, 0].tolist())

    def start(self, rows: NDArray[np.intp], true: Array, normal: Array) -> None:
        """Restart some simulations, whose joints were at rest before the start.

        Args:
            rows: Indices of the simulations. Shape (m,).
            true: True values of the channels at the start. Shape (m, channels).
            normal: Standard normal random numbers for the noise. Same shape.
        """
        reading = self._sense(true, normal)
        self._ring[:, rows] = reading
        self.value[rows] = reading
        self._last[rows] = reading[:, self._motor]
        self.motor_speed[rows] = 0.0

    def read(self, true: Array, normal: Array) -> None:
        """Take the readings of all simulations at one instant.

        Args:
            true: True values of the channels. Shape (n, channels).
            normal: Standard normal random numbers for the noise. Same shape.
        """
        self._ring[self._now] = self._sense(true, normal)
        self._now = (self._now + 1) % self._ages
        self.value = self._ring[self._now].copy()
        motor = self.value[:, self._motor]
        self.motor_speed = (motor - self._last) / self._period
        self._last = motor


def _count(counts: int) -> float:
    """Angle of one count [rad]; 0 if readings are not rounded."""
    return 2.0 * np.pi / counts if counts else 0.0

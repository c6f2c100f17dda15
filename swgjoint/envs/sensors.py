"""What the controller of a simulated joint reads: resolution, noise, delay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.arguments import format_value, is_flag, is_number, is_whole
from swgjoint.errors import InputError
from swgjoint.typing import Array
from swgjoint.units import arcsec


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Sensors of every joint; the motor's encoder is always there.

    Defaults are the order of magnitude of servo drives, not of one product.
    """

    motor_counts: int = 2**17
    """Counts of the motor's encoder per turn; 0 reads the angle itself."""
    motor_noise_rad: float = 2e-5
    """Standard deviation before the reading is rounded."""
    link_encoder: bool = False
    link_counts: int = 2**20
    """Counts of the link's encoder per turn; 0 reads the angle itself."""
    link_noise_rad: float = arcsec
    torque_sensor: bool = False
    torque_noise_of_rated: float = 1e-3
    """Standard deviation, as part of the rated torque."""
    delay_periods: int = 1
    """Age of every reading when the controller gets it, in control periods; at most
    those of an episode."""

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
            if kind == "int":  # what a file or a division may have as 2.0
                object.__setattr__(self, field.name, int(value))

    @classmethod
    def from_argument(cls, argument: Mapping[str, float] | Sensors | None) -> Sensors:
        """What the argument ``sensors`` of an environment means; None: defaults."""
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

    Channels are the motor angles of all joints, then, where there are such sensors,
    the link angles and the output torques.
    """

    def __init__(
        self, sensors: Sensors, count: int, rated_torque: Array, period: float
    ) -> None:
        """Prepare; see :class:`Sensors`.

        Args:
            sensors: Of every joint.
            count: Of the simulations.
            rated_torque: Of the joints [N·m]. Shape (n_joints,).
            period: Of the control [s].
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
        if sensors.torque_sensor:
            parts.append((0.0 * one, sensors.torque_noise_of_rated * rated_torque))
        self._resolution, self._noise = map(np.concatenate, zip(*parts, strict=True))
        self._coarse = self._resolution > 0.0
        self._rounds = self._resolution[self._coarse]
        self.channels = self._noise.size
        """Numbers of one reading."""
        self._motor = slice(0, joints)
        self._ages = sensors.delay_periods + 1
        # a ring of the last readings, the oldest of them is what is given
        self._ring = np.zeros((self._ages, count, self.channels))
        self._now = 0
        self._last = np.zeros((count, joints))
        self.value = np.zeros((count, self.channels))
        """What the controller gets. Shape (n, channels)."""
        self.motor_speed = np.zeros((count, joints))
        """Change of the motor reading over a period [rad/s]. Shape (n, n_joints)."""

    def _sense(self, true: Array, normal: Array) -> Array:
        got = true + self._noise * normal
        got[:, self._coarse] = (
            np.floor(got[:, self._coarse] / self._rounds) * self._rounds
        )
        return got

    def start(self, rows: NDArray[np.intp], true: Array, normal: Array) -> None:
        """Begin anew for some simulations, at rest as long as the delay looks back.

        Args:
            rows: Which simulations. Shape (m,).
            true: Of the channels. Shape (m, channels).
            normal: Standard normal numbers. Same shape.
        """
        got = self._sense(true, normal)
        self._ring[:, rows] = got
        self.value[rows] = got
        self._last[rows] = got[:, self._motor]
        self.motor_speed[rows] = 0.0

    def read(self, true: Array, normal: Array) -> None:
        """Take the readings of one instant of all simulations.

        Args:
            true: Of the channels. Shape (n, channels).
            normal: Standard normal numbers. Same shape.
        """
        self._ring[self._now] = self._sense(true, normal)
        self._now = (self._now + 1) % self._ages
        self.value = self._ring[self._now].copy()
        motor = self.value[:, self._motor]
        self.motor_speed = (motor - self._last) / self._period
        self._last = motor


def _count(counts: int) -> float:
    """Angle of one count [rad]; 0 for an exact reading."""
    return 2.0 * np.pi / counts if counts else 0.0

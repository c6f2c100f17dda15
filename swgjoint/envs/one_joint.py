"""A single episode on the bench, computed with numbers instead of arrays.

Arrays of one element cost about as much as arrays of a hundred. The results are those
of :class:`swgjoint.envs.bench.BenchCore`, bit by bit: every number results from the
same operations in the same order.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import floor, isfinite
from typing import Any, ClassVar

import numpy as np

from swgjoint.envs.bench import BenchCore
from swgjoint.envs.entries import bounds
from swgjoint.typing import Array
from swgjoint.units import arcmin

Outcome = tuple[Array, float, int, bool, dict[str, Any]]
"""Observation, reward, number of the exceeded limit, whether the episode has its full
length, and info."""


class JointEpisode(ABC):
    """The only episode of a core, whose arrays keep the state of its start."""

    core_of: ClassVar[type[BenchCore]]
    """Class of the core whose results it computes; others, derived ones included, may
    have another reward or observation."""

    def __init__(self, core: BenchCore) -> None:
        """Prepare what all episodes have in common.

        Args:
            core: Core of one episode.
        """
        self.core, limits, loop = core, core.limits, core.loop
        self.ratio, self.period, self.steps = core.joint.ratio, core.period, core.steps
        self.limit = float(limits.motor_torque[0])
        """Torque limit of the motor [N·m]."""
        self.gains = float(loop.stiffness[0]), float(loop.damping[0])
        """Gains of the motor loop [N·m/rad], [N·m·s/rad]."""
        self._centre = float(limits.centre[0])
        self._tops = [
            float(one[0])
            for one in (
                limits.angle,
                limits.motor_speed,
                limits.momentary_peak,
                limits.ratcheting,
            )
        ]
        entries = *bounds(core.observation_entries), core.units
        self._bounds = list(zip(*(one.tolist() for one in entries), strict=True))
        self._sensors, self._gauges = core.sensors, core.gauges.get(0)
        self._channels = core.readout.channel_errors()
        self._advance = core.plant.step_one

    def begin(self) -> None:
        """Take over the state of the core after its reset."""
        core = self.core
        self._plan, self._noise = core.plans.views_of_one()
        self.now = self.plan_at(0)
        """Position, velocity, acceleration, load torque and known torque now."""
        self._past = core.readout.list_past()
        self.readings = self._past[0]
        """Delayed readings of all channels. Shape (n_channels,)."""
        self._last = self.readings[0]
        self.instant = 0

    @abstractmethod
    def command(self, action: float) -> float:
        """Motor input for a clipped action [N·m]."""

    @abstractmethod
    def columns(self) -> list[float]:
        """Parts of the observation without link encoder, torque sensor and gauges."""

    def judge(self) -> None:  # noqa: B027  (most need no further quantities)
        """Set further quantities of reward and info after a step."""

    @abstractmethod
    def reward(self) -> float:
        """Reward of the last step [-]."""

    def step(self, action: Array) -> Outcome | None:
        """Take one control period; None if the action is not a finite number.

        Args:
            action: Action [-], which is clipped to -1 to 1. Shape (1,).
        """
        if action.shape != (1,) or not isfinite(value := float(action[0])):
            return None
        self.action = min(max(value, -1.0), 1.0)
        command = self.command(self.action)
        state = self._advance(command, self.now[3])
        self.motor_angle, speed, self.link_angle, self.output_torque = state
        self.instant += 1
        self.now = self.plan_at(self.instant)
        stiffness, damping = self.gains
        wanted = command - stiffness * self.motor_angle - damping * speed
        self.motor_torque = min(max(wanted, -self.limit), self.limit)
        self._read()
        self.link_error = self.link_angle - self.now[0]
        self.judge()
        values = self.columns() + self.readings[1:]
        observation = np.array(
            [
                min(max(one, low), high) / unit
                for one, (low, high, unit) in zip(values, self._bounds, strict=True)
            ]
        )
        broken = self._broken(speed)
        info = self.info()
        info["broken_limit"] = broken
        return observation, self.reward(), broken, self.instant >= self.steps, info

    def plan_at(self, instant: int) -> list[float]:
        """Plan at an instant, or at the end of the episode if that is earlier."""
        values: list[float] = self._plan[min(instant, self.steps)].tolist()
        return values

    def _read(self) -> None:
        """Take the readings of this instant, and pass on the oldest ones."""
        true = [self.motor_angle]
        if self._sensors.link_encoder:
            true.append(self.link_angle)
        if self._sensors.torque_sensor:
            true.append(self.output_torque)
        if self._gauges is not None:
            angles = self.motor_angle, self.link_angle
            true.append(self._gauges.read_torque(self.output_torque, *angles))
        noise = self._noise[min(self.instant, self.steps)].tolist()
        now = []
        for value, normal, (deviation, count) in zip(
            true, noise, self._channels, strict=True
        ):
            reading = value + deviation * normal
            if count > 0.0 and isfinite(reading):
                reading = floor(reading / count) * count
            now.append(reading)
        self._past.append(now)
        self._past.popleft()
        self.readings = self._past[0]
        motor = self.readings[0]
        self.measured_speed = (motor - self._last) / self.period
        """Change of the motor reading per control period [rad/s]."""
        self._last = motor

    def _broken(self, speed: float) -> int:
        """Number of the exceeded limit, as :meth:`swgjoint.envs.core.Core.broken`."""
        angle, top_speed, peak, ratcheting = self._tops
        torque, number = abs(self.output_torque), 0
        if not abs(self.link_angle - self._centre) <= angle:
            number = 1
        if not abs(speed) <= top_speed:
            number = 2
        if not torque <= peak:
            number = 3
        if not torque <= ratcheting:
            number = 4
        return number

    def info(self) -> dict[str, Any]:
        """True values, as :meth:`swgjoint.envs.core.Core.info`."""
        error = self.link_angle - self.motor_angle / self.ratio
        return {
            "link_error_arcmin": self.link_error / arcmin,
            "transmission_error_arcmin": error / arcmin,
            "output_torque_Nm": self.output_torque,
            "motor_torque_Nm": self.motor_torque,
            "load_torque_Nm": self.now[3],
            "link_angle_rad": self.link_angle,
            "motor_angle_rad": self.motor_angle,
            "time_s": self.instant * self.period,
        }

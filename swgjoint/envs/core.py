"""What all environments share: episodes of driven joints, n of them side by side.

Every number is made here, on arrays that begin with the episodes, so that a single
environment (n = 1) and a batch agree to the last bit. :mod:`swgjoint.envs.api` puts the
two interfaces of gymnasium in front.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import floor, log10
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.loop import MotorLoop
from swgjoint.envs.plant import Plant
from swgjoint.envs.sensors import Readout, Sensors
from swgjoint.envs.specimen import SpecimenTolerances
from swgjoint.errors import InputError
from swgjoint.joint.variation import Variation
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.controller import KnownJoints, Measured, ReadingAge, Task
from swgjoint.typing import Array
from swgjoint.units import arcmin

Rows = NDArray[np.intp]

TRACKED = 50.0 * arcmin
"""Error of a link to which the observed tracking error reaches [rad]: twenty times what
a rigid plan leaves. A far larger range would hide from whoever scales by it what is to
be controlled; beyond it the entry stays at its bound, and reference and reading are
observed whole."""
REGAINED = 0.1
"""Time in which the largest observed speed error would make that error [s]."""

LIMITS = ("none", "angle", "speed", "momentary_peak", "ratcheting")
"""What ``info["broken_limit"]`` counts."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One number of an observation or an action."""

    meaning: str
    unit: str
    low: float
    high: float
    count: int = 1
    """So many numbers of the kind, one per joint."""


def table(entries: Sequence[Entry]) -> str:
    """The entries as the table of a docstring."""
    rows, first = [("index", "meaning", "unit", "range")], 0
    for e in entries:
        index = str(first) if e.count == 1 else f"{first}-{first + e.count - 1}"
        rows.append((index, e.meaning, e.unit, f"{e.low:.5g} to {e.high:.5g}"))
        first += e.count
    widths = [max(len(row[c]) for row in rows) for c in range(4)]
    line = "  ".join("=" * w for w in widths)
    text = ["  ".join(x.ljust(w) for x, w in zip(r, widths, strict=True)) for r in rows]
    return "\n".join(t.rstrip() for t in [line, text[0], line, *text[1:], line])


def bounds(entries: Sequence[Entry]) -> tuple[Array, Array]:
    """Bounds of every number, low and high."""
    low, high = np.array([(e.low, e.high) for e in entries for _ in range(e.count)]).T
    return low, high


def error_bounds(
    ratio: float, *, speed: float, acceleration: float, age: float, period: float
) -> tuple[float, float]:
    """Ranges of observed errors of a motor's angle [rad] and speed [rad/s].

    A reading is held against the reference of now, so what the reference does in its
    age comes on top.

    Args:
        ratio: Of the drive.
        speed: Largest of the reference, at the link [rad/s].
        acceleration: Likewise [rad/s²].
        age: Of the readings [s].
        period: Of the control, over which a speed is the change of the angle [s].
    """
    i = abs(ratio)
    return (
        ceiling(i * (TRACKED + speed * age)),
        ceiling(i * (TRACKED / REGAINED + acceleration * (age + 0.5 * period))),
    )


def ceiling(value: float) -> float:
    """A value rounded up to two digits: bounds that a table can state."""
    digit = 10.0 ** (floor(log10(value)) - 1)
    return max(value, float(f"{np.ceil(value / digit * (1.0 - 1e-9)) * digit:.6g}"))


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeLimits:
    """What ends an episode; arrays of shape (n_joints,)."""

    angle: Array
    """Angle of the links about ``centre`` [rad]."""
    centre: Array
    """[rad]."""
    motor_speed: Array
    """[rad/s]."""
    momentary_peak: Array
    """Torque of the drives [N·m]."""
    ratcheting: Array
    """Torque at which teeth skip [N·m], inf where it is not known."""
    motor_torque: Array
    """Torque of the motors, which hold it themselves [N·m]."""


class Core(ABC):
    """Episodes on a :class:`~swgjoint.envs.plant.Plant`."""

    def __init__(
        self,
        plant: Plant,
        *,
        joints: KnownJoints,
        loop: MotorLoop,
        limits: EpisodeLimits,
        sensors: Sensors,
        tolerances: SpecimenTolerances | None,
        period: float,
        steps: int,
        shared: bool = False,
    ) -> None:
        """Prepare episodes.

        Args:
            plant: The simulations.
            joints: Nominal data, for the task.
            loop: That the motors have in the engine.
            limits: Of angle, speed and torque.
            sensors: Of every joint.
            tolerances: Of the drives; None: all are nominal.
            period: Of the control [s].
            steps: Control periods of an episode.
            shared: Whether all episodes have one plan.
        """
        self.plant, self.joints, self.limits = plant, joints, limits
        self.sensors, self.tolerances, self.loop = sensors, tolerances, loop
        self.period, self.steps = period, steps
        if sensors.delay_periods > steps:
            raise InputError(
                f"sensor delay_periods {sensors.delay_periods}; accepted: at most the"
                f" {steps} periods of an episode"
            )
        count, n = plant.batch.nsim, len(joints.names)
        rated = np.array([d.ratings.rated_torque for d in joints.drives])
        self._readout = Readout(sensors, count, rated, period)
        self._rows = np.arange(count)
        self.instant = np.zeros(count, dtype=np.intp)
        """Control periods since the start. Shape (n,)."""
        # position, velocity, acceleration, load, known torque of the links
        own = np.arange(1 if shared else count)
        self._plan = np.zeros((own.size, steps + 1, 5, n))
        self._planned = np.broadcast_to(own, count) if shared else own
        self._task: Task | None = None
        self._normal = np.zeros((count, steps + 1, self._readout.channels))
        self.variations: list[tuple[Variation, ...]] = [(Variation(),) * n] * count
        """Deviations of every simulation's drives from the nominal ones."""
        self.observation_entries, self.action_entries = self.entries()
        self.action = np.zeros((count, sum(e.count for e in self.action_entries)))
        """The last one, limited."""
        self.motor_torque = np.zeros((count, n))
        """The last one [N·m]."""
        self.output_torque = np.zeros((count, n))
        """Output torque of the drives [N·m]."""
        self._low, self._high = bounds(self.observation_entries)

    # -- what an environment adds ---------------------------------------------

    @abstractmethod
    def entries(self) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
        """Entries of observation and action."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> Array:
        """The plan of one episode, shape (steps + 1, 5, n_joints).

        Position, velocity, acceleration, load and known torque of the links, inertia
        included.
        """

    @abstractmethod
    def command(self, action: Array) -> Array:
        """Input of the motors for a limited action [N·m]. Shape (n, n_joints)."""

    def start(self, plan: Array) -> tuple[Array, Array]:
        """Motor angles [rad], on the reference, and torques of the drives [N·m].

        Args:
            plan: Of the episode that begins.
        """
        return self.joints.ratio * plan[0, 0], plan[0, 4]

    @abstractmethod
    def columns(self) -> list[Array]:
        """The observation, part by part, shapes (n, 1) or (n, n_joints).

        First the motor angles and speeds that are read, last :meth:`readings`.
        """

    @abstractmethod
    def reward(self) -> Array:
        """Reward of the step that was taken. Shape (n,)."""

    @abstractmethod
    def vary_load(self, index: int, shares: Array) -> None:
        """Let the load's inertia of one simulation differ; shares of (n_joints,)."""

    # -- episodes -------------------------------------------------------------

    def restart(self, rows: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Begin episodes of some simulations, each with its own generator."""
        # new arrays: what was returned of the last step must not change
        torque = self.output_torque.copy()
        for k, rng in zip(rows, rngs, strict=True):
            maps: tuple[DriveMap, ...] = tuple(d.drive for d in self.plant.drives)
            if self.tolerances is not None:
                drawn = [self.tolerances.draw(rng) for _ in maps]
                self.vary_load(k, np.array([share for _, share in drawn]))
                if self.plant.variable:
                    self.variations[k] = specimens = tuple(v for v, _ in drawn)
                    self.plant.vary(k, specimens)
                    maps = tuple(
                        v.apply_to(m) for v, m in zip(specimens, maps, strict=True)
                    )
            self._plan[self._planned[k]] = plan = self.draw(rng)
            self._normal[k] = rng.standard_normal(self._normal.shape[1:])
            angle, torque[k] = self.start(plan)
            self.plant.place(k, angle, torque[k], maps)
        self._task = None
        index = np.asarray(rows, dtype=np.intp)
        self.instant[index] = 0
        self.output_torque = torque
        self.action = _without(self.action, index)
        self.motor_torque = _without(self.motor_torque, index)
        self._look()
        self._readout.start(index, self._true()[index], self._normal[index, 0])
        self.judge()
        self.forget(index)

    def step(self, action: Array, active: NDArray[np.bool_] | None) -> None:
        """Take one control period.

        Args:
            action: Shape (n, n_actions); beyond its range it is limited.
            active: Episodes that go on; None: all. Shape (n,).

        Raises:
            InputError: If the action has another shape or is not finite.
        """
        plant, limit = self.plant, self.limits.motor_torque
        action = np.asarray(action, float)
        if action.shape != self.action.shape or not np.isfinite(action).all():
            what = "not finite" if action.shape == self.action.shape else action.shape
            raise InputError(
                f"action: {what}; accepted: {self.action.shape[1]} finite numbers for"
                f" each of {len(self.action)} episodes"
            )
        self.action = np.clip(action, -1.0, 1.0)
        command = self.command(self.action)
        plant.step(command, self.now[:, 3], active)
        self.instant += 1 if active is None else active
        self._look()
        wanted = self.loop.torque(command, self.motor_angle, plant.motor_speed)
        self.motor_torque = np.clip(wanted, -limit, limit)
        self.output_torque = self.plant.output_torque()
        self._readout.read(self._true(), self._normal[self._rows, self._here])
        self.judge()
        self.remember()

    def next_plan(self) -> Array:
        """Plan at the end of the step that begins. Shape (n, 5, n_joints)."""
        after = np.minimum(self.instant + 1, self.steps)
        return np.asarray(self._plan[self._planned, after])

    def _look(self) -> None:
        """Take in where the simulations stand."""
        plant = self.plant
        self._here = np.minimum(self.instant, self.steps)
        self.now = self._plan[self._planned, self._here]
        """Plan at this instant. Shape (n, 5, n_joints)."""
        self.motor_angle, self.link_angle = plant.motor_angle, plant.link_angle

    def judge(self) -> None:
        """Set what reward and info need of the state alone."""
        self.link_error = self.link_angle - self.now[:, 0]
        """Link minus reference [rad]. Shape (n, n_joints)."""

    def remember(self) -> None:  # noqa: B027  (most have nothing to remember)
        """After a step: carry on what reward and info need of the past."""

    def forget(self, rows: Rows) -> None:  # noqa: B027
        """At the start of episodes: begin anew with that."""

    def _true(self) -> Array:
        parts = [self.motor_angle]
        if self.sensors.link_encoder:
            parts.append(self.link_angle)
        if self.sensors.torque_sensor:
            parts.append(self.output_torque)
        return np.concatenate(parts, axis=1)

    def observation(self) -> Array:
        """What the sensors read and what is known, limited. Shape (n, n_entries)."""
        return np.clip(np.concatenate(self.columns(), axis=1), self._low, self._high)

    def readings(self) -> list[Array]:
        """Of link encoder and torque sensor, where they are. Shapes (n, n_joints)."""
        n, value = len(self.joints.names), self._readout.value
        return [value[:, k : k + n] for k in range(n, value.shape[1], n)]

    def broken(self) -> NDArray[np.int64]:
        """Number of the limit that is broken, see :data:`LIMITS`. Shape (n,)."""
        limits, torque = self.limits, np.abs(self.output_torque)
        got = np.zeros(len(torque), dtype=np.int64)
        # what is not a number breaks every limit; the worst is named
        for number, inside in (
            (1, np.abs(self.link_angle - limits.centre) <= limits.angle),
            (2, np.abs(self.plant.motor_speed) <= limits.motor_speed),
            (3, torque <= limits.momentary_peak),
            (4, torque <= limits.ratcheting),
        ):
            got[~inside.all(axis=1)] = number
        return got

    @property
    def over(self) -> NDArray[np.bool_]:
        """Whether episodes have reached their length. Shape (n,)."""
        return self.instant >= self.steps

    def info(self) -> dict[str, NDArray[Any]]:
        """True values behind the observation, per joint where there are several."""
        error = self.link_angle - self.motor_angle / self.plant.ratio
        got: dict[str, NDArray[Any]] = {
            "link_error_arcmin": self.link_error / arcmin,
            "transmission_error_arcmin": error / arcmin,
            "output_torque_Nm": self.output_torque,
            "motor_torque_Nm": self.motor_torque,
            "load_torque_Nm": self.now[:, 3],
            "link_angle_rad": self.link_angle,
            "motor_angle_rad": self.motor_angle,
        }
        if len(self.joints.names) == 1:
            got = {key: value[:, 0] for key, value in got.items()}
        return got | {"time_s": self.instant * self.period}

    # -- for controllers ------------------------------------------------------

    @property
    def task(self) -> Task:
        """The motions of all episodes, episodes in front of the joints."""
        if self._task is None:
            # (5, steps + 1, n, n_joints); a copy, which the next episodes leave alone
            plan = self._plan[self._planned].transpose(2, 1, 0, 3).copy()
            age = self.sensors.delay_periods * self.period
            self._task = Task(
                period=self.period,
                position=plan[0],
                velocity=plan[1],
                acceleration=plan[2],
                link_torque=plan[4],
                joints=self.joints,
                reading_age=ReadingAge(motor=age, link=age, torque=age),
            )
        return self._task

    def read_measurements(self, observation: Array) -> Measured:
        """What a controller reads from observations of any leading axes."""
        n, last = len(self.joints.names), observation.shape[-1]
        torque = last - n if self.sensors.torque_sensor else None
        link = (torque or last) - n if self.sensors.link_encoder else None

        def part(first: int | None) -> Array | None:
            return None if first is None else observation[..., first : first + n]

        got = Measured(
            motor_angle=observation[..., :n], motor_speed=observation[..., n : 2 * n]
        )
        return replace(got, link_angle=part(link), output_torque=part(torque))


def _without(values: Array, rows: Rows) -> Array:
    """A copy with zeros in some rows."""
    got = values.copy()
    got[rows] = 0.0
    return got

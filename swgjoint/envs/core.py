"""Base of all environments: n parallel episodes of driven joints.

All values are computed here with episodes as first axis, so that one environment and a
batch are bit-identical. :mod:`swgjoint.envs.api` has the gymnasium interfaces.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.entries import Entry, bounds
from swgjoint.envs.limits import EpisodeLimits
from swgjoint.envs.loop import MotorLoop
from swgjoint.envs.plans import Plans, PlanSize
from swgjoint.envs.plant import Plant
from swgjoint.envs.sensors import Readout, Sensors
from swgjoint.envs.specimen import SpecimenTolerances
from swgjoint.errors import InputError
from swgjoint.joint.variation import SIZE, Variation
from swgjoint.sim.controller import (
    KnownJoints,
    KnownLoop,
    Measured,
    ReadingAge,
    Task,
)
from swgjoint.sim.gauges import JointGauges
from swgjoint.typing import Array
from swgjoint.units import arcmin

Rows = NDArray[np.intp]


class Core(ABC):
    """Episodes on a :class:`~swgjoint.envs.plant.Plant`."""

    first_step = 0
    """Last instant without a reward."""

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
        normalise: bool,
        gauges: Mapping[int, JointGauges] | None = None,
        shared: bool = False,
        plan_rows: int = 5,
    ) -> None:
        """Prepare episodes.

        Args:
            plant: The simulations.
            joints: Nominal data of the joints, for the task.
            loop: Motor control loops in the engine.
            limits: Limits of angle, speed and torque.
            sensors: Sensors of every joint.
            tolerances: Tolerances of the drives; None: all drives are nominal.
            period: Control period [s].
            steps: Number of control periods of an episode.
            normalise: Whether observations are divided by :attr:`units`.
            gauges: Strain gauges on flexsplines, by number of the joint.
            shared: Whether all episodes follow the same plan.
            plan_rows: Number of rows of a plan, see :meth:`draw`.
        """
        self.plant, self.joints, self.limits = plant, joints, limits
        self.sensors, self.tolerances, self.loop = sensors, tolerances, loop
        self.period, self.steps = period, steps
        self.gauges = dict(sorted((gauges or {}).items()))
        if sensors.delay_periods > steps:
            raise InputError(
                f"sensor delay_periods {sensors.delay_periods}; accepted: at most the"
                f" {steps} periods of an episode"
            )
        count, n = plant.batch.nsim, len(joints.names)
        rated = np.array([d.ratings.rated_torque for d in joints.drives])
        self.readout = Readout(sensors, count, rated, period, gauges=list(self.gauges))
        self.instant = np.zeros(count, dtype=np.intp)
        """Number of control periods since the start. Shape (n,)."""
        size = PlanSize(
            count=count,
            instants=steps + 1,
            joints=n,
            rows=plan_rows,
            channels=self.readout.channels,
            shared=shared,
        )
        self.plans = Plans(size, self.draw, self.sample)
        self._task: Task | None = None
        self.variations: list[tuple[Variation, ...]] = [(Variation(),) * n] * count
        """Deviations of every simulation's drives from the nominal ones."""
        self.observation_entries, self.action_entries = self.entries()
        self.action = np.zeros((count, sum(e.count for e in self.action_entries)))
        """Last action, clipped to -1 to 1 [-]. Shape (n, n_actions)."""
        self.motor_torque = np.zeros((count, n))
        """Last motor torque [N·m]. Shape (n, n_joints)."""
        self.output_torque = np.zeros((count, n))
        """Output torque of the drives [N·m]. Shape (n, n_joints)."""
        self._low, self._high = bounds(self.observation_entries)
        self.units = np.ones_like(self._high)
        """Units of the observation: powers of two, so that no bit is lost."""
        if normalise:
            self.units = np.exp2(np.ceil(np.log2(self._high)))

    @property
    def needs_arrays(self) -> bool:
        """Whether a single episode is computed with arrays, too."""
        return False

    @abstractmethod
    def entries(self) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
        """Entries of observation and action."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> tuple[Any, Array]:
        """Draw the coefficients of the plan of one episode, and compute the plan.

        Its rows are position, velocity, acceleration, load torque and known torque of
        the links, and further ones of some environments. The known torque is that of
        load, inertia and weight. Shape (steps + 1, n_rows, n_joints).
        """

    @abstractmethod
    def sample(self, drawn: Any, part: slice) -> Array:
        """Part of a plan. Shape (number of instants, n_rows, n_joints).

        Args:
            drawn: Coefficients of the plan.
            part: Range of the instants, from 0 to the number of control periods.
        """

    @abstractmethod
    def command(self, action: Array) -> Array:
        """Motor input for a clipped action [N·m]. Shape (n, n_joints)."""

    @abstractmethod
    def columns(self) -> list[Array]:
        """Parts of the observation. Shapes (n, 1) or (n, n_joints).

        Measured motor angles and speeds come first, :meth:`readings` come last.
        """

    @abstractmethod
    def reward(self) -> Array:
        """Reward of the last step [-]. Shape (n,)."""

    @abstractmethod
    def deviation(self) -> tuple[Array, Array]:
        """Squares of the error over its scale and of the effort [-]. Shapes (n,).

        The reward is 1/(1 + error) - effort_weight effort.
        """

    @abstractmethod
    def vary_load(self, index: int, shares: Array) -> None:
        """Change the load inertia of one simulation.

        Args:
            index: Index of the simulation.
            shares: Changes relative to the nominal inertia [-]. Shape (n_joints,).
        """

    def start_of(self, rows: Rows) -> tuple[Array, Array] | None:
        """Motor angles [rad] and drive torques [N·m] at the start of some episodes.

        None if they are those of the plant. Shapes (m, n_joints).
        """
        return None

    def restart(self, rows: Sequence[int], rngs: Sequence[np.random.Generator]) -> None:
        """Begin episodes of some simulations.

        Args:
            rows: Indices of the simulations.
            rngs: Random generators, one for each of them.
        """
        index, varied = np.asarray(rows, dtype=np.intp), None
        if self.plant.variable:
            varied = np.empty((len(rows), len(self.plant.drives), SIZE))
        for m, (k, rng) in enumerate(zip(rows, rngs, strict=True)):
            if self.tolerances is not None:
                drawn = [self.tolerances.draw(rng) for _ in self.plant.drives]
                self.vary_load(k, np.array([share for _, share in drawn]))
                if varied is not None:
                    self.variations[k] = specimens = tuple(v for v, _ in drawn)
                    varied[m] = [v.numbers for v in specimens]
            self.plans.begin(k, rng)
        # new arrays, because the arrays that the last step returned must not change
        self.output_torque = self.output_torque.copy()
        self.output_torque[index] = self.plant.place(
            index, varied, self.start_of(index)
        )
        self._task = None
        self.instant[index] = 0
        self.action = _without(self.action, index)
        self.motor_torque = _without(self.motor_torque, index)
        self._look(index)
        noise = self.plans.noise_at(self.instant[index], index)
        self.readout.start(index, self._true()[index], noise)
        self.judge()
        self.forget(index)

    def step(self, action: Array, active: NDArray[np.bool_] | None) -> None:
        """Take one control period.

        Args:
            action: Actions [-], which are clipped to -1 to 1. Shape (n, n_actions).
            active: Whether each episode continues; None: all do. Shape (n,).

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
        self.plans.move_to(self.instant)
        command = self.command(self.action)
        plant.step(command, self.now[:, 3], active)
        self.instant += 1 if active is None else active
        self._look()
        wanted = self.loop.torque(command, self.motor_angle, plant.motor_speed)
        self.motor_torque = np.clip(wanted, -limit, limit)
        self.output_torque = self.plant.output_torque()
        self.readout.read(self._true(), self.plans.noise_at(self._here))
        self.judge()
        self.remember()

    def feedforward(self, plan: Array) -> Array | None:
        """Feed-forward of the motor loops along plans [N·m]; None without such loops.

        Shape (...), for plans of shape (n_rows, ...).
        """
        return None

    def next_plan(self) -> Array:
        """Plan at the end of the next step. Shape (n, n_rows, n_joints)."""
        after = np.minimum(self.instant + 1, self.steps)
        return self.plans.plan_at(after)

    def _look(self, rows: Rows | None = None) -> None:
        """Read the state of the simulations, of which some may have restarted."""
        plant = self.plant
        self.motor_angle, self.link_angle = plant.motor_angle, plant.link_angle
        self._here = np.minimum(self.instant, self.steps)
        if rows is None or rows.size == self.instant.size:
            self.now = self.plans.plan_at(self._here)
            """Plan at the current instant. Shape (n, n_rows, n_joints)."""
        else:
            self.now = self.now.copy()
            self.now[rows] = self.plans.plan_at(self._here[rows], rows)

    def judge(self) -> None:
        """Set the quantities of reward and info that depend on the state alone."""
        self.link_error = self.link_angle - self.now[:, 0]
        """Link minus reference [rad]. Shape (n, n_joints)."""

    def remember(self) -> None:  # noqa: B027  (most have nothing to remember)
        """Update the history that reward and info need, after a step."""

    def forget(self, rows: Rows) -> None:  # noqa: B027
        """Reset this history at the start of episodes."""

    def _true(self) -> Array:
        parts = [self.motor_angle]
        if self.sensors.link_encoder:
            parts.append(self.link_angle)
        if self.sensors.torque_sensor:
            parts.append(self.output_torque)
        for j, gauges in self.gauges.items():
            true = self.output_torque, self.motor_angle, self.link_angle
            parts.append(gauges.read_torque(*(one[:, j : j + 1] for one in true)))
        return np.concatenate(parts, axis=1)

    def observation(self) -> Array:
        """Readings and known quantities, clipped to bounds. Shape (n, n_values)."""
        # one row per value, because numpy is slow along short rows
        values = np.concatenate([column.T for column in self.columns()])
        np.clip(values, self._low[:, None], self._high[:, None], out=values)
        values /= self.units[:, None]
        return values.T.copy()

    @property
    def observation_bounds(self) -> tuple[Array, Array]:
        """Bounds of the observation in its units. Shapes (n_values,)."""
        return self._low / self.units, self._high / self.units

    def readings(self) -> list[Array]:
        """Readings of link encoder, torque sensor and gauges, if any.

        Shapes (n, n_joints); that of gauges is (n, n_gauged).
        """
        n, value = len(self.joints.names), self.readout.value
        return [value[:, k : k + n] for k in range(n, value.shape[1], n)]

    def broken(self) -> NDArray[np.int64]:
        """Number of the exceeded limit, or 0. Shape (n,).

        See :data:`~swgjoint.envs.limits.LIMITS`.
        """
        limits, torque = self.limits, np.abs(self.output_torque)
        numbers = np.zeros(len(torque), dtype=np.int64)
        # NaN exceeds every limit; the last exceeded limit is reported
        for number, inside in (
            (1, np.abs(self.link_angle - limits.centre) <= limits.angle),
            (2, np.abs(self.plant.motor_speed) <= limits.motor_speed),
            (3, torque <= limits.momentary_peak),
            (4, torque <= limits.ratcheting),
        ):
            if not inside.all():
                numbers[~inside.all(axis=1)] = number
        return numbers

    @property
    def over(self) -> NDArray[np.bool_]:
        """Whether each episode has reached its full length. Shape (n,)."""
        return self.instant >= self.steps

    def info(self) -> dict[str, NDArray[Any]]:
        """True values without sensor errors; (n,) for one joint, else (n, n_joints)."""
        error = self.link_angle - self.motor_angle / self.plant.ratio
        values: dict[str, NDArray[Any]] = {
            "link_error_arcmin": self.link_error / arcmin,
            "transmission_error_arcmin": error / arcmin,
            "output_torque_Nm": self.output_torque,
            "motor_torque_Nm": self.motor_torque,
            "load_torque_Nm": self.now[:, 3],
            "link_angle_rad": self.link_angle,
            "motor_angle_rad": self.motor_angle,
        }
        if len(self.joints.names) == 1:
            values = {key: value[:, 0] for key, value in values.items()}
        return values | {"time_s": self.instant * self.period}

    @property
    def task(self) -> Task:
        """Motions of all episodes; the axis of episodes precedes that of joints."""
        if self._task is None:
            # (n_rows, steps + 1, n, n_joints); copied, as further episodes overwrite it
            plan = self.plans.whole_plans().transpose(2, 1, 0, 3).copy()
            age, loop = self.sensors.delay_periods * self.period, self.loop
            ahead = self.feedforward(plan)
            self._task = Task(
                period=self.period,
                position=plan[0],
                velocity=plan[1],
                acceleration=plan[2],
                link_torque=plan[4],
                joints=self.joints,
                reading_age=ReadingAge(motor=age, link=age, torque=age),
                loop=None
                if ahead is None
                else KnownLoop(
                    stiffness=loop.stiffness, damping=loop.damping, feedforward=ahead
                ),
            )
        return self._task

    def read_measurements(self, observation: Array) -> Measured:
        """Sensor readings in observations with any leading axes, for controllers."""
        observation = observation * self.units
        n, last = len(self.joints.names), observation.shape[-1]
        last -= len(self.gauges)
        torque = last - n if self.sensors.torque_sensor else None
        link = (torque or last) - n if self.sensors.link_encoder else None

        def part(first: int | None) -> Array | None:
            return None if first is None else observation[..., first : first + n]

        motor = Measured(
            motor_angle=observation[..., :n], motor_speed=observation[..., n : 2 * n]
        )
        return replace(motor, link_angle=part(link), output_torque=part(torque))


def _without(values: Array, rows: Rows) -> Array:
    """Copy with zeros in some rows."""
    copy = values.copy()
    copy[rows] = 0.0
    return copy

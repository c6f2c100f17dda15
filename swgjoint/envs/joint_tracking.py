"""One joint follows a reference under load; the action is its motor torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from swgjoint.envs.api import BatchEnv, SingleEnv
from swgjoint.envs.arguments import format_value
from swgjoint.envs.bench import BenchCore, BenchSettings
from swgjoint.envs.entries import Entry, ceiling
from swgjoint.envs.one_joint import JointEpisode
from swgjoint.envs.references import (
    KINDS,
    QUICKEST,
    DrawnMotion,
    Instants,
    Motion,
    draw_motion,
    smooth_step,
)
from swgjoint.errors import InputError
from swgjoint.kernels import kernels
from swgjoint.typing import Array
from swgjoint.units import arcmin

Values = TypeVar("Values", float, Array)
"""One number, or an array with one value for each episode."""
LOAD_RAMP = 0.3
"""Time over which the load grows [s]."""
MOTION_START = 0.1
"""Rest before the motion [s]."""


@dataclass(frozen=True, kw_only=True)
class TrackingSettings(BenchSettings):
    """Arguments of ``JointTracking-v0``, see :class:`JointTrackingEnv`."""

    reference: str | tuple[str, ...] = tuple(KINDS)
    """One or several names in :data:`~swgjoint.envs.references.KINDS`."""
    error_scale_arcmin: float = 3.0
    """Error scale of the reward [arcmin]."""
    effort_weight: float = 0.1
    """Effort weight of the reward [-]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check("error_scale_arcmin", "arcmin", zero=False)
        self._check("effort_weight", "", zero=True)
        several = isinstance(self.reference, tuple | list) and self.reference
        names = self.reference if several else [self.reference]
        for one in names:
            if not (isinstance(one, str) and one in KINDS):
                raise InputError(
                    f"reference {format_value(one)}; accepted: one or several of"
                    f" {', '.join(KINDS)}"
                )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of references, of which each episode draws one."""
        names = self.reference
        return (names,) if isinstance(names, str) else tuple(names)

    @property
    def max_acceleration(self) -> float:
        """Largest acceleration of references [rad/s²]."""
        return self.max_speed_rad_s / QUICKEST


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnTracking:
    """Coefficients of the plan of one episode."""

    motion: DrawnMotion
    """Motion of the link."""
    load: float
    """Load torque after its growth [N·m]."""


class TrackingCore(BenchCore):
    """Episodes of ``JointTracking-v0``."""

    settings: TrackingSettings

    def __init__(self, count: int, threads: int, settings: TrackingSettings) -> None:
        """Build the model once, then ``count`` simulations of it.

        Args:
            count: Number of episodes.
            threads: Number of engine threads; 0: one per core.
            settings: Arguments of the environment.
        """
        time = np.asarray(np.arange(settings.steps + 1) * settings.period_s, float)
        self._start = int(np.searchsorted(time, MOTION_START))
        self._instants = Instants(time[: time.size - self._start])
        self._load = smooth_step(time, LOAD_RAMP)[0]
        super().__init__(count, threads, settings)

    def entries(self) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
        """Entries of observation and action."""
        s, joint = self.settings, self.joint
        angle, speed = self.motor_entries()
        reach, bend = ceiling(s.max_angle_rad), ceiling(s.max_acceleration)
        load = ceiling(max(s.load_of_rated, 0.01) * joint.drive.ratings.rated_torque)

        def known(what: str, unit: str, top: float) -> Entry:
            return Entry(meaning=what, unit=unit, low=-top, high=top)

        share = known("motor torque relative to its limit", "1", 1.0)
        return (
            angle,
            speed,
            *self.error_entries(s.max_acceleration),
            known("reference angle of the link", "rad", reach),
            known("reference speed of the link", "rad/s", ceiling(s.max_speed_rad_s)),
            known("reference acceleration of the link", "rad/s^2", bend),
            known("load torque against the link", "N·m", load),
            known("last action", "1", 1.0),
            *self.sensor_entries(),
        ), (share,)

    def draw(self, rng: np.random.Generator) -> tuple[DrawnTracking, Array]:
        """Draw a reference of one of the kinds and a load that grows to its value."""
        s = self.settings
        motion, values = draw_motion(
            self._instants,
            rng,
            kinds=s.kinds,
            max_speed=s.max_speed_rad_s,
            max_angle=s.max_angle_rad,
            max_acceleration=s.max_acceleration,
        )
        rated = self.joint.drive.ratings.rated_torque
        top = float(rng.uniform(-1.0, 1.0)) * s.load_of_rated * rated
        drawn = DrawnTracking(motion=motion, load=top)
        return drawn, self._plan(drawn, values, slice(0, s.steps + 1))

    def sample(self, drawn: DrawnTracking, part: slice) -> Array:
        """Part of a plan.

        Args:
            drawn: Coefficients of the plan.
            part: Range of the instants.
        """
        moving = slice(*(max(k - self._start, 0) for k in (part.start, part.stop)))
        values = drawn.motion.sample(self._instants, moving)
        return self._plan(drawn, values, part)

    def _plan(self, drawn: DrawnTracking, values: Motion, part: slice) -> Array:
        """Plan with the values of the motion at those instants that it covers."""
        if (native := kernels()) is not None:
            plan = np.empty((part.stop - part.start, 5))
            ramp, inertia = self._load[part], self.settings.link_inertia
            native.write_plan(*values, drawn.load, ramp, inertia, plan)
            return plan[:, :, None]
        plan = np.zeros((part.stop - part.start, 5))
        first = len(plan) - values[0].size
        for column, one in enumerate(values):
            plan[first:, column] = one
        plan[:, 3] = drawn.load * self._load[part]
        plan[:, 4] = plan[:, 3] + self.settings.link_inertia * plan[:, 2]
        return plan[:, :, None]

    def command(self, action: Array) -> Array:
        """Motor torques: the action times the torque limit [N·m]. Shape (n, 1)."""
        return np.asarray(action * self.limits.motor_torque)

    def columns(self) -> list[Array]:
        """Parts of the observation in the order of its table."""
        read, ratio, now = self.readout, self.joint.ratio, self.now
        angle, speed = read.value[:, :1], read.motor_speed
        return [
            angle,
            speed,
            ratio * now[:, 0] - angle,
            ratio * now[:, 1] - speed,
            now[:, 0],
            now[:, 1],
            now[:, 2],
            now[:, 3],
            self.action,
            *self.readings(),
        ]

    @property
    def authority(self) -> Array:
        """Motor torques at an action of 1 [N·m]. Shape (1,)."""
        return self.limits.motor_torque

    def deviation(self) -> tuple[Array, Array]:
        """Squares of link error over its scale and of motor torque over its limit."""
        effort = self.motor_torque[:, 0] / self.limits.motor_torque[0]
        return _deviation(self.settings, self.link_error[:, 0], effort)

    def reward(self) -> Array:
        """Reward as :class:`JointTrackingEnv` defines it."""
        error, effort = self.deviation()
        return np.asarray(1.0 / (1.0 + error) - self.settings.effort_weight * effort)


def _deviation(
    s: TrackingSettings, link_error: Values, effort: Values
) -> tuple[Values, Values]:
    """Squares of link errors [rad] over their scale and of efforts [-]."""
    error = link_error / (s.error_scale_arcmin * arcmin)
    return error * error, effort * effort


class TrackingEpisode(JointEpisode):
    """The only episode of a :class:`TrackingCore`."""

    core_of = TrackingCore
    core: TrackingCore

    def command(self, action: float) -> float:
        """Motor torque: the action times the torque limit [N·m]."""
        return action * self.limit

    def columns(self) -> list[float]:
        """Parts of the observation in the order of its table."""
        angle, speed, ratio = self.readings[0], self.measured_speed, self.ratio
        q, v, a, load, _ = self.now
        errors = ratio * q - angle, ratio * v - speed
        return [angle, speed, *errors, q, v, a, load, self.action]

    def reward(self) -> float:
        """Reward as :class:`JointTrackingEnv` defines it."""
        s, effort = self.core.settings, self.motor_torque / self.limit
        error, effort = _deviation(s, self.link_error, effort)
        return 1.0 / (1.0 + error) - s.effort_weight * effort


class JointTrackingEnv(SingleEnv):
    """A joint with a strain wave gear follows a smooth reference under load.

    The joint consists of a motor, a drive and a load that turns about a vertical axis.
    The stiffness of the drive increases with torque, and its kinematic error has 2 and
    4 cycles per turn of the wave generator. Hysteresis and friction are those of its
    map. The whole reference is known from the start of an episode as ``task``.

    The action is constant over one control period:

    =====  ==================================  ====  =======
    index  meaning                             unit  range
    =====  ==================================  ====  =======
    0      motor torque relative to its limit  1     -1 to 1
    =====  ==================================  ====  =======

    Observation with the default arguments; entries 9 and 10 exist only with
    ``sensors={"link_encoder": True, "torque_sensor": True}``, the last one only with
    ``gauges={"flexspline": "size-25-100", "position_mm": 13.0, "strain": "outline"}``:

    =====  =====================================  =======  ===========
    index  meaning                                unit     range
    =====  =====================================  =======  ===========
    0      measured motor angle                   rad      -310 to 310
    1      measured motor speed                   rad/s    -180 to 180
    2      motor angle error                      rad      -1.6 to 1.6
    3      motor speed error                      rad/s    -23 to 23
    4      reference angle of the link            rad      -1 to 1
    5      reference speed of the link            rad/s    -0.6 to 0.6
    6      reference acceleration of the link     rad/s^2  -50 to 50
    7      load torque against the link           N·m      -44 to 44
    8      last action                            1        -1 to 1
    9      measured link angle                    rad      -3.1 to 3.1
    10     measured output torque                 N·m      -410 to 410
    11     output torque that strain gauges read  N·m      -470 to 470
    =====  =====================================  =======  ===========

    The measured speed is the change of the angle reading over the last control period
    divided by that period. The errors 2 and 3 are ratio times reference of the link
    minus measured value. Their ranges correspond to a link error of 50 arcmin and to a
    change of 50 arcmin in 0.1 s, plus the change of the reference during the age of a
    reading. Larger errors are clipped. Readings have resolution, noise and delay, see
    :class:`swgjoint.envs.sensors.Sensors`.

    The reward of a step depends on the error e of the true link angle at its end and on
    the motor torque u relative to its limit:

        1/(1 + (e/error_scale)^2) - effort_weight u^2

    An episode starts with the motor at rest at angle 0 and without load. The load grows
    during the first 0.3 s, and the motion begins at 0.1 s. The episode is ``truncated``
    after ``episode_s`` and ``terminated`` when a limit is exceeded.
    ``info["broken_limit"]`` is then the number of the limit in
    :data:`swgjoint.envs.limits.LIMITS`: link angle (1 rad + 2 ``max_angle_rad``), motor
    speed (twice that of the fastest reference), or drive torque (momentary peak torque
    or ratcheting torque).

    ``info`` contains true values: ``link_error_arcmin``, ``transmission_error_arcmin``
    (output minus input/ratio), ``output_torque_Nm`` (of the drive on the link, mean
    over the last simulation step), ``motor_torque_Nm``, ``load_torque_Nm``,
    ``link_angle_rad``, ``motor_angle_rad``, ``time_s`` and ``broken_limit``.

    Args (all by keyword):
        drive: Catalogue name, map file, design or DriveMap. Default: ``CSG-25-100``.
        level: ``full``, or ``linear`` for one constant spring. Default: ``full``.
        rotor_inertia_kgm2: Inertia of motor rotor and wave generator about the motor
            axis [kg·m²]. Default: 1e-4.
        load_inertia_kgm2: Inertia of the load about the joint [kg·m²]. Default: 1.0.
        payload_kg: Payload at the end of the 0.5 m bar [kg]. Default: 0.
        friction: Whether the drive has the friction of its map. Default: True.
        kinematic_error_arcmin: Peak-to-peak kinematic error over one output turn
            [arcmin], for a drive whose map has none. Default: None, which uses the
            transmission accuracy of the catalogue for a catalogue name and leaves other
            drives unchanged.
        torque_limit_Nm: Torque limit of the motor [N·m]. Default: None, which uses the
            repeated peak torque over the ratio.
        max_speed_rad_s: Largest link speed of references [rad/s]. Their largest
            acceleration is this speed divided by 12 ms. Default: 0.6.
        max_angle_rad: Largest link angle of references [rad]. Default: 1.0.
        period_s: Control period [s], up to 0.05. The simulation step is the control
            period, or an integer fraction of it if the drive is too stiff for such a
            step. Default: 1e-3.
        episode_s: Duration of an episode [s]. Default: 2.0.
        load_of_rated: Largest load torque relative to rated torque [-]. Default: 0.5.
        sensors: Mapping with fields of :class:`~swgjoint.envs.sensors.Sensors`.
            Default: None, which uses the defaults of these fields.
        gauges: Mapping with keys of ``[joints.NAME.gauges]`` of a scene: strain gauges
            on the flexspline of the nominal drive, which read the output torque and the
            ripple of the wave generator (:mod:`swgjoint.gear.gauges`). The noise is
            that of the torque sensor. Default: None, no gauges.
        randomise: True, or a mapping with fields of
            :class:`~swgjoint.envs.specimen.SpecimenTolerances`, draws a new drive and
            load inertia for every episode, while ``task`` keeps the nominal ones. With
            level ``linear``, True varies only the load inertia, and tolerances of the
            drive are rejected. Default: False.
        normalise: Whether observations are divided by ``env.unwrapped.core.units``, the
            powers of two next to their bounds, so that they lie between -1 and 1 and
            lose no bit. ``read_measurements`` gives SI units in any case. With False,
            observations have the units of the table. Default: True.
        reference: One or several of ``sinusoid``, ``multisine``, ``point_to_point``.
            Default: all three.
        error_scale_arcmin: Error scale of the reward [arcmin]. Default: 3.
        effort_weight: Effort weight of the reward [-]. Default: 0.1.

    Version: v0.
    """

    core_of = TrackingCore
    episode_of = TrackingEpisode
    settings_type = TrackingSettings


class JointTrackingVectorEnv(BatchEnv):
    """Many episodes of :class:`JointTrackingEnv` on the threads of the engine.

    ``gymnasium.make_vec("swgjoint/JointTracking-v0", num_envs=256)`` creates it. The
    argument ``threads`` is the number of engine threads; 0 uses one per core.
    """

    single = JointTrackingEnv

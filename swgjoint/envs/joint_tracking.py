"""One joint follows a reference under load, by the torque of its motor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.envs.api import BatchEnv, SingleEnv
from swgjoint.envs.arguments import format_value
from swgjoint.envs.bench import BenchCore, BenchSettings
from swgjoint.envs.core import Entry, ceiling
from swgjoint.envs.references import KINDS, draw_motion, smooth_step
from swgjoint.errors import InputError
from swgjoint.typing import Array
from swgjoint.units import arcmin

LOAD_RAMP = 0.3
"""Time over which the load grows [s]."""
MOTION_START = 0.1
"""Rest before the motion [s]."""
SHORTEST = 0.012
"""In which the fastest reference would reach its speed at its largest acceleration [s]:
only moves of episodes below 0.7 s would be shorter."""


@dataclass(frozen=True, kw_only=True)
class TrackingSettings(BenchSettings):
    """Arguments of ``JointTracking-v0``."""

    reference: str | tuple[str, ...] = tuple(KINDS)
    error_scale_arcmin: float = 3.0
    effort_weight: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check("error_scale_arcmin", "arcmin", zero=False)
        self._check("effort_weight", "", zero=True)
        several = isinstance(self.reference, tuple | list) and self.reference
        given = self.reference if several else [self.reference]
        for one in given:
            if not (isinstance(one, str) and one in KINDS):
                raise InputError(
                    f"reference {format_value(one)}; accepted: one or several of"
                    f" {', '.join(KINDS)}"
                )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of references that are drawn."""
        given = self.reference
        return (given,) if isinstance(given, str) else tuple(given)

    @property
    def max_acceleration(self) -> float:
        """Largest acceleration of references [rad/s²]."""
        return self.max_speed_rad_s / SHORTEST


class TrackingCore(BenchCore):
    """Episodes of ``JointTracking-v0``."""

    settings: TrackingSettings

    def entries(self) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
        """Entries of observation and action."""
        s, joint = self.settings, self.joint
        angle, speed = self.motor_entries()
        reach, bend = ceiling(s.max_angle_rad), ceiling(s.max_acceleration)
        load = ceiling(max(s.load_of_rated, 0.01) * joint.drive.ratings.rated_torque)

        def known(what: str, unit: str, top: float) -> Entry:
            return Entry(meaning=what, unit=unit, low=-top, high=top)

        share = known("motor torque, of its limit", "1", 1.0)
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

    def draw(self, rng: np.random.Generator) -> Array:
        """A reference of one of the kinds, and a load that grows to its value."""
        s = self.settings
        time = np.asarray(np.arange(s.steps + 1) * s.period_s, float)
        start = int(np.searchsorted(time, MOTION_START))
        motion = np.zeros((3, s.steps + 1))
        motion[:, start:] = draw_motion(
            time[: time.size - start],
            rng,
            kinds=s.kinds,
            max_speed=s.max_speed_rad_s,
            max_angle=s.max_angle_rad,
            max_acceleration=s.max_acceleration,
        )
        rated = self.joint.drive.ratings.rated_torque
        top = float(rng.uniform(-1.0, 1.0)) * s.load_of_rated * rated
        load = top * smooth_step(time, LOAD_RAMP)[0]
        known = load + s.link_inertia * motion[2]
        return np.stack([*motion, load, known], axis=1)[:, :, None]

    def command(self, action: Array) -> Array:
        """The share of the limit."""
        return np.asarray(action * self.limits.motor_torque)

    def columns(self) -> list[Array]:
        """See the table of :class:`JointTrackingEnv`."""
        read, ratio, now = self._readout, self.joint.ratio, self.now
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

    def reward(self) -> Array:
        """See :class:`JointTrackingEnv`."""
        s = self.settings
        error = self.link_error[:, 0] / (s.error_scale_arcmin * arcmin)
        effort = self.motor_torque[:, 0] / self.limits.motor_torque[0]
        return np.asarray(
            1.0 / (1.0 + error * error) - s.effort_weight * (effort * effort)
        )


class JointTrackingEnv(SingleEnv):
    """A joint with a strain wave gear follows a smooth reference under load.

    The bench joint: motor and wave generator, the drive, a load about a vertical axis.
    The drive has what real ones have: stiffness that grows with torque, kinematic error
    at 2 and 4 cycles per turn of the wave generator, hysteresis and friction where its
    map has them. The reference is known at the start of an episode, as ``task``.

    Action, held over one control period:

    =====  ==========================  ====  =======
    index  meaning                     unit  range
    =====  ==========================  ====  =======
    0      motor torque, of its limit  1     -1 to 1
    =====  ==========================  ====  =======

    Observation; the last two entries only with ``sensors={"link_encoder": True,
    "torque_sensor": True}``:

    =====  =====================================  =======  ===========
    index  meaning                                unit     range
    =====  =====================================  =======  ===========
    0      motor angle, read                      rad      -310 to 310
    1      motor speed, change of the reading     rad/s    -180 to 180
    2      motor angle, ratio * reference - read  rad      -1.6 to 1.6
    3      motor speed, ratio * reference - read  rad/s    -23 to 23
    4      reference angle of the link            rad      -1 to 1
    5      reference speed of the link            rad/s    -0.6 to 0.6
    6      reference acceleration of the link     rad/s^2  -50 to 50
    7      load torque against the link           N·m      -44 to 44
    8      last action                            1        -1 to 1
    9      link angle, read                       rad      -3.1 to 3.1
    10     output torque, read                    N·m      -410 to 410
    =====  =====================================  =======  ===========

    The tracking errors, 2 and 3, end at 50 arcmin of the link and at that in 0.1 s, and
    what the reference does in the age of a reading; beyond they stay there. Readings
    have resolution, noise and delay, see
    :class:`swgjoint.envs.sensors.Sensors`; ranges depend on the arguments, those above
    belong to the default ones.

    Reward of a step, with the error e of the true link angle at its end and the motor
    torque u as part of its limit:

        1/(1 + (e/error_scale)^2) - effort_weight u^2

    Start: motor at rest at 0, no load; the load grows over 0.3 s, the motion begins
    at 0.1 s. ``truncated`` after ``episode_s``. ``terminated`` when a limit is broken,
    which ``info["broken_limit"]`` names by its number in
    :data:`swgjoint.envs.core.LIMITS`: angle of the link (1 + 2 max_angle), motor speed
    (twice that of the fastest reference), torque of the drive beyond its momentary peak
    or that at which it ratchets.

    ``info`` holds true values: ``link_error_arcmin``, ``transmission_error_arcmin``
    (output minus input/ratio), ``output_torque_Nm`` (of the drive on the link, mean of
    the engine's last step), ``motor_torque_Nm``, ``load_torque_Nm``,
    ``link_angle_rad``, ``motor_angle_rad``, ``time_s``, ``broken_limit``.

    Args (all by keyword):
        drive: Catalogue name, map file, design or DriveMap; ``CSG-25-100``.
        level: ``full`` or ``linear``, one constant spring.
        rotor_inertia_kgm2: Motor rotor and wave generator; 1e-4.
        load_inertia_kgm2: About the joint; 1.0.
        payload_kg: At the end of the 0.5 m bar; 0.
        friction: Whether the drive has the friction of its map; True.
        kinematic_error_arcmin: Peak to peak over one output turn, for a drive without
            error of its own; None takes the transmission accuracy that the catalogue
            states, for a catalogue name, and leaves others as they are.
        torque_limit_Nm: Of the motor; None: repeated peak torque over the ratio.
        max_speed_rad_s: Of references, at the link; 0.6. Their acceleration is at most
            that speed in 12 ms.
        max_angle_rad: Of references; 1.0.
        period_s: Of the control, up to 0.05; 1e-3. The engine steps as often, or, where
            the drive is too stiff for that, in equal parts of it.
        episode_s: 2.0.
        load_of_rated: Largest load torque, as part of the rated torque; 0.5.
        sensors: Mapping with fields of :class:`~swgjoint.envs.sensors.Sensors`.
        randomise: True, or a mapping with fields of
            :class:`~swgjoint.envs.specimen.SpecimenTolerances`: every episode has a
            drive and a load of its own. ``task`` keeps the nominal ones. At ``linear``
            True draws the load's inertia alone, and tolerances of the drive are
            refused. False.
        reference: One or several of ``sinusoid``, ``multisine``, ``point_to_point``.
        error_scale_arcmin: Of the reward; 3.
        effort_weight: Of the reward; 0.1.

    Versions: v0, the first.
    """

    core_of = TrackingCore
    settings_type = TrackingSettings


class JointTrackingVectorEnv(BatchEnv):
    """Many episodes of :class:`JointTrackingEnv` on the threads of the engine.

    ``gymnasium.make_vec("swgjoint/JointTracking-v0", num_envs=256)``; ``threads`` of
    the engine, 0 for one per core.
    """

    single = JointTrackingEnv

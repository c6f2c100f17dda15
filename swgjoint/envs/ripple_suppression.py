"""Constant speed under load: a torque added to the motor loop removes the ripple."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.envs.api import BatchEnv, SingleEnv
from swgjoint.envs.bench import BenchCore, BenchSettings
from swgjoint.envs.core import Entry, Rows, ceiling
from swgjoint.envs.references import smooth_step
from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.typing import Array
from swgjoint.units import arcmin

RAMP = 0.5
"""Time in which speed and load grow; then the motion is steady [s]."""
STEEPEST = 2.5
"""Largest slope of :func:`~swgjoint.envs.references.smooth_step` over its mean, 2.46,
rounded up."""
SETTLE = 1.0
"""Time after that until the reward counts the motion [s]."""
MEMORY = 0.15
"""Time constant of the mean that is taken out of errors [s]."""


@dataclass(frozen=True, kw_only=True)
class RippleSettings(BenchSettings):
    """Arguments of ``RippleSuppression-v0``."""

    max_angle_rad: float = 3.0
    episode_s: float = 4.0
    slowest: float = 0.3
    authority_of_rated: float = 0.2
    loop_Hz: float = 8.0
    loop_damping_ratio: float = 1.0
    ripple_scale_of_rated: float = 0.01
    error_scale_arcmin: float = 0.1
    effort_weight: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, unit in (
            ("slowest", ""),
            ("authority_of_rated", ""),
            ("loop_Hz", "Hz"),
            ("loop_damping_ratio", ""),
            ("ripple_scale_of_rated", ""),
            ("error_scale_arcmin", "arcmin"),
        ):
            self._check(key, unit, zero=False)
        self._check("effort_weight", "", zero=True)
        if self.slowest > 1.0:
            raise InputError(f"slowest {self.slowest}; accepted: > 0 to 1")
        if self.episode_s <= RAMP + SETTLE:
            raise InputError(
                f"episode_s {self.episode_s} s; accepted: above {RAMP + SETTLE:g} s,"
                " from which on the motion counts"
            )
        way = self.max_speed_rad_s * self.episode_s
        if way > self.max_angle_rad:
            raise InputError(
                f"max_angle_rad {self.max_angle_rad} rad; needed: at least {way:g} rad,"
                " max_speed_rad_s * episode_s"
            )


class RippleCore(BenchCore):
    """Episodes of ``RippleSuppression-v0``."""

    settings: RippleSettings

    def __init__(self, count: int, threads: int, settings: RippleSettings) -> None:
        """See :class:`RippleSuppressionEnv`."""
        s = settings
        super().__init__(
            count,
            threads,
            s,
            loop_Hz=s.loop_Hz,
            loop_damping_ratio=s.loop_damping_ratio,
        )
        rated = self.joint.drive.ratings.rated_torque
        self._authority = s.authority_of_rated * rated / abs(self.joint.ratio)
        self._ripple_scale = s.ripple_scale_of_rated * rated
        self._alpha = angle_coefficients(self.joint.drive.layout)[0]
        self._mean = np.zeros((2, count))
        self._first = round((RAMP + SETTLE) / s.period_s)

    def entries(self) -> tuple[tuple[Entry, ...], tuple[Entry, ...]]:
        """Entries of observation and action."""
        s = self.settings
        angle, speed = self.motor_entries()
        rated = self.joint.drive.ratings.rated_torque
        load = ceiling(max(s.load_of_rated, 0.01) * rated)

        def known(what: str, unit: str, top: float) -> Entry:
            return Entry(meaning=what, unit=unit, low=-top, high=top)

        return (
            angle,
            speed,
            *self.error_entries(STEEPEST * s.max_speed_rad_s / RAMP),
            known("sine of the wave generator's angle, read", "1", 1.0),
            known("cosine of the wave generator's angle, read", "1", 1.0),
            known("reference speed of the link", "rad/s", ceiling(s.max_speed_rad_s)),
            known("load torque against the link", "N·m", load),
            known("last action", "1", 1.0),
            *self.sensor_entries(),
        ), (known("added motor torque, of its authority", "1", 1.0),)

    def draw(self, rng: np.random.Generator) -> Array:
        """Speed and load, each either way, that grow and then stay."""
        s = self.settings
        time = np.asarray(np.arange(s.steps + 1) * s.period_s, float)
        share = rng.uniform(s.slowest, 1.0) * rng.choice([-1.0, 1.0])
        top = rng.uniform(-1.0, 1.0) * s.load_of_rated
        rated = self.joint.drive.ratings.rated_torque
        up, bend, _ = smooth_step(time, RAMP)
        speed = float(share) * s.max_speed_rad_s
        velocity, acceleration = speed * up, speed * bend
        # the integral of the step, by its own symmetry 1/2 over the ramp; Simpson's
        # rule on the grid is far below a count of any encoder
        middle = smooth_step(time[:-1] + 0.5 * s.period_s, RAMP)[0]
        parts = s.period_s / 6.0 * speed * (up[:-1] + 4.0 * middle + up[1:])
        position = np.concatenate([[0.0], np.cumsum(parts)])
        load = float(top) * rated * up
        known = load + s.link_inertia * acceleration
        plan = np.stack([position, velocity, acceleration, load, known], axis=1)
        return plan[:, :, None]

    def command(self, action: Array) -> Array:
        """The reference of the loop, known torques and a share of the authority."""
        plan, ratio = self.next_plan(), self.joint.ratio
        rotor = self.settings.rotor_inertia_kgm2
        known = plan[:, 4] / ratio + ratio * rotor * plan[:, 2]
        own = self.loop.command(plan[:, 0], plan[:, 1])
        return np.asarray(own + known + action * self._authority)

    def columns(self) -> list[Array]:
        """See the table of :class:`RippleSuppressionEnv`."""
        read, ratio, now = self._readout, self.joint.ratio, self.now
        angle, speed = read.value[:, :1].copy(), read.motor_speed
        by_theta, by_psi = self._alpha
        alpha = by_theta * angle + by_psi * (angle / ratio)
        return [
            angle,
            speed,
            ratio * now[:, 0] - angle,
            ratio * now[:, 1] - speed,
            np.sin(alpha),
            np.cos(alpha),
            now[:, 1],
            now[:, 3],
            self.action,
            *self.readings(),
        ]

    def judge(self) -> None:
        """Ripple of the torque; errors that have a mean."""
        super().judge()
        now, inertia = self.now[:, :, 0], self.settings.link_inertia
        self.ripple = self.output_torque[:, 0] - now[:, 3] - inertia * now[:, 2]
        turned = self.motor_angle[:, 0] / self.joint.ratio
        error = self.link_angle[:, 0] - turned
        self._errors = np.stack([self.link_error[:, 0], error])

    def remember(self) -> None:
        """Follow the means of the errors."""
        share = self.period / MEMORY
        self._mean = self._mean + share * (self._errors - self._mean)
        self.link_ripple, self.error_ripple = self._errors - self._mean

    def forget(self, rows: Rows) -> None:
        """Begin with what the errors are."""
        self._mean = self._mean.copy()
        self._mean[:, rows] = self._errors[:, rows]
        self.link_ripple, self.error_ripple = self._errors - self._mean

    def reward(self) -> Array:
        """See :class:`RippleSuppressionEnv`."""
        s = self.settings
        a = self.ripple / self._ripple_scale
        b = self.link_ripple / (s.error_scale_arcmin * arcmin)
        effort = self.action[:, 0]
        got = 1.0 / (1.0 + a * a + b * b) - s.effort_weight * (effort * effort)
        return np.where(self.instant > self._first, got, 0.0)

    def info(self) -> dict[str, NDArray[Any]]:
        """With ripple of torque, link and transmission error, and whether it counts."""
        return super().info() | {
            "torque_ripple_Nm": self.ripple,
            "link_error_ripple_arcmin": self.link_ripple / arcmin,
            "transmission_error_ripple_arcmin": self.error_ripple / arcmin,
            "steady": self.instant > self._first,
        }


class RippleSuppressionEnv(SingleEnv):
    """A joint turns at constant speed under load; torque is added to its motor's loop.

    The loop is the servo drive's own (:class:`swgjoint.envs.loop.MotorLoop`): PD on the
    motor's angle, ``loop_Hz`` and ``loop_damping_ratio`` for motor and link on a rigid
    drive, load and acceleration fed forward. Kinematic error and the torque that goes
    with it come at even orders of the wave generator's angle, of which the observation
    has sine and cosine.

    Action, held over one control period; the authority is ``authority_of_rated`` times
    rated torque over ratio:

    =====  ====================================  ====  =======
    index  meaning                               unit  range
    =====  ====================================  ====  =======
    0      added motor torque, of its authority  1     -1 to 1
    =====  ====================================  ====  =======

    Observation; the last two entries only with ``sensors={"link_encoder": True,
    "torque_sensor": True}``:

    =====  ==========================================  =====  ===========
    index  meaning                                     unit   range
    =====  ==========================================  =====  ===========
    0      motor angle, read                           rad    -710 to 710
    1      motor speed, change of the reading          rad/s  -180 to 180
    2      motor angle, ratio * reference - read       rad    -1.6 to 1.6
    3      motor speed, ratio * reference - read       rad/s  -15 to 15
    4      sine of the wave generator's angle, read    1      -1 to 1
    5      cosine of the wave generator's angle, read  1      -1 to 1
    6      reference speed of the link                 rad/s  -0.6 to 0.6
    7      load torque against the link                N·m    -44 to 44
    8      last action                                 1      -1 to 1
    9      link angle, read                            rad    -7.1 to 7.1
    10     output torque, read                         N·m    -410 to 410
    =====  ==========================================  =====  ===========

    Ranges of the tracking errors as in
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`.

    Reward of a step, from 1.5 s on (before: 0), with the ripple r of the torque, that
    of the drive less load and inertia of the link on the reference, the error e of the
    link less its running mean (time constant 0.15 s), and the action a:

        1/(1 + (r/ripple_scale)^2 + (e/error_scale)^2) - effort_weight a^2

    Start: motor at rest at 0, no load; speed and load, drawn in size and sign, grow
    over 0.5 s. ``truncated`` after ``episode_s``; ``terminated`` as in
    :class:`~swgjoint.envs.joint_tracking.JointTrackingEnv`, whose ``info`` and whose
    arguments of bench, drive, sensors and ``randomise`` are those of this one, too.
    ``info`` also has ``torque_ripple_Nm``, ``link_error_ripple_arcmin`` and
    ``transmission_error_ripple_arcmin``, both less their running means, and ``steady``,
    whether the reward counts. As long as the motor turns evenly the two are one; an
    added torque that evens the motion of the link takes the first away and leaves the
    second, for the motor then runs against the kinematic error.

    Further args:
        max_angle_rad: At least the way of the fastest motion; 3.
        episode_s: 4.
        slowest: Share of ``max_speed_rad_s`` of the slowest motion; 0.3.
        authority_of_rated: 0.2.
        loop_Hz: 8.
        loop_damping_ratio: 1.
        ripple_scale_of_rated: Of the reward; 0.01.
        error_scale_arcmin: Of the reward; 0.1.
        effort_weight: Of the reward; 0.1.

    Versions: v0, the first.
    """

    core_of = RippleCore
    settings_type = RippleSettings


class RippleSuppressionVectorEnv(BatchEnv):
    """Many episodes of :class:`RippleSuppressionEnv` on the threads of the engine."""

    single = RippleSuppressionEnv

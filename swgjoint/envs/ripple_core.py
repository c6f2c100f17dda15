"""Episodes of a joint that turns at constant speed under load."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.control.error_compensation import ORDERS
from swgjoint.envs.arguments import check_flag
from swgjoint.envs.bench import BenchCore, BenchSettings
from swgjoint.envs.core import Rows
from swgjoint.envs.entries import Entry, ceiling
from swgjoint.envs.identification import KinematicErrorEstimate
from swgjoint.envs.one_joint import JointEpisode
from swgjoint.envs.references import smooth_step
from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.maps.fit.error_spectrum import peak_to_peak
from swgjoint.sim.controller import Measured
from swgjoint.typing import Array
from swgjoint.units import arcmin

RAMP = 0.5
"""Time over which speed and load grow to constant values [s]."""
STEEPEST = 2.5
"""Ratio of the largest to the mean slope of
:func:`~swgjoint.envs.references.smooth_step`, 2.46, rounded up [-]."""
SETTLE = 1.0
"""Settling time between the ramp and the first step with a reward [s]."""
MEMORY = 0.15
"""Time constant of the running means that are subtracted from the errors [s]."""


@dataclass(frozen=True, kw_only=True)
class RippleSettings(BenchSettings):
    """Arguments of ``RippleSuppression-v0``, see :class:`RippleSuppressionEnv`."""

    max_angle_rad: float = 3.0
    """Largest link angle of references [rad]."""
    episode_s: float = 4.0
    """Duration of an episode [s]."""
    slowest: float = 0.3
    """Smallest speed relative to ``max_speed_rad_s`` [-]."""
    authority_of_rated: float = 0.2
    """Largest added motor torque relative to rated torque over ratio [-]."""
    loop_Hz: float = 8.0
    """Natural frequency of the motor loop [Hz]."""
    loop_damping_ratio: float = 1.0
    """Damping ratio of the motor loop [-]."""
    ripple_scale_of_rated: float = 0.01
    """Ripple scale of the reward relative to rated torque [-]."""
    error_scale_arcmin: float = 0.1
    """Error scale of the reward [arcmin]."""
    effort_weight: float = 0.1
    """Effort weight of the reward [-]."""
    identify: bool = False
    """Whether estimates of the kinematic error are observed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flag("identify", self.identify)
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
            raise InputError(f"slowest {self.slowest}; accepted: > 0 and <= 1")
        if self.episode_s <= RAMP + SETTLE:
            raise InputError(
                f"episode_s {self.episode_s} s; accepted: > {RAMP + SETTLE:g} s, the"
                " time before the reward counts"
            )
        way = self.max_speed_rad_s * self.episode_s
        if way > self.max_angle_rad:
            raise InputError(
                f"max_angle_rad {self.max_angle_rad} rad; accepted: at least {way:g}"
                " rad, max_speed_rad_s * episode_s"
            )


class RippleCore(BenchCore):
    """Episodes of ``RippleSuppression-v0``."""

    settings: RippleSettings

    def __init__(self, count: int, threads: int, settings: RippleSettings) -> None:
        """Build the model once, then ``count`` simulations of it.

        Args:
            count: Number of episodes.
            threads: Number of engine threads; 0: one per core.
            settings: Arguments of the environment.
        """
        s = settings
        time = np.asarray(np.arange(s.steps + 1) * s.period_s, float)
        self._up, self._bend, _ = smooth_step(time, RAMP)
        # integral of the step by Simpson's rule, whose error is far below one count of
        # any encoder
        middle = smooth_step(time[:-1] + 0.5 * s.period_s, RAMP)[0]
        self._parts = self._up[:-1] + 4.0 * middle + self._up[1:]
        self.estimate: KinematicErrorEstimate | None = None
        super().__init__(
            count,
            threads,
            s,
            loop_Hz=s.loop_Hz,
            loop_damping_ratio=s.loop_damping_ratio,
        )
        rated = self.joint.drive.ratings.rated_torque
        self.authority = s.authority_of_rated * rated / abs(self.joint.ratio)
        """Largest added motor torque [N·m]."""
        self.ripple_scale = s.ripple_scale_of_rated * rated
        """Ripple scale of the reward [N·m]."""
        self.angle_slopes = angle_coefficients(self.joint.drive.layout)[0]
        """Derivatives of the wave-generator angle by theta and psi [-]."""
        if s.identify:
            self.estimate = self._prepare_estimate(count)
        self._mean = np.zeros((2, count))
        self.first_step = round((RAMP + SETTLE) / s.period_s)
        """Last instant without a reward."""

    @property
    def needs_arrays(self) -> bool:
        """Whether a single episode is computed with arrays, too."""
        return self.settings.identify

    def _prepare_estimate(self, count: int) -> KinematicErrorEstimate:
        """Estimate of the kinematic error with the nominal data of the joint."""
        s = self.settings
        return KinematicErrorEstimate(
            count,
            loop=self.loop,
            rotor_inertia=s.rotor_inertia_kgm2,
            link_inertia=s.link_inertia,
            stiffness=self.joint.stiffness,
            slopes=self.angle_slopes,
            slowest=s.slowest * s.max_speed_rad_s,
            period=s.period_s,
            delay=self.sensors.delay_periods * s.period_s,
        )

    def estimate_entries(self) -> tuple[Entry, ...]:
        """Entries of the estimated kinematic error, if it is observed."""
        s, found = self.settings, []
        if not s.identify:
            return ()
        top = ceiling(max(peak_to_peak(self.joint.drive), 0.1 * arcmin))
        rate = s.max_speed_rad_s * abs(self.joint.ratio)
        for order in ORDERS:
            meaning = f"estimated kinematic error of order {order}"
            fastest = ceiling(top * order * rate)
            found += [
                Entry(meaning=meaning, unit="rad", low=-top, high=top),
                Entry(
                    meaning=f"its rate at order {order}",
                    unit="rad/s",
                    low=-fastest,
                    high=fastest,
                ),
            ]
        return tuple(found)

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
            known("sine of the measured wave-generator angle", "1", 1.0),
            known("cosine of the measured wave-generator angle", "1", 1.0),
            known("reference speed of the link", "rad/s", ceiling(s.max_speed_rad_s)),
            known("load torque against the link", "N·m", load),
            known("last action", "1", 1.0),
            *self.estimate_entries(),
            *self.sensor_entries(),
        ), (known("added motor torque relative to authority", "1", 1.0),)

    def draw(self, rng: np.random.Generator) -> tuple[tuple[float, float], Array]:
        """Draw speed and load, of random signs, that grow and then stay constant."""
        s = self.settings
        share = rng.uniform(s.slowest, 1.0) * rng.choice([-1.0, 1.0])
        top = rng.uniform(-1.0, 1.0) * s.load_of_rated
        rated = self.joint.drive.ratings.rated_torque
        drawn = float(share) * s.max_speed_rad_s, float(top) * rated
        return drawn, self.sample(drawn, slice(0, s.steps + 1))

    def sample(self, drawn: tuple[float, float], part: slice) -> Array:
        """Part of a plan.

        Args:
            drawn: Speed [rad/s] and load torque [N·m] after their growth.
            part: Range of the instants.
        """
        s, (speed, load) = self.settings, drawn
        plan = np.zeros((part.stop, 5))
        plan[1:, 0] = np.cumsum(s.period_s / 6.0 * speed * self._parts[: part.stop - 1])
        plan[:, 1] = speed * self._up[: part.stop]
        plan[:, 2] = speed * self._bend[: part.stop]
        plan[:, 3] = load * self._up[: part.stop]
        plan[:, 4] = plan[:, 3] + s.link_inertia * plan[:, 2]
        return plan[part.start :, :, None]

    def command(self, action: Array) -> Array:
        """Input of the motor loop [N·m]: reference, feed-forward and added torque."""
        plan = self.next_plan()
        known = self.feedforward(plan.transpose(1, 0, 2))
        loop = self.loop.command(plan[:, 0], plan[:, 1])
        return np.asarray(loop + known + action * self.authority)

    def feedforward(self, plan: Array) -> Array:
        """Torques of load and inertia, reduced to the motor [N·m]."""
        ratio, rotor = self.joint.ratio, self.settings.rotor_inertia_kgm2
        return np.asarray(plan[4] / ratio + ratio * rotor * plan[2])

    def columns(self) -> list[Array]:
        """Parts of the observation in the order of its table."""
        read, ratio, now = self.readout, self.joint.ratio, self.now
        angle, speed = read.value[:, :1].copy(), read.motor_speed
        by_theta, by_psi = self.angle_slopes
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
            *(self.estimate.columns() if self.estimate else ()),
            *self.readings(),
        ]

    def read_measurements(self, observation: Array) -> Measured:
        """Sensor readings in observations with any leading axes, for controllers."""
        measured = super().read_measurements(observation)
        if self.estimate is None:
            return measured
        # before the readings of further sensors, which come last
        last = observation.shape[-1] - (self.readout.channels - 1)
        part = slice(last - 2 * len(ORDERS), last)
        return replace(measured, error_estimate=(observation * self.units)[..., part])

    def judge(self) -> None:
        """Set the torque ripple [N·m] and the errors [rad] including their means."""
        super().judge()
        now, inertia = self.now[:, :, 0], self.settings.link_inertia
        self.ripple = self.output_torque[:, 0] - now[:, 3] - inertia * now[:, 2]
        turned = self.motor_angle[:, 0] / self.joint.ratio
        error = self.link_angle[:, 0] - turned
        self._errors = np.stack([self.link_error[:, 0], error])

    def remember(self) -> None:
        """Update the running means of the errors."""
        share = self.period / MEMORY
        self._mean = self._mean + share * (self._errors - self._mean)
        self.link_ripple, self.error_ripple = self._errors - self._mean
        if self.estimate is not None:
            angle, now = self.readout.value[:, 0], self.now[:, :, 0]
            self.estimate.update(
                angle=angle,
                deviation=angle - self.joint.ratio * now[:, 0],
                speed=now[:, 1],
                load=now[:, 4],
                torque=self.authority * self.action[:, 0],
            )

    def forget(self, rows: Rows) -> None:
        """Set the running means of some episodes to the current errors."""
        self._mean = self._mean.copy()
        self._mean[:, rows] = self._errors[:, rows]
        self.link_ripple, self.error_ripple = self._errors - self._mean
        if self.estimate is not None:
            self.estimate.forget(rows)

    def list_means(self) -> list[float]:
        """Running means of the link and transmission errors of the first episode."""
        return [float(one) for one in self._mean[:, 0]]

    def deviation(self) -> tuple[Array, Array]:
        """Sum of the squares of both ripples over their scales, and squared action."""
        a, b = self._ripples()
        effort = self.action[:, 0]
        return a * a + b * b, effort * effort

    def reward(self) -> Array:
        """Reward as :class:`RippleSuppressionEnv` defines it."""
        (a, b), effort = self._ripples(), self.action[:, 0]
        effort_weight = self.settings.effort_weight
        value = 1.0 / (1.0 + a * a + b * b) - effort_weight * (effort * effort)
        return np.where(self.instant > self.first_step, value, 0.0)

    def _ripples(self) -> tuple[Array, Array]:
        """Ripples of torque and link angle over their scales [-]. Shapes (n,)."""
        scale = self.settings.error_scale_arcmin * arcmin
        return self.ripple / self.ripple_scale, self.link_ripple / scale

    def info(self) -> dict[str, NDArray[Any]]:
        """True values, including the ripples and whether the reward counts."""
        return super().info() | {
            "torque_ripple_Nm": self.ripple,
            "link_error_ripple_arcmin": self.link_ripple / arcmin,
            "transmission_error_ripple_arcmin": self.error_ripple / arcmin,
            "steady": self.instant > self.first_step,
        }


class RippleEpisode(JointEpisode):
    """The only episode of a :class:`RippleCore`."""

    core_of = RippleCore
    core: RippleCore

    def begin(self) -> None:
        """Take over the state of the core after its reset."""
        super().begin()
        self._means = self.core.list_means()

    def command(self, action: float) -> float:
        """Input of the motor loop [N·m]: reference, feed-forward and added torque."""
        (q, v, a, _, known), ratio = self.plan_at(self.instant + 1), self.ratio
        known = known / ratio + ratio * self.core.settings.rotor_inertia_kgm2 * a
        stiffness, damping = self.gains
        loop = stiffness * (ratio * q) + damping * (ratio * v)
        return loop + known + action * self.core.authority

    def columns(self) -> list[float]:
        """Parts of the observation in the order of its table."""
        angle, speed, ratio = self.readings[0], self.measured_speed, self.ratio
        by_theta, by_psi = self.core.angle_slopes
        alpha = by_theta * angle + by_psi * (angle / ratio)
        q, v, _, load, _ = self.now
        errors = ratio * q - angle, ratio * v - speed
        # numpy's sine may differ from that of the math library in the last bit
        sine, cosine = float(np.sin(alpha)), float(np.cos(alpha))
        return [angle, speed, *errors, sine, cosine, v, load, self.action]

    def judge(self) -> None:
        """Set the torque ripple [N·m] and the ripple of the errors [rad]."""
        core, now = self.core, self.now
        inertia = core.settings.link_inertia
        self.ripple = self.output_torque - now[3] - inertia * now[2]
        error = self.link_angle - self.motor_angle / self.ratio
        share, errors = self.period / MEMORY, (self.link_error, error)
        self._means = [
            mean + share * (one - mean)
            for one, mean in zip(errors, self._means, strict=True)
        ]
        self.link_ripple, self.error_ripple = (
            one - mean for one, mean in zip(errors, self._means, strict=True)
        )

    def reward(self) -> float:
        """Reward as :class:`RippleSuppressionEnv` defines it."""
        s, core = self.core.settings, self.core
        if self.instant <= core.first_step:
            return 0.0
        a = self.ripple / core.ripple_scale
        b = self.link_ripple / (s.error_scale_arcmin * arcmin)
        effort = self.action
        return 1.0 / (1.0 + a * a + b * b) - s.effort_weight * (effort * effort)

    def info(self) -> dict[str, Any]:
        """True values, including the ripples and whether the reward counts."""
        return super().info() | {
            "torque_ripple_Nm": self.ripple,
            "link_error_ripple_arcmin": self.link_ripple / arcmin,
            "transmission_error_ripple_arcmin": self.error_ripple / arcmin,
            "steady": float(self.instant > self.core.first_step),
        }

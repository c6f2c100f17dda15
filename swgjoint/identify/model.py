"""Torques of a drive along a log as functions of its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.gear.kinematics import ratio as signed_ratio
from swgjoint.gear.ratings import Ratings
from swgjoint.identify.log import Averaged, BenchLog, mean_acceleration, mean_rate
from swgjoint.identify.unknowns import SPRINGS, ModelParameter, spread, unknowns_of
from swgjoint.maps.fit.friction_fit import PRESLIDING
from swgjoint.maps.friction import play_bristle
from swgjoint.maps.from_catalogue import three_lines
from swgjoint.maps.hysteresis import stretches
from swgjoint.maps.torsion_law import torque_at_knots
from swgjoint.typing import Array

SLIDES = 10.0 * PRESLIDING
"""Rotation since rest or reversal after which the bristle is assumed to slip [rad]."""
_MOVES = 0.05  # fraction of the largest speed below which the wave generator may stick
_ROUND_OFF = 1e-12  # range of a constant channel, relative to its largest value
_TOLD, _SHOWS = 1e-4, 1e-3  # relevant delay [s]; its smallest effect on the torsion [-]
_SOFTEST = 1e-3  # least slope relative to the mean stiffness, during the search


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A log with its known quantities, and the torques of given parameters along it.

    Arrays have the shape (n,), one value for each window, unless stated otherwise.
    """

    samples: Averaged
    """Window means of the log."""
    layout: str
    """Which member is fixed."""
    teeth: tuple[int, int]
    """Number of teeth of flexspline and circular spline."""
    ratings: Ratings
    """Catalogue torques, or those derived from the rated torque and the log."""
    spring: str
    """Type of spring, a key of :data:`~swgjoint.identify.unknowns.SPRINGS`."""
    rotor_inertia: float | None
    """Inertia of motor and wave generator [kg·m²]; None if it is a parameter."""
    orders: NDArray[np.int64]
    """Orders (p, q) of the kinematic error. Shape (n_harmonics, 2)."""
    hysteresis: bool
    """Whether the model has a Jenkin element."""
    skew: bool
    """Whether the delay of the link angles is estimated."""
    first_skew: float
    """Delay of the link angles from a linear fit of the log [s]."""
    link_rate: Array
    """Link speed [rad/s]."""
    link_acceleration: Array
    """Link acceleration [rad/s²]."""
    torsion: Array
    """Torsion theta/i - psi of the log [rad]."""
    mean_stiffness: float
    """Stiffness from a linear fit of the log [N·m/rad]."""
    step: float
    """Duration of an averaging window [s]."""
    motor_acceleration: Array
    """Motor acceleration [rad/s²]."""
    relative_rate: Array
    """Speed nu of the wave generator relative to the flexspline [rad/s]."""
    slipping: Array
    """Direction of slip, 1 or -1; zero where the friction may stick [-]."""
    cos: Array
    """Window mean of the cosine of every harmonic's phase. Shape (n, n_harmonics)."""
    sin: Array
    """Window mean of the sine of every harmonic's phase. Shape (n, n_harmonics)."""

    @classmethod
    def from_log(
        cls,
        log: BenchLog,
        samples: Averaged,
        *,
        layout: str,
        teeth: tuple[int, int],
        ratings: Ratings | float,
        corners: tuple[float, float] | None,
        spring: str,
        rotor_inertia: float | None,
        orders: Sequence[tuple[int, int]],
        hysteresis: bool,
        skew: bool,
    ) -> Model:
        """Compute everything that does not depend on the parameters.

        Args:
            log: Log of the bench.
            samples: Window means of the log.
            layout: Which member is fixed.
            teeth: Number of teeth of flexspline and circular spline.
            ratings: All catalogue torques, or only the rated torque [N·m].
            corners: T1 and T2 [N·m]; None takes 0.2 and 0.6 of the rated torque.
            spring: Key of :data:`SPRINGS`.
            rotor_inertia: Inertia of motor and wave generator [kg·m²]; estimated if
                None.
            orders: Orders (p, q) of the kinematic error.
            hysteresis: Whether the model has a Jenkin element.
            skew: Whether to estimate the delay of the link angles, if the output torque
                was logged and the delay would have a visible effect.

        Raises:
            InputError: If an option is invalid or a channel of the log is constant or
                has the wrong sign.
        """
        if spring not in SPRINGS:
            raise InputError(f"spring {spring!r}; accepted: {', '.join(SPRINGS)}")
        pairs = np.array(list(orders), dtype=np.int64).reshape(-1, 2)
        theta, psi, t = samples.motor_angle, samples.link_angle, samples.time
        step = float(np.median(np.diff(t)))
        rate, link_rate = mean_rate(theta, step), mean_rate(psi, step)
        alpha, b = angle_coefficients(layout)
        n = (pairs @ np.array([alpha, b])).astype(float)
        # a window may contain many waves: average sine and cosine, not the phase
        phase = np.stack([log.motor_angle, log.link_angle], axis=-1) @ n.T
        stretch, _ = play_bristle(b[0] * theta + b[1] * psi, np.full(len(t), SLIDES))
        slips = np.abs(stretch) >= (1.0 - 1e-9) * SLIDES
        i = signed_ratio(layout, *teeth)
        torque = samples.output_torque
        if torque is None:
            assert samples.motor_torque is not None
            torque = i * samples.motor_torque
        torsion = theta / i - psi
        for channel, x, unit in (
            ("torsion theta/i - psi", torsion, "rad"),
            ("output torque", samples.output_torque, "N·m"),
            ("motor torque", samples.motor_torque, "N·m"),
        ):
            if x is None:
                continue
            largest = np.abs(psi if x is torsion else x).max()
            if np.ptp(x) <= _ROUND_OFF * largest:
                raise InputError(
                    f"{log.where}: the {channel} is constant, {x[0] + 0.0:.3g} {unit};"
                    " accepted: a channel that changes"
                )
        # with the motor torque alone a skew cannot be separated from viscous friction
        skew = skew and samples.output_torque is not None
        skew = skew and _tells_skew(torsion, link_rate)
        late = _line_skew(torsion, torque, link_rate) if skew else 0.0
        slope = float(np.polyfit(torsion - late * link_rate, torque, 1)[0])
        if not slope > 0.0:
            channel = "motor" if samples.output_torque is None else "output"
            raise InputError(
                f"{log.where}: the {channel} torque falls by {-slope:.3g} N·m/rad, at"
                " the output, with increasing torsion"
                f" theta/i - psi, i = {i:g}; accepted: a log whose torques and angles"
                " have the signs of the drive; check its layout and teeth"
            )
        return cls(
            samples=samples,
            layout=layout,
            teeth=teeth,
            ratings=ratings
            if isinstance(ratings, Ratings)
            else ratings_of(ratings, float(np.abs(torque).max()), corners),
            spring=spring,
            rotor_inertia=rotor_inertia,
            orders=pairs,
            hysteresis=hysteresis,
            skew=skew,
            first_skew=late,
            link_rate=link_rate,
            link_acceleration=mean_acceleration(psi, step),
            torsion=torsion,
            mean_stiffness=slope,
            motor_acceleration=mean_acceleration(theta, step),
            step=step,
            relative_rate=b[0] * rate + b[1] * link_rate,
            slipping=np.where(slips, np.sign(stretch), 0.0),
            cos=samples.mean(np.cos(phase)),
            sin=samples.mean(np.sin(phase)),
        )

    @property
    def ratio(self) -> float:
        """Signed ratio i [-]."""
        return signed_ratio(self.layout, *self.teeth)

    def measured_torques(self) -> dict[str, Array]:
        """Measured torques by channel at the :attr:`kept` samples [N·m]."""
        both = {
            "output_torque": self.samples.output_torque,
            "motor_torque": self.samples.motor_torque,
        }
        return {key: x[self.kept] for key, x in both.items() if x is not None}

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Mask of the window means that enter the fit. Shape (n,).

        The fit begins once the torsion has covered half its range; the hysteresis
        element then no longer depends on its state at the start of the log. The last
        two means are excluded because their acceleration is one-sided. If the motor
        torque was logged, only means at which the wave generator certainly slips are
        included, because static friction may have any value below its limit.
        """
        x = self.torsion
        travel = np.maximum.accumulate(x) - np.minimum.accumulate(x)
        keep = travel >= 0.5 * travel[-1]
        keep[-2:] = False
        if self.samples.motor_torque is not None:
            speed = np.abs(self.relative_rate)
            keep &= (self.slipping != 0.0) & (speed > _MOVES * speed.max())
        return np.asarray(keep)

    def torques(self, values: Array) -> dict[str, Array]:
        """Modelled torques by channel at the :attr:`kept` samples [N·m].

        Args:
            values: Parameter values in the order of :attr:`unknowns`.
        """
        p = {x.name: v for x, v in zip(self.unknowns, values, strict=True)}
        i, s = self.ratio, self.samples
        alpha, b = angle_coefficients(self.layout)
        n = self.orders @ np.array([alpha, b])
        ab = self.amplitudes(values)
        error = self.cos @ ab[:, 0] + self.sin @ ab[:, 1]
        slopes = (self.cos * ab[:, 1] - self.sin * ab[:, 0]) @ n
        by_theta, by_psi = 1.0 / i + slopes[:, 0], -1.0 + slopes[:, 1]
        torsion = self.torsion + p["zero"] + error
        if self.skew:
            late = p["link_skew"]
            torsion = torsion - late * self.link_rate
            torsion = torsion - 0.5 * late**2 * self.link_acceleration
        elastic = self._spring(p, torsion)
        if self.hysteresis:
            k, f = p["hysteresis_stiffness"], p["hysteresis_yield_torque"]
            elastic = elastic + k * stretches(torsion - torsion[0], f / k)
        elastic = elastic + p["damping"] * mean_rate(torsion, self.step)
        friction = 0.0
        if s.motor_torque is not None:
            slip = p["friction_coulomb"] + p["friction_load"] * np.abs(elastic / i)
            friction = slip * self.slipping + p["friction_viscous"] * self.relative_rate
        torques = {}
        if s.output_torque is not None:
            torques["output_torque"] = (-by_psi * elastic - b[1] * friction)[self.kept]
        if s.motor_torque is not None:
            inertia = self.rotor_inertia
            if inertia is None:
                inertia = p["rotor_inertia"]
            torques["motor_torque"] = (
                inertia * self.motor_acceleration + by_theta * elastic + b[0] * friction
            )[self.kept]
        return torques

    @property
    def phase_step(self) -> float:
        """Largest phase change of a harmonic from one window to the next [rad]."""
        alpha, b = angle_coefficients(self.layout)
        n = self.orders @ np.array([alpha, b])
        angles = np.stack([self.samples.motor_angle, self.samples.link_angle])
        return float(np.abs(n @ np.diff(angles)).max(initial=0.0))

    @cached_property
    def largest_torque(self) -> float:
        """Largest output torque in the fit, by either channel [N·m]."""
        at_output = {"output_torque": 1.0, "motor_torque": abs(self.ratio)}
        return max(
            at_output[key] * float(np.abs(x).max())
            for key, x in self.measured_torques().items()
        )

    @cached_property
    def slopes(self) -> tuple[str, ...]:
        """Stiffness parameters that the log can determine.

        K2 matters only above T1 and K3 only above T2.
        """
        names = SPRINGS[self.spring]
        if self.spring == "cubic":
            return names
        corners = (0.0, self.ratings.T1, self.ratings.T2)
        return tuple(
            name
            for name, corner in zip(names, corners, strict=True)
            if self.largest_torque > corner
        )

    @cached_property
    def unknowns(self) -> tuple[ModelParameter, ...]:
        """Parameters in the order of all arrays of values."""
        return tuple(unknowns_of(self))

    def amplitudes(self, values: Array) -> Array:
        """Cosine and sine amplitudes of the kinematic error [rad]. (n_harmonics, 2)."""
        first = len(self.slopes) + 2 + 2 * self.hysteresis
        return values[first : first + 2 * len(self.orders)].reshape(-1, 2)

    def _spring(self, p: Mapping[str, float], x: Array) -> Array:
        if self.spring == "cubic":
            return np.asarray(p["stiffness"] * x + p["hardening"] * x**3)
        knots, k = lines_of(self, p)
        torque = torque_at_knots(knots, k)
        inside = np.clip(x, knots[0], knots[-1])
        j = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, k.size - 2)
        d, bend = inside - knots[j], np.diff(k) / np.diff(knots)
        out = np.where(x < inside, k[0], k[-1]) * (x - inside)
        return np.asarray(torque[j] + d * (k[j] + 0.5 * d * bend[j]) + out)


def lines_of(model: Model, p: Mapping[str, float]) -> tuple[Array, Array]:
    """Knots [rad] and stiffness at the knots [N·m/rad] of the three-line spring.

    Args:
        model: Model with a three-line spring.
        p: Parameter values by name.

    Returns:
        Knots and stiffness; each stiffness parameter is at least a small positive one.
        Beyond the torques of the log, the last known line goes on.
    """
    r, least = model.ratings, _SOFTEST * model.mean_stiffness
    known = [max(float(p[k]), least) for k in model.slopes]
    K1, K2, K3 = known + [known[-1]] * (3 - len(known))
    top = max(r.momentary_peak, 1.5 * r.T2)
    return three_lines(r.T1, r.T2, K1, K2, K3, largest=top)


def _tells_skew(torsion: Array, link_rate: Array) -> bool:
    """Whether a delay of :data:`_TOLD` would have a visible effect on the torsion."""
    return _TOLD * spread(link_rate) > _SHOWS * spread(torsion)


def _line_skew(torsion: Array, torque: Array, link_rate: Array) -> float:
    """Delay of the link angles from a linear fit of torsion to torque and speed [s]."""
    columns = np.column_stack([torque, link_rate, np.ones_like(torque)])
    scale = np.abs(columns).max(axis=0)
    weights = np.linalg.lstsq(columns / scale, torsion, rcond=None)[0] / scale
    return float(weights[1])


def ratings_of(
    rated: float, largest: float, corners: tuple[float, float] | None = None
) -> Ratings:
    """Ratings from a rated torque and the largest torque of a log.

    Args:
        rated: Rated torque [N·m].
        largest: Largest torque of the log [N·m].
        corners: T1 and T2 [N·m]; None takes 0.2 and 0.6 of the rated torque.

    Returns:
        Ratings whose peaks are the larger of ``rated`` and ``largest``.

    Raises:
        InputError: If a torque is invalid.
    """
    if not (np.isfinite(rated) and rated > 0.0):
        raise InputError(f"rated torque {rated:g} N·m; accepted: > 0 N·m")
    T1, T2 = corners or (0.2 * rated, 0.6 * rated)
    if not 0.0 < T1 < T2 < np.inf:
        raise InputError(f"corners {T1:g} and {T2:g} N·m; accepted: 0 < T1 < T2")
    peak = max(rated, largest)
    peaks = f"peaks from the log to {largest:g} N·m"
    return Ratings(
        rated_torque=rated,
        repeated_peak=peak,
        momentary_peak=peak,
        T1=T1,
        T2=T2,
        source=f"default (repeated_peak_Nm, momentary_peak_Nm): {peaks}"
        if corners
        else f"rated torque given; {peaks}; T1, T2 are 0.2 and 0.6 of rated",
    )

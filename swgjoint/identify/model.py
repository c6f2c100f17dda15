"""Torques of a drive along a log as a function of its parameters."""

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
from swgjoint.maps.fit.friction_fit import PRESLIDING
from swgjoint.maps.friction import play_bristle
from swgjoint.maps.from_catalogue import three_lines
from swgjoint.maps.hysteresis import stretches
from swgjoint.maps.torsion_law import torque_at_knots
from swgjoint.typing import Array

SPRINGS = {
    "three_lines": ("K1", "K2", "K3"),
    "cubic": ("stiffness", "hardening"),
}
SLIDES = 10.0 * PRESLIDING
"""Rotation since rest or reversal from which friction is taken to slip [rad]."""
_MOVES = 0.05  # of the largest speed, below which the wave generator may stick
_ROUND_OFF = 1e-12  # of the largest
_LEAST = 1e-6  # of the scales, stiffness and yield torque of an element
_TOLD, _SHOWS = 1e-4, 1e-3  # a skew [s] that matters, its part of the torsion
_SOFTEST = 1e-3  # of the mean stiffness: slopes stay positive on the way to the fit


@dataclass(frozen=True, kw_only=True)
class ModelParameter:
    """One unknown."""

    name: str
    unit: str
    start: float
    """Where the search begins."""
    scale: float
    """A change of it that changes the torques about as much as others do."""
    least: float = -np.inf
    """Lower bound."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A log, what of it is known, and the torques that parameters give along it."""

    samples: Averaged
    layout: str
    teeth: tuple[int, int]
    ratings: Ratings
    spring: str
    rotor_inertia: float | None
    orders: NDArray[np.int64]
    """(p, q). Shape (n_harmonics, 2)."""
    hysteresis: bool
    skew: bool
    """Whether the link angles may be of other instants than the rest."""
    first_skew: float
    """Skew of a straight line through the log [s]."""
    link_rate: Array
    """[rad/s]."""
    link_acceleration: Array
    """[rad/s²]."""
    torsion: Array
    """theta/i - psi of the log [rad]."""
    mean_stiffness: float
    """Stiffness of a straight line through the log [N·m/rad]."""
    step: float
    """Window of the averages [s]."""
    motor_acceleration: Array
    """[rad/s²]."""
    relative_rate: Array
    """nu, of the wave generator against the flexspline [rad/s]."""
    slipping: Array
    """s, direction in which the friction slips; 0 where it may stick."""
    cos: Array
    """Cosine of the phase of every harmonic, mean over a window. (n, n_harmonics)."""
    sin: Array

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
        """Prepare what does not depend on the parameters."""
        if spring not in SPRINGS:
            raise InputError(f"spring {spring!r}; accepted: {', '.join(SPRINGS)}")
        pairs = np.array(list(orders), dtype=np.int64).reshape(-1, 2)
        theta, psi, t = samples.motor_angle, samples.link_angle, samples.time
        step = float(np.median(np.diff(t)))
        rate, link_rate = mean_rate(theta, step), mean_rate(psi, step)
        alpha, b = angle_coefficients(layout)
        n = (pairs @ np.array([alpha, b])).astype(float)
        # many waves may pass in a window: the mean of a wave is not that of its phase
        phase = np.stack([log.motor_angle, log.link_angle], axis=-1) @ n.T
        stretch, _ = play_bristle(b[0] * theta + b[1] * psi, np.full(len(t), SLIDES))
        slips = np.abs(stretch) >= (1.0 - 1e-9) * SLIDES
        i = signed_ratio(layout, *teeth)
        torque = samples.output_torque
        if torque is None:
            assert samples.motor_torque is not None
            torque = i * samples.motor_torque
        torsion = theta / i - psi
        for what, x, unit in (
            ("torsion theta/i - psi", torsion, "rad"),
            ("output torque", samples.output_torque, "N·m"),
            ("motor torque", samples.motor_torque, "N·m"),
        ):
            if x is None:
                continue
            largest = np.abs(psi if x is torsion else x).max()
            if np.ptp(x) <= _ROUND_OFF * largest:
                raise InputError(
                    f"{log.where}: the {what} is {x[0] + 0.0:.3g} {unit} all along;"
                    " accepted: one that changes"
                )
        # with the torque of the motor alone a skew looks as viscous friction does
        skew = skew and samples.output_torque is not None
        skew = skew and _tells_skew(torsion, link_rate)
        late = _line_skew(torsion, torque, link_rate) if skew else 0.0
        slope = float(np.polyfit(torsion - late * link_rate, torque, 1)[0])
        if not slope > 0.0:
            raise InputError(
                f"torque falls by {-slope:.3g} N·m/rad as the torsion theta/i - psi"
                f" grows, i = {i:g}; accepted: a log whose torques and angles have the"
                " signs of the drive, see its layout and teeth"
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
        """Signed ratio i."""
        return signed_ratio(self.layout, *self.teeth)

    def measured_torques(self) -> dict[str, Array]:
        """Torques of the log by channel [N·m]."""
        both = {
            "output_torque": self.samples.output_torque,
            "motor_torque": self.samples.motor_torque,
        }
        return {key: x[self.kept] for key, x in both.items() if x is not None}

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Samples that count.

        Once the torsion has covered half its range, when the element remembers nothing
        of how the log began; not at the end, where the acceleration is one-sided; with
        friction those at which the wave generator surely slips: at rest its torque is
        any below the limit.
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
        """Torques of output and motor along the log [N·m]."""
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
        rubs = 0.0
        if s.motor_torque is not None:
            slip = p["friction_coulomb"] + p["friction_load"] * np.abs(elastic / i)
            rubs = slip * self.slipping + p["friction_viscous"] * self.relative_rate
        found = {}
        if s.output_torque is not None:
            found["output_torque"] = (-by_psi * elastic - b[1] * rubs)[self.kept]
        if s.motor_torque is not None:
            inertia = self.rotor_inertia
            if inertia is None:
                inertia = p["rotor_inertia"]
            found["motor_torque"] = (
                inertia * self.motor_acceleration + by_theta * elastic + b[0] * rubs
            )[self.kept]
        return found

    @property
    def phase_step(self) -> float:
        """Largest change of a harmonic's phase from window to window [rad]."""
        alpha, b = angle_coefficients(self.layout)
        n = self.orders @ np.array([alpha, b])
        angles = np.stack([self.samples.motor_angle, self.samples.link_angle])
        return float(np.abs(n @ np.diff(angles)).max(initial=0.0))

    @cached_property
    def unknowns(self) -> tuple[ModelParameter, ...]:
        """Parameters in the order of all arrays of values."""
        return tuple(_unknowns(self))

    def amplitudes(self, values: Array) -> Array:
        """Cosine and sine of the kinematic error [rad]. Shape (n_harmonics, 2)."""
        first = len(SPRINGS[self.spring]) + 2 + 2 * self.hysteresis
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
    """Torsions and stiffness there, of three lines."""
    r, least = model.ratings, _SOFTEST * model.mean_stiffness
    K1, K2, K3 = (max(float(p[k]), least) for k in SPRINGS["three_lines"])
    top = max(r.momentary_peak, 1.5 * r.T2)
    return three_lines(r.T1, r.T2, K1, K2, K3, largest=top)


def _unknowns(model: Model) -> list[ModelParameter]:
    """The unknowns in their order: the straight line to start with, little else."""
    K, i = model.mean_stiffness, abs(model.ratio)
    x = 0.5 * float(np.ptp(model.torsion))
    T = K * x
    rate = _spread(mean_rate(model.torsion, model.step))

    def slope(name: str) -> ModelParameter:
        return ModelParameter(name=name, unit="N·m/rad", start=K, scale=K)

    found = [slope(name) for name in SPRINGS[model.spring]]
    if model.spring == "cubic":
        cubic = ModelParameter(
            name="hardening", unit="N·m/rad³", start=0.0, scale=K / x**2
        )
        found[1] = cubic
    zero = -float(np.mean(model.torsion))
    found += [
        ModelParameter(name="zero", unit="rad", start=zero, scale=x),
        ModelParameter(name="damping", unit="N·m·s/rad", start=0.0, scale=T / rate),
    ]
    if model.hysteresis:
        # an element is f/k wide: -k and -f would do as well as k and f
        found += [
            ModelParameter(
                name="hysteresis_stiffness",
                unit="N·m/rad",
                start=0.5 * K,
                scale=K,
                least=_LEAST * K,
            ),
            ModelParameter(
                name="hysteresis_yield_torque",
                unit="N·m",
                start=0.02 * T,
                scale=T,
                least=_LEAST * T,
            ),
        ]
    found += [
        ModelParameter(name=f"error_{p}_{q}_{part}", unit="rad", start=0.0, scale=x)
        for p, q in model.orders
        for part in ("cos", "sin")
    ]
    if model.skew:
        skew = ModelParameter(
            name="link_skew",
            unit="s",
            start=model.first_skew,
            scale=x / _spread(model.link_rate),
        )
    if model.samples.motor_torque is None:
        return [*found, skew] if model.skew else found
    at_motor, speed = T / i, _spread(model.relative_rate)
    found += [
        ModelParameter(
            name="friction_coulomb", unit="N·m", start=0.01 * at_motor, scale=at_motor
        ),
        ModelParameter(name="friction_load", unit="-", start=0.0, scale=1.0),
        ModelParameter(
            name="friction_viscous", unit="N·m·s/rad", start=0.0, scale=at_motor / speed
        ),
    ]
    if model.rotor_inertia is None:
        inertia = at_motor / _spread(model.motor_acceleration)
        found.append(
            ModelParameter(name="rotor_inertia", unit="kg·m²", start=0.0, scale=inertia)
        )
    return [*found, skew] if model.skew else found


def _tells_skew(torsion: Array, link_rate: Array) -> bool:
    """Whether a skew of :data:`_TOLD` would show in the torsion."""
    return _TOLD * _spread(link_rate) > _SHOWS * _spread(torsion)


def _line_skew(torsion: Array, torque: Array, link_rate: Array) -> float:
    """By which the link is late, the drive taken as a straight line [s]."""
    columns = np.column_stack([torque, link_rate, np.ones_like(torque)])
    scale = np.abs(columns).max(axis=0)
    found = np.linalg.lstsq(columns / scale, torsion, rcond=None)[0] / scale
    return float(found[1])


def _spread(values: Array) -> float:
    return max(float(np.std(values)), 1e-12)


def ratings_of(
    rated: float, largest: float, corners: tuple[float, float] | None = None
) -> Ratings:
    """Ratings around a rated torque and the largest of a log [N·m]."""
    if not (np.isfinite(rated) and rated > 0.0):
        raise InputError(f"rated torque {rated:g} N·m; accepted: > 0 N·m")
    T1, T2 = corners or (0.2 * rated, 0.6 * rated)
    if not 0.0 < T1 < T2 < np.inf:
        raise InputError(f"corners {T1:g} and {T2:g} N·m; accepted: 0 < T1 < T2")
    peak = max(rated, largest)
    return Ratings(
        rated_torque=rated,
        repeated_peak=peak,
        momentary_peak=peak,
        T1=T1,
        T2=T2,
        source=f"rated torque given; peaks from the log to {largest:g} N·m; T1, T2"
        f" {'given' if corners else 'are 0.2 and 0.6 of rated'}",
    )

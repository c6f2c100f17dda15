r"""Parameters of a drive from a log of its motion and torques, with intervals.

A bench logs angles of motor and link, and the torque of the motor, that behind the
drive, or both. With the map's own words, :math:`g` the slopes of the torsion,

.. math::
    T &= T_s(\Delta) + q + C\dot\Delta, \quad
    \Delta = \theta/i + e_0(\theta, \psi) - \psi \\
    \tau_{out} &= -g_\psi T - b_\psi F, \qquad
    \tau_{motor} = J\ddot\theta + g_\theta T + b_\theta F

with the spring :math:`T_s` (three lines as in a catalogue, or linear and cubic), one
Jenkin element q, and friction :math:`F = (f_c + c\,|T/i|)\,\mathrm{sign}\,\nu +
\eta\nu`; samples at which the wave generator may stick are left out. All parameters,
harmonics of :math:`e_0` and zero of the motor angle are found at once by least
squares of the torques; every channel is weighted with the root mean square of its own
residual, mean included, so that one with an offset does not count as precise.

Clocks of encoders are apart: the link angles may be late by a time s, found as the
other parameters are where the torque behind the drive was logged,
:math:`\Delta = \theta/i + e_0 - \psi - s\dot\psi`; the log is then moved by it and
fitted again. With the motor torque alone s cannot be told from viscous friction, and
ends as a doubt where that comes out below zero. A late torque passes for damping.

Samples are averaged over a window first: noise of the encoders would else push the
slider of the element, and acceleration is a difference of averages. Intervals are those
of Gauss and Newton,

.. math:: \mathrm{cov} = \kappa\,(J^T J)^{-1}, \qquad \kappa = 1 + 2\sum_k \rho_k,

J weighted with the residuals' deviation, :math:`\kappa` what their correlation from
sample to sample takes of the information (ripple that the model does not have, mostly).
They hold where the model does; the residuals' share of each torque says how well.

Source:
    Ljung (1999), "System identification: theory for the user", 2nd ed., ch. 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import ComputationError, InputError
from swgjoint.gear.kinematics import LAYOUTS
from swgjoint.gear.ratings import Ratings
from swgjoint.identify.checks import SURE, check_ratio, doubts_of, remarks, without_skew
from swgjoint.identify.identified_map import map_of
from swgjoint.identify.log import FEWEST, Averaged, BenchLog
from swgjoint.identify.model import Model
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array

WINDOW = 0.005
"""Samples are averaged over this time [s]."""
ORDERS: tuple[tuple[int, int], ...] = ((1, 0), (2, 0), (4, 0), (0, 2), (0, 4), (1, -1))
"""(p, q) of p alpha + q beta that a log over a whole output turn is searched for."""
ORDERS_OF_PART: tuple[tuple[int, int], ...] = ((1, 0), (2, 0), (4, 0))
"""The same for less than one turn, where both gear angles look alike."""
DEVIATIONS = 1.96
"""Half width of an interval in standard deviations: 95 % of a normal distribution."""
_TURN = 0.95  # of an output turn
_ROUNDS = 2  # of weights
_CORRELATED = 200  # samples over which residuals may be alike
_SINGULAR = 1e-10
_SKEW_LEAST = 1e-6  # s, below which a skew moves no torque


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter with its interval of 95 %."""

    name: str
    unit: str
    value: float
    deviation: float
    """Standard deviation, in the unit."""

    @property
    def low(self) -> float:
        """Lower end of the interval."""
        return self.value - DEVIATIONS * self.deviation

    @property
    def high(self) -> float:
        """Upper end of the interval."""
        return self.value + DEVIATIONS * self.deviation


@dataclass(frozen=True, kw_only=True, eq=False)
class Identified:
    """What a log tells of a drive."""

    estimates: Mapping[str, Estimate]
    drive: DriveMap
    """The map with these parameters; motor angles count from zero torsion."""
    samples: Averaged
    """What the fit saw."""
    model: Model
    residuals: Mapping[str, Array]
    """Measured minus modelled torque of each channel [N·m]. Shape (n,)."""
    correlation: float
    """kappa of the covariance [-]."""
    skew: float = 0.0
    """By which the link angles were moved before this fit [s]; the samples are those
    after it."""
    notes: tuple[str, ...] = field(default_factory=tuple)
    doubts: tuple[str, ...] = field(default_factory=tuple)
    """Why the parameters may not be those of the drive; empty where nothing says so."""


def identify(
    log: BenchLog,
    *,
    teeth_flexspline: int,
    teeth_circular_spline: int,
    ratings: Ratings | float,
    corners: tuple[float, float] | None = None,
    layout: str = "circular_spline_fixed",
    spring: str = "three_lines",
    rotor_inertia: float | None = None,
    orders: Sequence[tuple[int, int]] | None = None,
    hysteresis: bool = True,
    window: float = WINDOW,
    name: str = "identified",
) -> Identified:
    """Find the parameters of a drive.

    Args:
        log: Both directions of the torque; for the kinematic error motion over a turn
            of the input, better of the output; for friction several speeds.
        teeth_flexspline: z_fs.
        teeth_circular_spline: z_cs.
        ratings: Torques, or the rated torque alone [N·m].
        corners: T1 and T2 where the rated torque alone is given; 0.2 and 0.6 of it if
            None [N·m].
        layout: Which member is fixed.
        spring: ``three_lines`` with the corners of the ratings, or ``cubic``.
        rotor_inertia: Of motor and wave generator [kg·m²], found if None; needed, as
            friction, only where the torque of the motor was logged.
        orders: (p, q) of the kinematic error; by the length of the log if None.
        hysteresis: Whether to look for an element.
        window: Samples are averaged over this time [s].
        name: Of the map.

    Raises:
        InputError: If the log cannot tell the parameters.
        ComputationError: If the least squares do not settle.
    """
    if layout not in LAYOUTS:
        raise InputError(f"layout {layout!r}; accepted: {', '.join(LAYOUTS)}")
    if not 0 < teeth_flexspline < teeth_circular_spline:
        raise InputError(
            f"teeth {teeth_flexspline} and {teeth_circular_spline}; accepted: 0 <"
            " flexspline < circular spline"
        )
    if rotor_inertia is not None and not 0.0 < rotor_inertia < np.inf:
        raise InputError(f"rotor inertia {rotor_inertia:g} kg·m²; accepted: > 0 kg·m²")
    teeth = (teeth_flexspline, teeth_circular_spline)
    check_ratio(log, layout, teeth)
    options: dict[str, Any] = {
        "teeth_flexspline": teeth_flexspline,
        "teeth_circular_spline": teeth_circular_spline,
        "ratings": ratings,
        "corners": corners,
        "layout": layout,
        "spring": spring,
        "rotor_inertia": rotor_inertia,
        "orders": orders,
        "window": window,
        "name": name,
    }
    found = _identified(log, hysteresis=hysteresis, skew=True, **options)
    late = found.estimates.get("link_skew")
    if late is None or abs(late.value) < max(SURE * late.deviation, _SKEW_LEAST):
        return found
    # once more with the angles of one instant: harmonics and rates are theirs, too
    again = without_skew(log, late.value)
    found = _identified(again, hysteresis=hysteresis, skew=True, **options)
    rest = found.estimates.get("link_skew")
    if rest is None:
        return found
    whole = replace(rest, value=late.value + rest.value)
    note = (
        f"link_angle was {1e3 * whole.value:.4g} ms behind the other channels"
        f" ({1e3 * whole.low:.4g} to {1e3 * whole.high:.4g}); corrected"
    )
    estimates = {**found.estimates, "link_skew": whole}
    return replace(
        found,
        estimates=estimates,
        notes=(*found.notes, note),
        doubts=_doubts_of(found, estimates),
        skew=late.value,
    )


def _doubts_of(found: Identified, estimates: Mapping[str, Estimate]) -> tuple[str, ...]:
    measured = found.model.measured_torques()
    left = {key: rms(r) / rms(measured[key]) for key, r in found.residuals.items()}
    units = [note for note in found.notes if "plausible: " in note]
    return (*doubts_of(estimates, left, found.model.step), *units)


def _identified(
    log: BenchLog,
    *,
    teeth_flexspline: int,
    teeth_circular_spline: int,
    ratings: Ratings | float,
    corners: tuple[float, float] | None,
    layout: str,
    spring: str,
    rotor_inertia: float | None,
    orders: Sequence[tuple[int, int]] | None,
    hysteresis: bool,
    window: float,
    name: str,
    skew: bool,
) -> Identified:
    """Find the parameters from a log as it is."""
    samples = log.average(window)
    whole_turn = np.ptp(samples.link_angle) >= _TURN * 2.0 * np.pi
    if orders is None:
        orders = ORDERS if whole_turn else ORDERS_OF_PART
    if len({*map(tuple, orders), (0, 0)}) != len(orders) + 1:
        shown = ", ".join(f"{p}:{q}" for p, q in orders)
        raise InputError(f"orders {shown}; accepted: each once, not 0:0")
    model = Model.from_log(
        log,
        samples,
        layout=layout,
        teeth=(teeth_flexspline, teeth_circular_spline),
        ratings=ratings,
        corners=corners,
        spring=spring,
        rotor_inertia=rotor_inertia,
        orders=orders,
        hysteresis=hysteresis,
        skew=skew,
    )
    if model.kept.sum() < FEWEST:
        raise InputError(
            f"{log.where}: the wave generator turns in {model.kept.sum()} of"
            f" {model.kept.size} averages; accepted: at least {FEWEST}, or leave"
            " motor_torque_Nm out"
        )
    values, residuals, jacobian = _solve(model)
    kappa = max(_correlation(r) for r in residuals.values())

    def without(element: bool, link_skew: bool) -> Identified:
        return _identified(
            log,
            teeth_flexspline=teeth_flexspline,
            teeth_circular_spline=teeth_circular_spline,
            ratings=ratings,
            corners=corners,
            layout=layout,
            spring=spring,
            rotor_inertia=rotor_inertia,
            orders=orders,
            hysteresis=hysteresis and not element,
            window=window,
            name=name,
            skew=skew and not link_skew,
        )

    def without_element(why: str) -> Identified:
        found = without(element=True, link_skew=False)
        return replace(found, notes=(*found.notes, f"no hysteresis: {why}"))

    information = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(information))
    normal = information / np.outer(scale, scale) if scale.all() else None
    if normal is None or np.linalg.cond(normal) > 1.0 / _SINGULAR:
        names = [p.name for p in model.unknowns]
        worst = names[int(np.argmin(scale))]
        if normal is not None:
            worst = names[int(np.abs(np.linalg.eigh(normal)[1][:, 0]).argmax())]
        if worst == "link_skew":
            return without(element=False, link_skew=True)
        if worst.startswith("hysteresis"):
            return without_element(f"the log does not tell {worst}")
        raise InputError(
            f"{log.where}: the log cannot tell {worst} from the others; accepted: a"
            " log with both signs of torque and speed, or fewer orders"
        )
    covariance = kappa * np.linalg.inv(normal) / np.outer(scale, scale)
    estimates = {
        p.name: Estimate(name=p.name, unit=p.unit, value=float(v), deviation=float(d))
        for p, v, d in zip(
            model.unknowns, values, np.sqrt(np.diag(covariance)), strict=True
        )
    }
    lost = estimates.get("hysteresis_yield_torque")
    if lost is not None and lost.low <= 0.0:
        return without_element(
            f"an element of {lost.value:.3g} N·m is within its noise"
        )
    drive, notes = map_of(model, values, name=name, source=Path(log.where).name)
    found = Identified(
        estimates=estimates,
        drive=drive,
        samples=samples,
        model=model,
        residuals=residuals,
        correlation=kappa,
        notes=(*notes, *remarks(model, drive, residuals)),
    )
    return replace(found, doubts=_doubts_of(found, estimates))


def rms(x: Array) -> float:
    """Root mean square, mean included."""
    return float(np.sqrt(np.mean(x**2)))


def _solve(model: Model) -> tuple[Array, dict[str, Array], Array]:
    """Parameters, residuals per channel, and the weighted Jacobian."""
    from scipy.optimize import least_squares

    unknowns = model.unknowns
    values = np.array([p.start for p in unknowns])
    scale = np.array([p.scale for p in unknowns])
    bounds = (np.array([p.least for p in unknowns]), np.inf)
    measured = model.measured_torques()
    weight = {key: 1.0 / max(rms(x), 1e-12) for key, x in measured.items()}

    def residual(x: Array, weight: Mapping[str, float]) -> Array:
        got = model.torques(x)
        return np.concatenate(
            [(got[key] - measured[key]) * w for key, w in weight.items()]
        )

    for _ in range(_ROUNDS):
        found = least_squares(
            residual,
            values,
            bounds=bounds,
            x_scale=scale,
            max_nfev=60,
            args=(weight,),
        )
        if not np.isfinite(found.x).all():
            raise ComputationError(
                "identification diverged: see that the torques and angles of the log"
                " have the signs of their heads"
            )
        values = found.x
        got = model.torques(values)
        off = {key: measured[key] - got[key] for key in measured}
        # by each channel's own residual with its mean; a perfect log has none
        weight = {
            key: 1.0 / max(rms(r), 1e-9 * rms(measured[key]), 1e-12)
            for key, r in off.items()
        }
    # the last weights are those of the covariance
    rows = [len(r) for r in off.values()]
    old = np.sqrt([np.mean(r**2) for r in np.split(found.fun, rows[:-1])])
    jacobian = found.jac / np.repeat(np.maximum(old, 1e-9), rows)[:, None]
    return values, off, np.asarray(jacobian)


def _correlation(residual: Array) -> float:
    """1 + 2 sum of the autocorrelation, to where it first is within its noise."""
    x = residual - residual.mean()
    n = len(x)
    power = float(x @ x)
    total = 1.0
    for k in range(1, min(_CORRELATED, n // 4)):
        rho = float(x[k:] @ x[:-k]) / power if power else 0.0
        if rho < 2.0 / np.sqrt(n):
            break
        total += 2.0 * rho
    return total

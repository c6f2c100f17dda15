r"""Parameters of a drive from a log of its motion and torques, with intervals.

A bench logs the angles of motor and link, and the motor torque, the output torque or
both. In the notation of the map, with the derivatives :math:`g` of the torsion,

.. math::
    T &= T_s(\Delta) + q + C\dot\Delta, \quad
    \Delta = \theta/i + e_0(\theta, \psi) - \psi \\
    \tau_{out} &= -g_\psi T - b_\psi F, \qquad
    \tau_{motor} = J\ddot\theta + g_\theta T + b_\theta F, \\
    F &= (f_c + c\,|T/i|)\,\mathrm{sign}\,\nu + \eta\nu

with the spring :math:`T_s` (three lines as in a catalogue, or linear plus cubic), one
Jenkin element of torque q, and friction F. If the motor torque was logged, samples at
which the wave generator may stick are excluded. A least-squares fit of the torques
estimates all parameters, the harmonics of :math:`e_0` and the zero of the motor angle
together. Each channel is divided by the root mean square of its own residual including
the mean, so that a channel with an offset gets a low weight.

The clocks of the encoders may differ, so that the link angles are delayed by a time s.
If the output torque was logged, s is estimated with the other parameters,
:math:`\Delta = \theta/i + e_0 - \psi - s\dot\psi`; a significant s is then corrected in
the log, which is fitted again. From the motor torque alone, s cannot be separated from
viscous friction; a negative viscous friction is then reported as a doubt. A delay of a
torque channel appears as damping.

Samples are first averaged over a window, because encoder noise would otherwise move the
slider of the element, and accelerations are differences of these averages. Intervals
follow from the Gauss-Newton covariance

.. math:: \mathrm{cov} = \kappa\,(D^T D)^{-1}, \qquad \kappa = 1 + 2\sum_k \rho_k,

with the Jacobian D of these weighted residuals and their autocorrelation :math:`\rho_k`
at a lag of k samples. The factor :math:`\kappa` accounts for correlated residuals,
which are mostly ripple outside the model. The intervals are valid only if the model
fits; the root mean square of a residual relative to that of the torque is a measure.

Source:
    Ljung (1999), "System identification: theory for the user", 2nd ed., ch. 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

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
"""Duration of an averaging window [s]."""
ORDERS: tuple[tuple[int, int], ...] = ((1, 0), (2, 0), (4, 0), (0, 2), (0, 4), (1, -1))
"""Orders (p, q), phase p alpha + q beta, that are fitted to a log of a whole turn."""
ORDERS_OF_PART: tuple[tuple[int, int], ...] = ((1, 0), (2, 0), (4, 0))
"""Orders for less than an output turn, which cannot separate alpha from beta."""
DEVIATIONS = 1.96
"""Half width of an interval in standard deviations: 95 % of a normal distribution."""
_TURN = 0.95  # fraction of an output turn that counts as a whole turn
_ROUNDS = 2  # fits, each with updated weights
_CORRELATED = 200  # largest lag of the autocorrelation [samples]
_SINGULAR = 1e-10  # smallest reciprocal condition number of D'D
_SKEW_LEAST = 1e-6  # delay that has no effect on the torques [s]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter with its 95 % interval; ``value`` is in ``unit``."""

    name: str
    unit: str
    value: float
    deviation: float
    """Standard deviation of the value, in the same unit."""

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval, in ``unit``."""
        return self.value - DEVIATIONS * self.deviation

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval, in ``unit``."""
        return self.value + DEVIATIONS * self.deviation


@dataclass(frozen=True, kw_only=True, eq=False)
class Identified:
    """Result of the identification of a drive from a log."""

    estimates: Mapping[str, Estimate]
    drive: DriveMap
    """Map with these parameters; its motor angle is zero at zero torsion."""
    samples: Averaged
    """Window means of the log to which the model was fitted."""
    model: Model
    residuals: Mapping[str, Array]
    """Measured minus modelled torque of each channel [N·m]. Shape (n,)."""
    correlation: float
    """Correlation factor kappa of the covariance [-]."""
    skew: float = 0.0
    """Delay by which the link angles were corrected before this fit [s]; ``samples``
    contain the corrected angles."""
    notes: tuple[str, ...] = field(default_factory=tuple)
    """Remarks on the result, one line each."""
    doubts: tuple[str, ...] = field(default_factory=tuple)
    """Reasons to doubt the parameters, one line each; empty if there are none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Options:
    """Options of :func:`identify`, and whether to estimate the delay (``skew``)."""

    teeth: tuple[int, int]
    ratings: Ratings | float
    corners: tuple[float, float] | None
    layout: str
    spring: str
    rotor_inertia: float | None
    orders: Sequence[tuple[int, int]] | None
    hysteresis: bool
    window: float
    name: str
    skew: bool = True


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
    """Parameters of a drive, its map, and remarks on both.

    Args:
        log: Log with both signs of the torque. The kinematic error needs motion over an
            input turn, preferably an output turn, and friction needs several speeds.
        teeth_flexspline: Number of teeth of the flexspline, z_fs.
        teeth_circular_spline: Number of teeth of the circular spline, z_cs.
        ratings: All catalogue torques, or only the rated torque [N·m].
        corners: T1 and T2 if only the rated torque is given [N·m]; None takes 0.2 and
            0.6 of it.
        layout: Which member is fixed.
        spring: ``three_lines`` with the corners of the ratings, or ``cubic``.
        rotor_inertia: Inertia of motor and wave generator [kg·m²]; estimated if None.
            Like friction, it matters only if the motor torque was logged.
        orders: Orders (p, q) of the kinematic error; None takes :data:`ORDERS`, or
            :data:`ORDERS_OF_PART` if the link travels less than a turn.
        hysteresis: Whether to fit a Jenkin element.
        window: Duration of an averaging window [s].
        name: Name of the map.

    Raises:
        InputError: If an option is invalid or the log does not determine a parameter.
        ComputationError: If the least-squares fit diverges.
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
    options = _Options(
        teeth=teeth,
        ratings=ratings,
        corners=corners,
        layout=layout,
        spring=spring,
        rotor_inertia=rotor_inertia,
        orders=orders,
        hysteresis=hysteresis,
        window=window,
        name=name,
    )
    result = _identified(log, options)
    late = result.estimates.get("link_skew")
    if late is None or abs(late.value) < max(SURE * late.deviation, _SKEW_LEAST):
        return result
    # fit again with simultaneous angles, which also changes harmonics and rates
    again = without_skew(log, late.value)
    result = _identified(again, options)
    rest = result.estimates.get("link_skew")
    if rest is None:
        return result
    whole = replace(rest, value=late.value + rest.value)
    note = (
        f"link_angle was {1e3 * whole.value:.4g} ms behind the other channels"
        f" ({1e3 * whole.low:.4g} to {1e3 * whole.high:.4g} ms); corrected"
    )
    estimates = {**result.estimates, "link_skew": whole}
    return replace(
        result,
        estimates=estimates,
        notes=(*result.notes, note),
        doubts=_doubts_of(result, estimates),
        skew=late.value,
    )


def _doubts_of(
    result: Identified, estimates: Mapping[str, Estimate]
) -> tuple[str, ...]:
    measured = result.model.measured_torques()
    left = {key: rms(r) / rms(measured[key]) for key, r in result.residuals.items()}
    units = [note for note in result.notes if "plausible: " in note]
    return (*doubts_of(estimates, left, result.model.step), *units)


def _identified(log: BenchLog, options: _Options) -> Identified:
    """Identify the parameters from a log without correcting its delay."""
    samples = log.average(options.window)
    model = _model_of(log, samples, options)
    values, residuals, jacobian = _solve(model)
    kappa = max(_correlation(r) for r in residuals.values())
    information = jacobian.T @ jacobian
    undetermined = _undetermined(model, information)
    if undetermined is not None:
        return _without(undetermined, log, options)
    estimates = _estimates(model, values, _covariance(information, kappa))
    element = estimates.get("hysteresis_yield_torque")
    if element is not None and element.low <= 0.0:
        why = f"its yield torque, {element.value:.3g} N·m, is within its uncertainty"
        return _without_element(why, log, options)
    drive, notes = map_of(model, values, name=options.name, source=Path(log.where).name)
    result = Identified(
        estimates=estimates,
        drive=drive,
        samples=samples,
        model=model,
        residuals=residuals,
        correlation=kappa,
        notes=(*notes, *remarks(model, drive, residuals)),
    )
    return replace(result, doubts=_doubts_of(result, estimates))


def _model_of(log: BenchLog, samples: Averaged, options: _Options) -> Model:
    """The model of the log; rejects repeated orders and too few slipping samples."""
    orders = options.orders
    if orders is None:
        whole_turn = np.ptp(samples.link_angle) >= _TURN * 2.0 * np.pi
        orders = ORDERS if whole_turn else ORDERS_OF_PART
    if len({*map(tuple, orders), (0, 0)}) != len(orders) + 1:
        shown = ", ".join(f"{p}:{q}" for p, q in orders)
        raise InputError(f"orders {shown}; accepted: each order once, and not 0:0")
    model = Model.from_log(
        log,
        samples,
        layout=options.layout,
        teeth=options.teeth,
        ratings=options.ratings,
        corners=options.corners,
        spring=options.spring,
        rotor_inertia=options.rotor_inertia,
        orders=orders,
        hysteresis=options.hysteresis,
        skew=options.skew,
    )
    if model.kept.sum() < FEWEST:
        raise InputError(
            f"{log.where}: the wave generator turns in {model.kept.sum()} of"
            f" {model.kept.size} averages; accepted: at least {FEWEST}, or a log"
            " without motor_torque_Nm"
        )
    return model


def _undetermined(model: Model, information: Array) -> str | None:
    """Name of the least determined parameter; None if all are determined."""
    names = [p.name for p in model.unknowns]
    scale = np.sqrt(np.diag(information))
    if not scale.all():
        return names[int(np.argmin(scale))]
    normal = information / np.outer(scale, scale)
    if np.linalg.cond(normal) > 1.0 / _SINGULAR:
        return names[int(np.abs(np.linalg.eigh(normal)[1][:, 0]).argmax())]
    return None


def _covariance(information: Array, kappa: float) -> Array:
    """Covariance of the parameters, in their units."""
    scale = np.sqrt(np.diag(information))
    normal = information / np.outer(scale, scale)
    return np.asarray(kappa * np.linalg.inv(normal) / np.outer(scale, scale))


def _estimates(model: Model, values: Array, covariance: Array) -> dict[str, Estimate]:
    """Every parameter with its standard deviation, by name."""
    deviations = np.sqrt(np.diag(covariance))
    return {
        p.name: Estimate(name=p.name, unit=p.unit, value=float(v), deviation=float(d))
        for p, v, d in zip(model.unknowns, values, deviations, strict=True)
    }


def _without(name: str, log: BenchLog, options: _Options) -> Identified:
    """The result of a model without the undetermined parameter, if it is optional."""
    if name == "link_skew":
        return _identified(log, replace(options, skew=False))
    if name.startswith("hysteresis"):
        return _without_element(f"the log does not determine {name}", log, options)
    raise InputError(
        f"{log.where}: the log does not determine {name}; accepted: a log with both"
        " signs of torque and speed, or fewer orders"
    )


def _without_element(why: str, log: BenchLog, options: _Options) -> Identified:
    """The result of a model without a Jenkin element, with a note that says why."""
    result = _identified(log, replace(options, hysteresis=False))
    return replace(result, notes=(*result.notes, f"no hysteresis: {why}"))


def rms(x: Array) -> float:
    """Root mean square including the mean."""
    return float(np.sqrt(np.mean(x**2)))


def _solve(model: Model) -> tuple[Array, dict[str, Array], Array]:
    """Parameter values, residuals by channel, and the weighted Jacobian."""
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
        solution = least_squares(
            residual,
            values,
            bounds=bounds,
            x_scale=scale,
            max_nfev=60,
            args=(weight,),
        )
        if not np.isfinite(solution.x).all():
            raise ComputationError(
                "identification diverged: check that torques and angles of the log"
                " have the signs of the drive"
            )
        values = solution.x
        got = model.torques(values)
        off = {key: measured[key] - got[key] for key in measured}
        # weight by each channel's own residual; a perfect log has none
        weight = {
            key: 1.0 / max(rms(r), 1e-9 * rms(measured[key]), 1e-12)
            for key, r in off.items()
        }
    # rescale the Jacobian to the final weights for the covariance
    rows = [len(r) for r in off.values()]
    old = np.sqrt([np.mean(r**2) for r in np.split(solution.fun, rows[:-1])])
    jacobian = solution.jac / np.repeat(np.maximum(old, 1e-9), rows)[:, None]
    return values, off, np.asarray(jacobian)


def _correlation(residual: Array) -> float:
    """Factor kappa; the sum ends where the autocorrelation disappears in noise."""
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

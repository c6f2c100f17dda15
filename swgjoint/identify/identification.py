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

from swgjoint.errors import InputError
from swgjoint.flags import check_flags
from swgjoint.gear.kinematics import LAYOUTS, angle_coefficients
from swgjoint.gear.kinematics import ratio as signed_ratio
from swgjoint.gear.ratings import Ratings
from swgjoint.identify.angle_noise import shifts_by_noise
from swgjoint.identify.checks import (
    SHIFTED,
    SMALL,
    SURE,
    check_angles,
    check_ratio,
    check_torques,
    check_torsion,
    describe_shifts,
    doubts_of,
    negative,
    remarks,
    without_skew,
)
from swgjoint.identify.identified_map import map_of
from swgjoint.identify.least_squares import (
    correlation_factor,
    covariance_of,
    effects_of,
    least_determined,
    rms,
    solve,
)
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
LARGEST_ORDER = 1_000_000
"""Largest accepted P or Q of an order; drives have a few hundred teeth."""
DEVIATIONS = 1.96
"""Half width of an interval in standard deviations: 95 % of a normal distribution."""
_TURN = 0.95  # fraction of an output turn that counts as a whole turn
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
    effects: Mapping[str, float]
    """Effect of each parameter on the torques, relative to their rms [-]."""
    correlation: float
    """Correlation factor kappa of the covariance [-]."""
    shifts: Mapping[str, float] = field(default_factory=dict)
    """Shift of each parameter by noise of the angles, in its unit."""
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
    check_flags(hysteresis=hysteresis)
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
    log.number_windows(window)  # gaps in time would look like jumps of the angles
    check_angles(log)
    check_ratio(log, layout, teeth)
    check_torsion(log, signed_ratio(layout, *teeth))
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
    line, share = describe_shifts(estimates, result.shifts)
    noise = [line] if share > SHIFTED else []
    return (*doubts_of(estimates, left, result.effects, result.model), *noise, *units)


def _identified(log: BenchLog, options: _Options) -> Identified:
    """Identify the parameters from a log without correcting its delay."""
    log = log.fill_windows(options.window)
    samples = log.average(options.window)
    model, no_orders = _model_of(log, samples, options)
    values, residuals, jacobian = solve(model)
    kappa = max(correlation_factor(r) for r in residuals.values())
    information = jacobian.T @ jacobian
    undetermined = least_determined(model, information)
    if undetermined is not None:
        return _without(undetermined, log, options)
    estimates = _estimates(model, values, covariance_of(information, kappa))
    element = estimates.get("hysteresis_yield_torque")
    if element is not None and element.low <= 0.0:
        why = f"its yield torque, {element.value:.3g} N·m, is within its uncertainty"
        return _without_element(why, log, options)
    drive, notes = map_of(model, values, name=options.name, source=Path(log.where).name)
    effects = effects_of(model, values, residuals, jacobian)
    small = [line for line, size in negative(estimates, effects) if size <= SMALL]
    shifts = shifts_by_noise(log, model, values, residuals)
    line, share = describe_shifts(estimates, shifts)
    small += [line] if line and share <= SHIFTED else []
    result = Identified(
        estimates=estimates,
        drive=drive,
        samples=samples,
        model=model,
        residuals=residuals,
        effects=effects,
        correlation=kappa,
        shifts=shifts,
        notes=(*notes, *no_orders, *small, *remarks(model, drive, residuals)),
    )
    return replace(result, doubts=_doubts_of(result, estimates))


def _model_of(
    log: BenchLog, samples: Averaged, options: _Options
) -> tuple[Model, list[str]]:
    """The model of the log, and a note if the log is too short for orders.

    Raises:
        InputError: If orders repeat, if torques contradict each other, or if too few
            samples slip.
    """
    orders, notes = options.orders, []
    if orders is None:
        whole_turn = np.ptp(samples.link_angle) >= _TURN * 2.0 * np.pi
        orders = ORDERS if whole_turn else ORDERS_OF_PART
        alpha = angle_coefficients(options.layout)[0]
        turns = np.ptp(alpha[0] * samples.motor_angle + alpha[1] * samples.link_angle)
        if turns < _TURN * 2.0 * np.pi:
            orders = ()
            notes.append(
                "no kinematic error: the wave generator turns by"
                f" {turns / (2.0 * np.pi):.2g} turns relative to the circular spline;"
                f" accepted: at least {_TURN:g} turns, or the orders stated by --orders"
            )
    shown = ", ".join(f"{p}:{q}" for p, q in orders)
    if len({*map(tuple, orders), (0, 0)}) != len(orders) + 1:
        raise InputError(f"orders {shown}; accepted: each order once, and not 0:0")
    if max((abs(n) for pair in orders for n in pair), default=0) > LARGEST_ORDER:
        raise InputError(
            f"orders {shown[:200]}; accepted: -{LARGEST_ORDER} to {LARGEST_ORDER}"
        )
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
    check_torques(model, log.where)
    return model, notes


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

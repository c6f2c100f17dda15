"""Fit of a monotone torsion curve and hysteresis to a measured loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from swgjoint.maps.hysteresis import Jenkin, stretches
from swgjoint.maps.sheet.loop import TorqueLoop
from swgjoint.maps.torsion_law import torque_at_knots
from swgjoint.typing import Array
from swgjoint.units import arcmin

INTERVALS = 48
"""Default number of equal intervals of the torsion curve."""
SOFTEST = 0.02
"""Smallest stiffness of the fit relative to the mean one [-]; it keeps the curve
monotone."""
REACHES = 0.25 * 2.0 ** -np.arange(0.0, 8.5, 0.5)
"""Yield torsions of the candidate elements as fractions of the travel [-], from 25 % to
0.1 %. Elements with larger fractions stick too long to be distinguished from the
spring."""
FAINT = 1e-3
"""Hysteresis below this fraction of the largest torque is neglected [-]. The same
fraction of the total yield torque applies to single elements."""

# of the part of a candidate's signal that neither the spring nor the candidates before
# it have; samples that are farther apart than two yield torsions leave only round-off
_DISTINCT = 1e-9
# weight of the second difference of the stiffness, which matters only without data
_SMOOTH = 1e-4
_SIGNIFICANT = 20.0  # threshold of an F test, far above the effect of noise


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopRecord:
    """Samples and candidate elements that enter the least-squares fit."""

    loop: TorqueLoop
    """The whole measured loop."""
    torque: Array
    """Torque of the samples used in the fit [N·m]. Shape (n,)."""
    torsion: Array
    """Torsion of the samples used in the fit [rad]. Shape (n,)."""
    knots: Array
    """Torsion of the knots [rad]. Shape (n_knots,)."""
    reaches: Array
    """Yield torsions of the candidate elements [rad]. Shape (n_elements,)."""
    signals: Array
    """Torque of each candidate over its yield torque [-]. Shape (n, n_elements)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TorsionFit:
    """Monotone spring and hysteresis of a measured loop."""

    knots: Array
    """Torsion of the knots, zero at zero torque [rad]. Shape (n_knots,)."""
    stiffness: Array
    """Stiffness at the knots, positive [N·m/rad]. Shape (n_knots,)."""
    hysteresis: tuple[Jenkin, ...]
    """Jenkin elements; empty if hysteresis is not significant."""
    report: dict[str, Any]
    """Residuals and figures of the fit; JSON values."""
    record: LoopRecord
    """Samples to which the spring was fitted."""
    yields: Array
    """Yield torques of the candidate elements [N·m]. Shape (n_elements,)."""

    def with_yields(self, yields: Array) -> TorsionFit:
        """The least-squares fit of the spring for given yield torques.

        Args:
            yields: Yield torques of the candidate elements [N·m]. Shape (n_elements,).
        """
        record = self.record
        rest = record.torque - record.signals @ yields
        solution = _solve(record.torsion, rest, record.knots, record.signals[:, :0])
        return _fit_of(record, solution, yields, self.report)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Solution:
    """Solution of the bounded least-squares problem."""

    values: Array
    """Torque at the first knot [N·m], stiffness at the knots [N·m/rad], yield torques
    [N·m]."""
    error: Array
    """Torque of the model minus that of the samples [N·m]."""
    bounded: Array
    """-1 for each value at its lower bound, zero for the others."""

    @property
    def rms(self) -> float:
        """Root mean square of the error [N·m]."""
        return float(np.sqrt(np.mean(self.error**2)))


def fit_torsion(loop: TorqueLoop, *, intervals: int = INTERVALS) -> TorsionFit:
    """Fit of a spring with piecewise linear, positive stiffness, and Jenkin elements.

    The fit is a bounded linear least-squares problem in the torque of the samples: for
    a given yield torsion, the torque of an element along the record is its yield torque
    times a known signal. Samples enter the fit once the record has covered a torsion
    range of twice the largest yield torsion, after which its start no longer affects
    the elements. Candidates that stick for less than the distance of the samples all
    have the same signal; the one with the largest yield torsion stands for them, so
    that the solution is unique. Elements are kept if they reduce the residual by more
    than noise could. A record with one direction of the torque has none. A loop of
    another kind, such as one whose width in torque is smallest in the middle, leaves a
    residual, which the report states.

    Args:
        loop: Measured loop with both signs of the torque.
        intervals: Number of equal intervals of the torsion; reduced if samples are few.
    """
    travel = np.maximum.accumulate(loop.torsion) - np.minimum.accumulate(loop.torsion)
    reaches = REACHES * travel[-1]
    width = loop.hysteresis_loss()
    known = travel >= 2.0 * reaches[0]
    if np.isnan(width):
        known[:] = True
    torque, x = loop.torque[known], loop.torsion[known]
    count = max(1, min(intervals, np.unique(torque).size // 3))
    knots = np.linspace(x.min(), x.max(), count + 1)
    signals = np.column_stack([stretches(loop.torsion, d)[known] / d for d in reaches])
    distinct = _distinct(_spring_basis(x, knots), signals)
    reaches, signals = reaches[distinct], signals[:, distinct]
    record = LoopRecord(
        loop=loop,
        torque=torque,
        torsion=x,
        knots=knots,
        reaches=reaches,
        signals=signals,
    )
    plain = _solve(x, torque, record.knots, record.signals[:, :0])
    solution = plain
    if width > 0.0 and torque.size > count + 2 + reaches.size:
        slipping = _solve(x, torque, record.knots, record.signals)
        better = plain.rms**2 > slipping.rms**2 * (
            1.0 + _SIGNIFICANT * reaches.size / torque.size
        )
        yields = slipping.values[count + 2 :]
        if better and yields.sum() > FAINT * np.abs(torque).max():
            solution = slipping
    yields = np.zeros(reaches.size)
    yields[: solution.values.size - (count + 2)] = solution.values[count + 2 :]
    report = {"residual_rms_without_hysteresis_Nm": plain.rms}
    return _fit_of(record, solution, yields, report)


def _fit_of(
    record: LoopRecord, solution: _Solution, yields: Array, report: dict[str, Any]
) -> TorsionFit:
    """Spring and elements of a solution; the report is completed by their residuals."""
    loop, knots, x = record.loop, record.knots, record.torsion
    stiffness = solution.values[1 : knots.size + 1]
    elements = tuple(
        Jenkin(stiffness=float(f / d), yield_torque=float(f))
        for f, d in zip(yields, record.reaches, strict=True)
        if f > FAINT * yields.sum()
    )
    steps = 0.5 * np.diff(knots) * (stiffness[1:] + stiffness[:-1])
    at_knots = solution.values[0] + np.concatenate([[0.0], np.cumsum(steps)])
    zero = _inverse(0.0, knots, stiffness, at_knots)
    shifted = knots - zero
    turned = np.abs(solution.error / np.interp(x, knots, stiffness)) / arcmin
    width = loop.hysteresis_loss()
    return TorsionFit(
        knots=shifted,
        stiffness=stiffness,
        hysteresis=elements,
        record=record,
        yields=yields,
        report=report
        | {
            "samples": int(loop.torque.size),
            "samples_used": int(record.torque.size),
            "branches": "one" if np.isnan(width) else "both",
            "intervals": knots.size - 1,
            "elements": len(elements),
            "yield_torque_Nm": float(sum(e.yield_torque for e in elements)),
            "residual_rms_Nm": solution.rms,
            "residual_max_Nm": float(np.abs(solution.error).max()),
            "residual_rms_arcmin": float(np.sqrt(np.mean(turned**2))),
            "residual_max_arcmin": float(turned.max()),
            "torsion_at_zero_torque_arcmin": zero / arcmin,
            "hysteresis_loss_arcmin": None if np.isnan(width) else width / arcmin,
            "torque_range_Nm": [
                float(v) for v in torque_at_knots(shifted, stiffness)[[0, -1]]
            ],
            "at_softest": int((solution.bounded[1 : knots.size + 1] != 0).sum()),
        },
    )


def _solve(x: Array, torque: Array, knots: Array, signals: Array) -> _Solution:
    """Torque at the first knot, stiffness at the knots and yield torques."""
    from scipy.optimize import lsq_linear

    count, elements = knots.size - 1, signals.shape[1]
    h, secant = float(knots[1] - knots[0]), float(np.ptp(torque) / np.ptp(x))
    # unknowns: torques relative to h * secant, stiffness relative to the secant
    basis = np.column_stack([_spring_basis(x, knots), signals])
    bend = np.zeros((max(0, count - 1), basis.shape[1]))
    for row in range(len(bend)):
        bend[row, row + 1 : row + 4] = (1.0, -2.0, 1.0)
    matrix = np.vstack([basis, _SMOOTH * np.sqrt(torque.size) * bend])
    wanted = np.concatenate([torque / (h * secant), np.zeros(len(bend))])
    # R of the QR decomposition has the same solution but only as many rows as unknowns
    q, r = np.linalg.qr(matrix)
    lowest = np.r_[-np.inf, np.full(count + 1, SOFTEST), np.zeros(elements)]
    solution = lsq_linear(r, q.T @ wanted, bounds=(lowest, np.inf), method="bvls")
    unit = np.r_[h * secant, np.full(count + 1, secant), np.full(elements, h * secant)]
    return _Solution(
        values=solution.x * unit,
        error=(basis @ solution.x) * (h * secant) - torque,
        bounded=solution.active_mask,
    )


def _distinct(spring: Array, signals: Array) -> Array:
    """Which signals are not sums of the spring and the signals before them. Bool (m,).

    Args:
        spring: Columns of the spring. Shape (n, k), n >= k.
        signals: Signals of the candidate elements. Shape (n, m).
    """
    known = np.linalg.qr(spring)[0]
    keep = np.zeros(signals.shape[1], dtype=bool)
    for i, signal in enumerate(signals.T):
        rest = signal.copy()
        for _ in range(2):  # once more removes what the first pass leaves by round-off
            rest -= known @ (known.T @ rest)
        size = np.linalg.norm(rest)
        keep[i] = size > _DISTINCT * np.linalg.norm(signal)
        if keep[i]:
            known = np.column_stack([known, rest / size])
    return keep


def _spring_basis(x: Array, knots: Array) -> Array:
    """Torque of the spring per unit of its unknowns [-]. Shape (n, n_knots + 1)."""
    h = float(knots[1] - knots[0])
    return np.column_stack([np.ones_like(x), _integrals(x, knots) / h])


def _integrals(x: Array, knots: Array) -> Array:
    """Integral of every hat function from the first knot to x [rad]. (n, n_knots)."""
    h = float(knots[1] - knots[0])
    s = np.clip((x[:, None] - knots[:-1]) / h, 0.0, 1.0)  # fraction of each interval
    table = np.zeros((x.size, knots.size))
    table[:, :-1] += h * (s - 0.5 * s**2)  # the falling half
    table[:, 1:] += h * 0.5 * s**2  # the rising half
    return table


def _inverse(torque: float, knots: Array, stiffness: Array, at: Array) -> float:
    """Torsion at a torque inside the range [rad], on the parabola of its interval."""
    j = int(np.clip(np.searchsorted(at, torque) - 1, 0, knots.size - 2))
    bend = 0.5 * (stiffness[j + 1] - stiffness[j]) / (knots[j + 1] - knots[j])
    rest = torque - at[j]
    # form of the root without cancellation for a small bend
    root = np.sqrt(max(0.0, stiffness[j] ** 2 + 4.0 * bend * rest))
    return float(knots[j] + 2.0 * rest / (stiffness[j] + root))

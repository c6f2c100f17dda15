"""A monotone torsion curve through the mid-line of a measured loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.maps.loop import TorqueLoop
from swgjoint.maps.torsion_law import torque_at_knots
from swgjoint.units import arcmin

Array = NDArray[np.float64]

INTERVALS = 16
SOFTEST = 0.02
"""Smallest stiffness of the fit, of the mean one: the curve stays monotone."""

_SMOOTH = 1e-4  # weight of the bend of the stiffness: decides only where data is absent


@dataclass(frozen=True, kw_only=True, eq=False)
class TorsionFit:
    """Monotone mid-line of a measured loop."""

    knots: Array
    """Torsion from the position of zero torque [rad]."""
    stiffness: Array
    """At the knots, positive [N·m/rad]."""
    report: dict[str, Any]


def fit_torsion(loop: TorqueLoop, *, intervals: int = INTERVALS) -> TorsionFit:
    """Mid-line of a loop with piecewise linear, positive stiffness.

    Bounded linear least squares on the torque of the mid-line at every sampled torque
    that both branches reach.

    Args:
        loop: Both signs of the torque.
        intervals: Equal pieces of the torsion, fewer for few samples.
    """
    from scipy.optimize import lsq_linear

    torque = np.unique(loop.torque)
    branches = [loop.branch(torque, rising=r) for r in (True, False)]
    known = ~np.isnan(branches)
    both = known.all(axis=0)
    # a curve of one direction has no other branch
    use = both if both.sum() >= 8 else known.any(axis=0)
    torque, x = torque[use], loop.mid_line(torque[use])

    count = max(1, min(intervals, torque.size // 3))
    knots = np.linspace(x.min(), x.max(), count + 1)
    h, secant = float(knots[1] - knots[0]), float(np.ptp(torque) / np.ptp(x))
    # unknowns: torque at the first knot over h secant, stiffness over the secant
    basis = np.column_stack([np.ones_like(x), _integrals(x, knots) / h])
    bend = np.zeros((max(0, count - 1), count + 2))
    for row in range(len(bend)):
        bend[row, row + 1 : row + 4] = (1.0, -2.0, 1.0)
    weight = _SMOOTH * np.sqrt(torque.size)
    solution = lsq_linear(
        np.vstack([basis, weight * bend]),
        np.concatenate([torque / (h * secant), np.zeros(len(bend))]),
        bounds=(np.r_[-np.inf, np.full(count + 1, SOFTEST)], np.inf),
        method="bvls",
    )
    stiffness = secant * solution.x[1:]
    at_knots = h * secant * solution.x[0] + np.concatenate(
        [[0.0], np.cumsum(0.5 * h * (stiffness[1:] + stiffness[:-1]))]
    )
    zero = _inverse(0.0, knots, stiffness, at_knots)
    shifted = knots - zero
    error = basis @ solution.x * (h * secant) - torque
    local = np.interp(x, knots, stiffness)
    width = loop.hysteresis_loss()
    return TorsionFit(
        knots=shifted,
        stiffness=stiffness,
        report={
            "samples": int(loop.torque.size),
            "mid_line_points": int(torque.size),
            "branches": "both" if use is both else "one",
            "intervals": count,
            "residual_rms_Nm": float(np.sqrt(np.mean(error**2))),
            "residual_max_Nm": float(np.abs(error).max()),
            "residual_rms_arcmin": float(np.sqrt(np.mean((error / local) ** 2)))
            / arcmin,
            "residual_max_arcmin": float(np.abs(error / local).max()) / arcmin,
            "torsion_at_zero_torque_arcmin": zero / arcmin,
            "hysteresis_loss_arcmin": None if np.isnan(width) else width / arcmin,
            "torque_range_Nm": [
                float(v) for v in torque_at_knots(shifted, stiffness)[[0, -1]]
            ],
            "at_softest": int((solution.active_mask[1:] != 0).sum()),
        },
    )


def _integrals(x: Array, knots: Array) -> Array:
    """Integral of every hat function from the first knot to x. (n, n_knots)."""
    h = float(knots[1] - knots[0])
    s = np.clip((x[:, None] - knots[:-1]) / h, 0.0, 1.0)  # way through each interval
    table = np.zeros((x.size, knots.size))
    table[:, :-1] += h * (s - 0.5 * s**2)  # the falling half
    table[:, 1:] += h * 0.5 * s**2  # the rising half
    return table


def _inverse(torque: float, knots: Array, stiffness: Array, at: Array) -> float:
    """Torsion at a torque inside the range, on the parabola of its interval."""
    j = int(np.clip(np.searchsorted(at, torque) - 1, 0, knots.size - 2))
    bend = 0.5 * (stiffness[j + 1] - stiffness[j]) / (knots[j + 1] - knots[j])
    rest = torque - at[j]
    # the root in the form that does not cancel for a small bend
    root = np.sqrt(max(0.0, stiffness[j] ** 2 + 4.0 * bend * rest))
    return float(knots[j] + 2.0 * rest / (stiffness[j] + root))

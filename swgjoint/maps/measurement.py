"""A drive map from measurements: a torque-torsion loop and a kinematic-error record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import LAYOUTS, angle_coefficients
from swgjoint.gear.kinematics import ratio as signed_ratio
from swgjoint.maps.csv_columns import read_columns
from swgjoint.maps.drive_map import DriveMap, Ratings
from swgjoint.maps.loop import TorqueLoop
from swgjoint.maps.torsion_law import potential_of_stiffness, torque_at_knots
from swgjoint.units import arcmin, deg

Array = NDArray[np.float64]

TORQUE = {"torque_Nm": 1.0}
TORSION = {"torsion_arcmin": arcmin, "torsion_rad": 1.0}
OUTPUT = {"output_deg": deg, "output_rad": 1.0}
ERROR = {"error_arcmin": arcmin, "error_rad": 1.0}

ORDERS: tuple[tuple[int, int], ...] = (
    *((p, 0) for p in range(1, 7)),
    *((0, q) for q in range(1, 7)),
    (1, -1),
    (2, -2),
)
"""(p, q) of p alpha + q beta that a record is searched for: low orders of either
member, and the output turn itself."""
INTERVALS = 16
KEEP = 0.01
"""Harmonics of the error are kept from this part of the largest one."""
SOFTEST = 0.02
"""Smallest stiffness of the fit, of the mean one: the curve stays monotone."""

_SMOOTH = 1e-4  # weight of the bend of the stiffness: decides only where data is absent
_PER_WAVE = 2.5  # samples that tell a wave
_TURN = 0.98  # of a turn that a record must cover
_REZERO = 4  # passes that settle the constant of a record
_CONDITION = 1e4  # beyond, two orders of the record cannot be told apart

Map = TypeVar("Map", bound=DriveMap)


@dataclass(frozen=True, kw_only=True, eq=False)
class TorsionFit:
    """Monotone mid-line of a measured loop."""

    knots: Array
    """Torsion from the position of zero torque [rad]."""
    stiffness: Array
    """At the knots, positive [N·m/rad]."""
    report: dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorFit:
    """Harmonics of a measured kinematic error."""

    orders: NDArray[np.int64]
    """(p, q). Shape (n, 2)."""
    amplitudes: Array
    """Cosine and sine [rad]. Shape (n, 2)."""
    report: dict[str, Any]


def read_loop(path: str | Path) -> TorqueLoop:
    """Loop from a CSV file: ``torque_Nm`` and ``torsion_arcmin`` or ``torsion_rad``.

    Raises:
        InputError: If the file is no loop over both signs of the torque.
    """
    data = read_columns(path, {"torque": TORQUE, "torsion": TORSION})
    torque, torsion = data["torque"], data["torsion"]
    if torque.size < 8:
        raise InputError(f"{path}: {torque.size} samples; accepted: at least 8")
    low, high = float(torque.min()), float(torque.max())
    if not (low < 0.0 < high and min(-low, high) > 0.05 * max(-low, high)):
        raise InputError(
            f"{path}: torque_Nm from {low:g} to {high:g} N·m; accepted: both signs"
        )
    loop = TorqueLoop(torque=torque, torsion=torsion)
    ends = loop.mid_line(np.array([0.9 * low, 0.9 * high]))
    if not ends[1] > ends[0]:
        raise InputError(
            f"{path}: torsion does not grow with the torque; accepted: both of one sign"
        )
    return loop


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


def fit_error(
    output: Array,
    error: Array,
    *,
    layout: str,
    teeth_flexspline: int,
    teeth_circular_spline: int,
    orders: Sequence[tuple[int, int]] = ORDERS,
    where: str = "record",
) -> ErrorFit:
    """Harmonics of alpha and beta in a record of one output turn, by least squares.

    Args:
        output: Output angle psi [rad]. Shape (n,).
        error: psi - theta/i, unloaded [rad]. Shape (n,).
        layout: Which member is fixed.
        teeth_flexspline: z_fs.
        teeth_circular_spline: z_cs.
        orders: (p, q) to look for; those that the samples cannot tell are listed.
        where: Name of the record for messages.

    Raises:
        InputError: If the record is shorter than a turn or cannot tell the orders.
    """
    span = float(np.ptp(output)) if output.size else 0.0
    if span < _TURN * 2.0 * np.pi or output.size < 16:
        raise InputError(
            f"{where}: {output.size} samples over {span / deg:g} deg of the output;"
            " accepted: one turn, 360 deg, with at least 16 samples"
        )
    i = signed_ratio(layout, teeth_flexspline, teeth_circular_spline)
    wanted = np.array([pq for pq in orders if tuple(pq) != (0, 0)], dtype=np.int64)
    if wanted.ndim != 2 or wanted.shape[1] != 2:
        raise InputError(f"orders {orders!r}; accepted: pairs (p, q) of whole numbers")
    n = wanted @ np.array(angle_coefficients(layout), dtype=np.int64)
    per_turn = np.abs(n[:, 0] * i + n[:, 1])
    fits = per_turn * _PER_WAVE <= output.size / (span / (2.0 * np.pi))
    unresolved = wanted[~fits].tolist()
    wanted, n = wanted[fits], n[fits]
    if not len(wanted):
        raise InputError(
            f"{where}: {output.size} samples tell none of the orders; accepted: at"
            f" least {_PER_WAVE * per_turn.min():.0f} a turn"
        )

    def solve(n: NDArray[np.int64]) -> tuple[Array, Array]:
        # the error is zeroed anywhere; its mean over the gear's angles turns the input
        constant = 0.0
        for _ in range(_REZERO):
            theta = i * (output - error + constant)
            phases = np.stack([theta, output], axis=-1) @ n.T.astype(float)
            constant, pairs, rest = project(phases)
        return pairs, rest

    def project(columns: Array) -> tuple[float, Array, Array]:
        parts = [np.ones((output.size, 1)), np.cos(columns), np.sin(columns)]
        basis = np.hstack(parts)
        weights, _, rank, sizes = np.linalg.lstsq(basis, error, rcond=None)
        if rank < basis.shape[1] or sizes[0] > _CONDITION * sizes[-1]:
            raise InputError(
                f"{where}: its orders cannot be told apart; give fewer 'orders' or a"
                " record of equal steps over the whole turn"
            )
        count = columns.shape[1]
        pairs = np.stack([weights[1 : 1 + count], weights[1 + count :]], axis=-1)
        return float(weights[0]), pairs, error - basis @ weights

    pairs, _ = solve(n)
    size = np.hypot(*pairs.T)
    keep = size >= max(KEEP * float(size.max()), 1e-300)
    dropped = [
        {"alpha": int(p), "beta": int(q), "error_arcmin": float(a) / arcmin}
        for (p, q), a in zip(wanted[~keep], size[~keep], strict=True)
    ]
    pairs, rest = solve(n[keep])
    size = np.hypot(*pairs.T)
    return ErrorFit(
        orders=wanted[keep],
        amplitudes=pairs,
        report={
            "samples": int(output.size),
            "turns": span / (2.0 * np.pi),
            "peak_to_peak_arcmin": float(np.ptp(error)) / arcmin,
            "residual_rms_arcmin": float(np.sqrt(np.mean(rest**2))) / arcmin,
            "residual_max_arcmin": float(np.abs(rest).max()) / arcmin,
            "harmonics": [
                {"alpha": int(p), "beta": int(q), "error_arcmin": float(a) / arcmin}
                for (p, q), a in zip(wanted[keep], size, strict=True)
            ],
            "dropped": dropped,
            "unresolved": unresolved,
        },
    )


def map_from_measurement(
    path: str | Path,
    cls: type[Map],
    *,
    teeth_flexspline: int,
    teeth_circular_spline: int,
    ratings: Ratings | float,
    kinematic_error: str | Path | None = None,
    layout: str = "circular_spline_fixed",
    orders: Sequence[tuple[int, int]] = ORDERS,
    intervals: int = INTERVALS,
    damping_ratio: float = 0.02,
    name: str | None = None,
) -> Map:
    """The map of a measured drive; see :meth:`DriveMap.from_measurement`."""
    if layout not in LAYOUTS:
        raise InputError(f"layout {layout!r}; accepted: {', '.join(LAYOUTS)}")
    if not 0 < teeth_flexspline < teeth_circular_spline:
        raise InputError(
            f"teeth {teeth_flexspline} and {teeth_circular_spline}; accepted: 0 <"
            " flexspline < circular spline"
        )
    if intervals < 1:
        raise InputError(f"intervals {intervals}; accepted: 1 and more")
    loop = read_loop(path)
    fit = fit_torsion(loop, intervals=intervals)
    info: dict[str, Any] = {
        "source": f"measurement {Path(path).name}",
        "fit": {"torsion": fit.report},
        "missing": {},
    }
    width = fit.report["hysteresis_loss_arcmin"]
    measured = (
        "" if width is None else f"; the measured loop is {width:.4g} arcmin wide"
    )
    info["missing"]["hysteresis_loss_arcmin"] = (
        f"the map is the mid-line of the loop, conservative{measured}"
    )
    harmonics = np.zeros((1, 2), dtype=np.int64)
    amplitudes = np.zeros((1, 2))
    if kinematic_error is not None:
        record = read_columns(kinematic_error, {"output": OUTPUT, "error": ERROR})
        found = fit_error(
            record["output"],
            record["error"],
            layout=layout,
            teeth_flexspline=teeth_flexspline,
            teeth_circular_spline=teeth_circular_spline,
            orders=orders,
            where=str(kinematic_error),
        )
        info["source"] += f", {Path(kinematic_error).name}"
        info["fit"]["kinematic_error"] = found.report
        harmonics = np.concatenate([harmonics, found.orders])
        amplitudes = np.concatenate([amplitudes, found.amplitudes])
    else:
        info["missing"] |= dict.fromkeys(
            (
                "transmission_accuracy_arcmin",
                "transmission_accuracy_rated_arcmin",
                "ripple_rms_percent",
                "ripple_pp_percent",
                "orders",
            ),
            "no record of the kinematic error was given",
        )
    potential, ends = potential_of_stiffness(
        fit.knots, fit.stiffness, n_harmonics=len(harmonics)
    )
    return cls(
        name=name or Path(path).stem,
        level="measurement",
        layout=layout,
        teeth_flexspline=teeth_flexspline,
        teeth_circular_spline=teeth_circular_spline,
        torsion_knots=fit.knots,
        orders=harmonics,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=amplitudes,
        ratings=_ratings(ratings, float(np.abs(loop.torque).max())),
        damping_ratio=damping_ratio,
        info=info,
    )


def _ratings(given: Ratings | float, largest: float) -> Ratings:
    """Ratings as given, or around a rated torque and the largest of the loop."""
    if isinstance(given, Ratings):
        return given
    rated = float(given)
    if not (np.isfinite(rated) and rated > 0.0):
        raise InputError(f"rated torque {rated:g} N·m; accepted: > 0 N·m")
    peak = max(rated, largest)
    return Ratings(
        rated_torque=rated,
        repeated_peak=peak,
        momentary_peak=peak,
        T1=0.2 * rated,
        T2=0.6 * rated,
        source=f"rated torque given; peaks from the loop to {largest:g} N·m; T1, T2 are"
        " 0.2 and 0.6 of rated",
    )

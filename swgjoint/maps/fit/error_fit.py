"""Harmonics of a measured kinematic error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.gear.kinematics import ratio as signed_ratio
from swgjoint.typing import Array
from swgjoint.units import arcmin, deg

ORDERS: tuple[tuple[int, int], ...] = (
    *((p, 0) for p in range(1, 7)),
    *((0, q) for q in range(1, 7)),
    (1, -1),
    (2, -2),
)
"""Orders (p, q) of p alpha + q beta that are fitted to a record: one to six cycles per
turn of alpha and of beta, and one and two cycles per turn of alpha - beta, which is the
output angle up to sign if the wave generator is the input."""
APART = 0.1
"""Rest of a record relative to its rms above which a warning is given [-]."""
KEEP = 0.01
"""A harmonic is kept if its amplitude reaches this fraction of the largest one."""

_PER_WAVE = 2.5  # samples needed per cycle
_TURN = 0.98  # fraction of an output turn that a record must cover
_REZERO = 4  # iterations for the constant offset of a record
_CONDITION = 1e4  # condition number above which two orders cannot be distinguished


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorFit:
    """Harmonics of a measured kinematic error."""

    orders: NDArray[np.int64]
    """Orders (p, q). Shape (n, 2)."""
    amplitudes: Array
    """Cosine and sine amplitudes [rad]. Shape (n, 2)."""
    report: dict[str, Any]
    """Residuals, kept, dropped and unresolved orders; JSON values."""

    def warnings(self) -> list[str]:
        """One line on orders that the samples do not resolve, one on a large rest."""
        found, lines = self.report, []
        if missing := found["unresolved"]:
            lines.append(
                f"kinematic error: {found['samples'] / found['turns']:.0f} samples per"
                " output turn do not resolve the orders"
                f" {', '.join(f'{p}:{q}' for p, q in missing)} (waves per turn of the"
                " wave generator against circular spline and flexspline), which the map"
                f" lacks; all of them need {found['samples_needed']:.0f}"
            )
        rest, rms = found["residual_rms_arcmin"], found["rms_arcmin"]
        if rest > APART * rms > 0.0:
            lines.append(
                f"kinematic error: the harmonics of the map leave {rest:.4g} arcmin"
                f" rms, {rest / rms:.0%} of the record: noise, drift, other orders, or"
                " other units"
            )
        return lines


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
    """Fit harmonics of alpha and beta to a record of one output turn.

    Args:
        output: Output angle psi [rad]. Shape (n,).
        error: Unloaded error psi - theta/i [rad]. Shape (n,).
        layout: Which member is fixed.
        teeth_flexspline: Number of teeth of the flexspline, z_fs.
        teeth_circular_spline: Number of teeth of the circular spline, z_cs.
        orders: Pairs (p, q) to fit. The report lists those that the samples do not
            resolve; (0, 0) is ignored.
        where: Name of the record in messages.

    Raises:
        InputError: If the record is shorter than an output turn, resolves none of the
            orders or cannot distinguish them.
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
        raise InputError(f"orders {orders!r}; accepted: pairs (p, q) of integers")
    n = wanted @ np.array(angle_coefficients(layout), dtype=np.int64)
    per_turn = np.abs(n[:, 0] * i + n[:, 1])
    fits = per_turn * _PER_WAVE <= output.size / (span / (2.0 * np.pi))
    unresolved = wanted[~fits].tolist()
    wanted, n = wanted[fits], n[fits]
    if not len(wanted):
        raise InputError(
            f"{where}: {output.size} samples resolve none of the orders; accepted: at"
            f" least {_PER_WAVE * per_turn.min():.0f} per output turn"
        )

    def solve(n: NDArray[np.int64]) -> tuple[Array, Array]:
        """Amplitudes (n_orders, 2) and residual of the record."""
        # the zero of the error is arbitrary; its constant part shifts the input angle
        constant = 0.0
        for _ in range(_REZERO):
            theta = i * (output - error + constant)
            phases = np.stack([theta, output], axis=-1) @ n.T.astype(float)
            constant, pairs, rest = project(phases)
        return pairs, rest

    def project(columns: Array) -> tuple[float, Array, Array]:
        """Constant, amplitudes and residual by least squares at given phases."""
        parts = [np.ones((output.size, 1)), np.cos(columns), np.sin(columns)]
        basis = np.hstack(parts)
        weights, _, rank, sizes = np.linalg.lstsq(basis, error, rcond=None)
        if rank < basis.shape[1] or sizes[0] > _CONDITION * sizes[-1]:
            raise InputError(
                f"{where}: the orders cannot be distinguished; use fewer 'orders' or a"
                " record with equal steps over the whole turn"
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
            "rms_arcmin": float(np.std(error)) / arcmin,
            "residual_rms_arcmin": float(np.sqrt(np.mean(rest**2))) / arcmin,
            "residual_max_arcmin": float(np.abs(rest).max()) / arcmin,
            "harmonics": [
                {"alpha": int(p), "beta": int(q), "error_arcmin": float(a) / arcmin}
                for (p, q), a in zip(wanted[keep], size, strict=True)
            ],
            "dropped": dropped,
            "unresolved": unresolved,
            "samples_needed": _PER_WAVE * float(per_turn.max()),
        },
    )

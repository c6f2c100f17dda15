"""Quantities of observations and actions, with their units and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log10

import numpy as np

from swgjoint.typing import Array
from swgjoint.units import arcmin

TRACKED = 50.0 * arcmin
"""Largest observed link error [rad], twenty times the error of a rigid plan; relevant
errors would be a tiny fraction of a much wider range. Larger errors are clipped."""
REGAINED = 0.1
"""Time in which the largest observed speed error accumulates to that error [s]."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One quantity of an observation or an action, with its unit and its bounds."""

    meaning: str
    """Name of the quantity for tables."""
    unit: str
    low: float
    high: float
    count: int = 1
    """Number of values of this quantity, e.g. one per joint."""


def table(entries: Sequence[Entry]) -> str:
    """Table of the entries as text for a docstring."""
    rows, first = [("index", "meaning", "unit", "range")], 0
    for e in entries:
        index = str(first) if e.count == 1 else f"{first}-{first + e.count - 1}"
        rows.append((index, e.meaning, e.unit, f"{e.low:.5g} to {e.high:.5g}"))
        first += e.count
    widths = [max(len(row[c]) for row in rows) for c in range(4)]
    line = "  ".join("=" * w for w in widths)
    text = ["  ".join(x.ljust(w) for x, w in zip(r, widths, strict=True)) for r in rows]
    return "\n".join(t.rstrip() for t in [line, text[0], line, *text[1:], line])


def bounds(entries: Sequence[Entry]) -> tuple[Array, Array]:
    """Lower and upper bounds of all values. Shapes (n_values,)."""
    low, high = np.array([(e.low, e.high) for e in entries for _ in range(e.count)]).T
    return low, high


def error_bounds(
    ratio: float, *, speed: float, acceleration: float, age: float, period: float
) -> tuple[float, float]:
    """Bounds of the observed errors of motor angle [rad] and motor speed [rad/s].

    A reading is compared with the current reference, so the bounds include the change
    of the reference during the age of the reading.

    Args:
        ratio: Ratio of the drive [-].
        speed: Largest speed of the reference at the link [rad/s].
        acceleration: Largest acceleration of the reference at the link [rad/s²].
        age: Age of the readings [s].
        period: Control period, over which speeds are measured [s].
    """
    i = abs(ratio)
    return (
        ceiling(i * (TRACKED + speed * age)),
        ceiling(i * (TRACKED / REGAINED + acceleration * (age + 0.5 * period))),
    )


def ceiling(value: float) -> float:
    """Value > 0 rounded up to two significant digits, for bounds in a table."""
    digit = 10.0 ** (floor(log10(value)) - 1)
    return max(value, float(f"{np.ceil(value / digit * (1.0 - 1e-9)) * digit:.6g}"))

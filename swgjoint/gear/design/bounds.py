"""The value nearest to a rejected one that is accepted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor, isfinite, log, log10

STEP = 1.05
"""Factor between values that are tried."""
REACH = 20.0
"""Largest factor from the rejected value."""
DIGITS = 4
"""Of a bound, rounded to the accepted side."""


@dataclass(frozen=True, kw_only=True)
class AcceptedBound:
    """How far a value must go until it is accepted."""

    rejected: float
    accepted: float
    """Nearest accepted value, rounded to :data:`DIGITS` digits."""

    @property
    def sign(self) -> str:
        """``<=`` or ``>=``."""
        return "<=" if self.accepted < self.rejected else ">="

    @property
    def change(self) -> float:
        """Size of the change as a logarithm, to rank several keys by [-]."""
        return abs(log(self.accepted / self.rejected))


def nearest_bound(
    value: float,
    accepts: Callable[[float], bool],
    *,
    low: float = 0.0,
    high: float = float("inf"),
) -> AcceptedBound | None:
    """Nearest accepted value on either side of a rejected positive one.

    Values are tried in steps of 5 % up to a factor of 20, the smallest change first;
    between the last rejected and the first accepted one the bound is bisected. An
    accepted range narrower than a step may be missed.

    Args:
        value: The rejected value; None is found for one that is not positive.
        accepts: Whether a value is accepted.
        low: Values are above this.
        high: Values are at most this.

    Returns:
        The bound, or None where nothing within reach is accepted.
    """
    if not (value > 0.0 and isfinite(value)):
        return None
    steps = int(log(REACH) / log(STEP))
    for k in range(1, steps + 1):
        for factor in (STEP, 1.0 / STEP):
            tried, before = value * factor**k, value * factor ** (k - 1)
            if low < tried <= high and accepts(tried):
                return AcceptedBound(
                    rejected=value, accepted=_bisected(before, tried, accepts)
                )
    return None


def _bisected(
    rejected: float, accepted: float, accepts: Callable[[float], bool]
) -> float:
    """Accepted value within 1e-5 of the bound, rounded where the round one is too."""
    while abs(accepted / rejected - 1.0) > 1e-5:
        middle = 0.5 * (rejected + accepted)
        if accepts(middle):
            accepted = middle
        else:
            rejected = middle
    digits = DIGITS - 1 - floor(log10(accepted))
    unit = 10.0**-digits
    toward = unit if accepted > rejected else -unit
    for candidate in (round(accepted, digits), round(accepted + toward, digits)):
        if candidate > 0.0 and accepts(candidate):
            return candidate
    return accepted

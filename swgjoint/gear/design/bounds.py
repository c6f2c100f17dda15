"""Search for the accepted value nearest to a rejected one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor, isfinite, log, log10

STEP = 1.05
"""Factor between successive trial values [-]."""
REACH = 20.0
"""Largest factor between a trial value and the rejected value [-]."""
DIGITS = 4
"""Significant digits of a bound, which is rounded towards the accepted values."""


@dataclass(frozen=True, kw_only=True)
class AcceptedBound:
    """A rejected value and the nearest accepted value, in the same unit."""

    rejected: float
    """Value that was rejected."""
    accepted: float
    """Nearest accepted value, rounded to :data:`DIGITS` digits if the rounded value is
    accepted, too."""

    @property
    def sign(self) -> str:
        """Relation of accepted values to the bound, ``<=`` or ``>=``."""
        return "<=" if self.accepted < self.rejected else ">="

    @property
    def change(self) -> float:
        """Absolute logarithm of accepted over rejected value, to compare keys [-]."""
        return abs(log(self.accepted / self.rejected))


def nearest_bound(
    value: float,
    accepts: Callable[[float], bool],
    *,
    low: float = 0.0,
    high: float = float("inf"),
) -> AcceptedBound | None:
    """Nearest accepted value above or below a rejected positive value.

    The search tries values in steps of 5 % up to a factor of 20, smallest change first,
    and then bisects between the last rejected and the first accepted value. It may miss
    an accepted range that is narrower than one step.

    Args:
        value: The rejected value, positive and finite.
        accepts: Returns whether a value is accepted.
        low: Trial values are greater than this.
        high: Trial values are at most this.

    Returns:
        The bound; None if no trial value is accepted, or if ``value`` is not positive
        and finite.
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
    """Accepted value within 1e-5 of the bound, rounded if that is accepted, too.

    ``rejected`` and ``accepted`` are values on both sides of the bound.
    """
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

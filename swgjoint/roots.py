"""Roots of functions of one variable, without an import of SciPy.

Importing SciPy's root searches takes longer than all root searches of a run.
"""

from __future__ import annotations

from collections.abc import Callable

_STEPS = 100  # bisection alone needs fewer


def find_root(
    function: Callable[[float], float],
    low: float,
    high: float,
    *,
    xtol: float,
    rtol: float,
) -> float:
    """Root of a continuous function between two points, by Brent's method.

    The result has the bits of ``scipy.optimize.brentq``.

    Args:
        function: The function; its values at both ends have opposite signs, or one of
            them is zero.
        low: One end.
        high: The other end.
        xtol: Absolute tolerance of the root, in its unit.
        rtol: Relative tolerance of the root [-].

    Source:
        Brent (1973), "Algorithms for Minimization without Derivatives", Prentice-Hall,
        chapter 4.
    """
    before, x = low, high
    f_before, f = function(before), function(x)
    if f_before == 0.0:
        return before
    other, f_other, last = before, f_before, 0.0
    step = last
    for _ in range(_STEPS):
        if f_before != 0.0 and f != 0.0 and (f_before < 0.0) != (f < 0.0):
            other, f_other = before, f_before  # the root is between it and x
            last = step = x - before
        if abs(f_other) < abs(f):
            before, x, other = x, other, x
            f_before, f, f_other = f, f_other, f
        delta, half = 0.5 * (xtol + rtol * abs(x)), 0.5 * (other - x)
        if f == 0.0 or abs(half) < delta:
            break
        trial = half
        if abs(last) > delta and abs(f) < abs(f_before):
            if before == other:  # secant
                trial = -f * (x - before) / (f - f_before)
            else:  # inverse quadratic extrapolation
                p, q = (f_before - f) / (before - x), (f_other - f) / (other - x)
                trial = (
                    -f * (f_other * q - f_before * p) / (q * p * (f_other - f_before))
                )
            if not 2.0 * abs(trial) < min(abs(last), 3.0 * abs(half) - delta):
                trial = step = half
        else:
            step = half
        last, step = step, trial
        before, f_before = x, f
        x += step if abs(step) > delta else (delta if half > 0.0 else -delta)
        f = function(x)
    return x

"""Piecewise quartics with given value, slope and second derivative at their knots."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from swgjoint.typing import Array


def quartic_chain(knots: Array, values: Array) -> tuple[Array, Array]:
    """Piecewise quartics with given value, slope and second derivative at the knots.

    Every interval is cut in half; at the midpoint the two quartics agree in value and
    three derivatives.

    Args:
        knots: Increasing knots. Shape (n,).
        values: V, V' and V'' at the knots, of any number of chains. Shape (..., 3, n).

    Returns:
        Breakpoints (2 n - 1,), and for each piece the coefficients in ascending powers
        of the distance from its first breakpoint (..., 2 n - 2, 5).
    """
    known, condition = _at_end()
    half = 0.5 * np.diff(knots)
    scale = half ** np.arange(3)[:, None]
    start, end = values[..., :-1] * scale, values[..., 1:] * scale
    # coefficients first: a0 to a4 on the left, b0 to b4 on the right of a midpoint
    pieces = np.empty((5, *values.shape[:-2], half.size, 2))
    low = start / np.array([[1.0], [1.0], [2.0]])
    high = np.linalg.solve(condition, end - known @ low)
    left, right = pieces[..., 0], pieces[..., 1]
    left[:3], left[3:] = np.moveaxis(low, -2, 0), np.moveaxis(high, -2, 0)[:2]
    for j in range(4):
        right[j] = sum(comb(k, j) * left[k] for k in range(j, 5))
    right[4] = high[..., 2, :]
    powers = half ** np.arange(5)[:, None]
    for k in range(1, 5):
        pieces[k] /= powers[k, :, None]
    breaks = np.sort(np.concatenate([knots, knots[:-1] + half]))
    chains = np.moveaxis(pieces.reshape(*pieces.shape[:-2], -1), 0, -1)
    return breaks, np.ascontiguousarray(chains)


@cache
def _at_end() -> tuple[Array, Array]:
    """Value and two derivatives at the end of an interval, by the coefficients.

    The interval is scaled to [0, 2] and cut at 1. The left quartic has the coefficients
    a0..a4. Continuity of order three gives the right one, in powers of (x - 1), except
    for its b4. Value and derivatives at x = 2 are ``known`` times a0..a2 plus
    ``condition`` times a3, a4, b4.

    Returns:
        ``known`` and ``condition`` (3, 3).
    """
    condition = np.zeros((3, 3))
    known = np.zeros((3, 3))
    for row in range(3):  # derivative at x = 2
        fall = [np.prod(np.arange(k, k - row, -1)) for k in range(5)]
        for k in range(3):
            known[row, k] = fall[k] * 2.0 ** (k - row) if k >= row else 0.0
        for column, k in enumerate((3, 4)):
            # x^k continued to order three beyond the cut
            taylor = [comb(k, j) for j in range(4)]
            condition[row, column] = sum(
                t * np.prod(np.arange(j, j - row, -1))
                for j, t in enumerate(taylor)
                if j >= row
            )
        condition[row, 2] = fall[4]
    return known, condition

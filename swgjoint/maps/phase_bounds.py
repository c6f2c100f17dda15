r"""Upper bounds of sums over the harmonics of a map, for all phases.

The amplitudes add up to a bound of

.. math:: f(\alpha, \beta) = \sum_k a_k \cos\phi_k + b_k \sin\phi_k, \quad
    \phi_k = p_k \alpha + q_k \beta .

The phases of a few harmonics come close to it, those of thousands of weak harmonics
never do: with 2421 harmonics of tooth errors it is five to ten times too large. The sum
of many harmonics is therefore evaluated at N points per turn of either angle. Around
its maximum, a trigonometric polynomial of degree m is at least ``max |f| cos(m d)`` at
the distance d, and a point is not further than pi/N away, so that

.. math:: \max |f| \le \frac{\max_\text{points} |f|}
    {\cos(\pi m_\alpha / N_\alpha) \cos(\pi m_\beta / N_\beta)} .

Source: M. Riesz (1914), "Eine trigonometrische Interpolationsformel und einige
Ungleichungen für Polynome", Jahresbericht der DMV 23, pp. 354-368 (comparison of a
trigonometric polynomial with the cosine at its maximum).
"""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.maps.potential import Potential

MANY = 128
"""Number of harmonics above which their sum is evaluated at points. The bounds of maps
with fewer harmonics are the sums of their amplitudes."""
POINTS = 6
"""Smallest number of points per period of the fastest harmonic; the denominator above
is then at least cos²(pi/6) = 0.75."""
COARSE = 4
"""The same for the search of the largest of many sums."""
_BLOCK = 64  # numbers of points are multiples of it, for a fast transform


def largest_sums(orders: NDArray[np.int64], amplitudes: Array) -> Array:
    """Upper bounds of the magnitudes of sums of harmonics, at any alpha and beta.

    Args:
        orders: Orders (p, q) of the harmonics (n, 2).
        amplitudes: Cosine and sine amplitudes of m sums (m, n, 2).

    Returns:
        Bounds in the unit of the amplitudes (m,).
    """
    bounds = np.hypot(amplitudes[..., 0], amplitudes[..., 1]).sum(axis=-1)
    if len(orders) <= MANY:
        return np.asarray(bounds)
    at_points = _sums_at_points(orders, POINTS)
    found = np.array([at_points(pairs) for pairs in amplitudes])
    return np.asarray(np.minimum(bounds, found / _least_share(orders, POINTS)))


def largest_total(
    orders: NDArray[np.int64],
    amplitudes: Array,
    constants: Array,
    *,
    enough: float = -np.inf,
) -> float:
    """Largest of the sums of a constant and its bound of :func:`largest_sums`.

    Bounds are evaluated only where the total can be the largest one. The amplitudes and
    a coarse grid show where this is, in a third of the time of all bounds.

    Args:
        orders: Orders (p, q) of the harmonics (n, 2).
        amplitudes: Cosine and sine amplitudes of m sums (m, n, 2).
        constants: Constants in the unit of the amplitudes (m,).
        enough: A result up to this value may be too large, which saves most bounds.
    """
    most = constants + np.hypot(*np.moveaxis(amplitudes, -1, 0)).sum(axis=-1)
    above = most > enough
    low = float(most[~above].max(initial=-np.inf))
    if len(orders) <= MANY or not above.any():
        return float(most.max())
    amplitudes, constants, most = amplitudes[above], constants[above], most[above]
    at_points = _sums_at_points(orders, COARSE)
    found, best = np.full(len(most), -np.inf), float(constants.max())
    for k in np.argsort(-most):
        if most[k] < best:
            break
        found[k] = at_points(amplitudes[k])
        best = max(best, float(constants[k] + found[k]))
    least = _least_share(orders, COARSE) * _least_share(orders, POINTS)
    near = np.flatnonzero(constants + found / least >= best)
    high = constants[near] + largest_sums(orders, amplitudes[near])
    return max(low, float(high.max()))


def _points(orders: NDArray[np.int64], per_period: int) -> NDArray[np.int64]:
    """Numbers of points per turn of alpha and beta (2,)."""
    degree = np.abs(orders).max(axis=0)
    return np.asarray(np.maximum(-(-per_period * degree // _BLOCK) * _BLOCK, 1))


def _least_share(orders: NDArray[np.int64], per_period: int) -> float:
    """Smallest ratio of the largest value at points to the largest one at any phase."""
    degree = np.abs(orders).max(axis=0)
    return float(np.prod(np.cos(np.pi * degree / _points(orders, per_period))))


def _sums_at_points(
    orders: NDArray[np.int64], per_period: int
) -> Callable[[Array], float]:
    """Function of amplitudes (n, 2) that finds the largest magnitude of their sum.

    Args:
        orders: Orders (p, q) of the harmonics (n, 2).
        per_period: Smallest number of points per period of the fastest harmonic.
    """
    points = _points(orders, per_period)
    # waves with p < 0 are turned round, which leaves their real parts
    sign = np.where(orders[:, 0] < 0, -1, 1)
    p, q = sign * orders.T
    rows, row = np.unique(p, return_inverse=True)
    at, size = row * points[1] + q % points[1], rows.size * points[1]
    # the even and the odd part in alpha yield the values at alpha and at -alpha
    alpha = 2.0 * np.pi / points[0] * np.arange(points[0] // 2 + 1)
    even, odd = (f(alpha[:, None] * rows) for f in (np.cos, np.sin))

    def largest(amplitudes: Array) -> float:
        cosine, sine = amplitudes.T
        terms = np.bincount(at, cosine, size) - 1j * np.bincount(at, sign * sine, size)
        waves = np.fft.ifft(terms.reshape(rows.size, -1), axis=1, norm="forward")
        values = np.abs(even @ waves.real)
        values += np.abs(odd @ waves.imag)
        return float(values.max())

    return largest


def max_stiffness(drive: Potential, *, enough: float = -np.inf) -> float:
    """Largest stiffness over the torsion, bounded over all angles [N·m/rad].

    The bound is evaluated at nine torsions per knot interval (of many harmonics, three)
    and in the linear continuation beyond the knots.

    Args:
        drive: The map.
        enough: A result up to this value may be larger than the bound, which takes a
            tenth of the time for many harmonics [N·m/rad].
    """
    knots, c = drive.torsion_knots, drive.potential[:, :, None]
    points = 3 if len(drive.orders) - 1 > MANY else 9
    # the end of an interval is the start of the next one
    d = np.linspace(knots[:-1], knots[1:], points)[:-1] - knots[:-1]
    inside = 2 * c[..., 2] + d * (6 * c[..., 3] + d * 12 * c[..., 4])
    d = knots[-1:] - knots[-2]
    last = 2 * c[..., -1, 2] + d * (6 * c[..., -1, 3] + d * 12 * c[..., -1, 4])
    parts = (part.reshape(*part.shape[:2], -1) for part in (inside, last))
    values = np.concatenate([*parts, drive.end_stiffness], axis=-1).transpose(2, 0, 1)
    return largest_total(
        drive.orders[1:], values[:, 1:], values[:, 0, 0], enough=enough
    )


def stiffness_range(drive: Potential) -> tuple[float, float]:
    """Lower and upper bound of the stiffness inside the knots [N·m/rad]."""
    points = bernstein_coefficients(drive, 2)
    mean = points[0, 0]  # (n_intervals, 3)
    if len(drive.orders) - 1 <= MANY:
        swing = np.hypot(points[1:, 0], points[1:, 1]).max(axis=-1).sum(axis=0)
        return float((mean.min(axis=-1) - swing).min()), float(
            (mean.max(axis=-1) + swing).max()
        )
    pairs = points[1:].reshape(len(points) - 1, 2, -1).transpose(2, 0, 1)
    at_points = largest_sums(drive.orders[1:], pairs).reshape(mean.shape)
    return float((mean - at_points).min()), float((mean + at_points).max())


def bernstein_coefficients(drive: Potential, derivative: int) -> Array:
    """Bernstein coefficients of A and B, which enclose their values in the intervals.

    Args:
        drive: The map.
        derivative: Order of the derivative by the torsion, 0 to 2.

    Returns:
        Coefficients (n_harmonics, 2, n_intervals, 5 - derivative).
    """
    c = drive.potential
    for _ in range(derivative):
        c = c[..., 1:] * np.arange(1, c.shape[-1])
    degree = c.shape[-1] - 1
    c = c * np.diff(drive.torsion_knots)[:, None] ** np.arange(degree + 1)
    # b_i = sum_j C(i, j) / C(n, j) c_j for powers of the fraction of an interval
    to_points = [
        [comb(i, j) / comb(degree, j) for j in range(degree + 1)]
        for i in range(degree + 1)
    ]
    return np.asarray(c @ np.array(to_points).T)

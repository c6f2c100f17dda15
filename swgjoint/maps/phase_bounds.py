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
    found, least = _largest_at_points(orders, amplitudes, POINTS)
    return np.asarray(np.minimum(bounds, found / least))


def largest_total(
    orders: NDArray[np.int64], amplitudes: Array, constants: Array
) -> float:
    """Largest of the sums of a constant and its bound of :func:`largest_sums`.

    Bounds are evaluated only where the total can be the largest one. The amplitudes and
    a coarse grid show where this is, in a third of the time of all bounds.

    Args:
        orders: Orders (p, q) of the harmonics (n, 2).
        amplitudes: Cosine and sine amplitudes of m sums (m, n, 2).
        constants: Constants in the unit of the amplitudes (m,).
    """
    if len(orders) > MANY:
        most = constants + np.hypot(*np.moveaxis(amplitudes, -1, 0)).sum(axis=-1)
        near = np.flatnonzero(most >= constants.max())
        found, least = _largest_at_points(orders, amplitudes[near], COARSE)
        least *= _least_share(orders, POINTS)
        near = near[constants[near] + found / least >= (constants[near] + found).max()]
        amplitudes, constants = amplitudes[near], constants[near]
    return float((constants + largest_sums(orders, amplitudes)).max())


def _points(orders: NDArray[np.int64], per_period: int) -> NDArray[np.int64]:
    """Numbers of points per turn of alpha and beta (2,)."""
    degree = np.abs(orders).max(axis=0)
    return np.asarray(np.maximum(-(-per_period * degree // _BLOCK) * _BLOCK, 1))


def _least_share(orders: NDArray[np.int64], per_period: int) -> float:
    """Smallest ratio of the largest value at points to the largest one at any phase."""
    degree = np.abs(orders).max(axis=0)
    return float(np.prod(np.cos(np.pi * degree / _points(orders, per_period))))


def _largest_at_points(
    orders: NDArray[np.int64], amplitudes: Array, per_period: int
) -> tuple[Array, float]:
    """Largest magnitude at points, and its :func:`_least_share`.

    Args:
        orders: Orders (p, q) of the harmonics (n, 2).
        amplitudes: Cosine and sine amplitudes of m sums (m, n, 2).
        per_period: Smallest number of points per period of the fastest harmonic.

    Returns:
        Largest magnitudes (m,), and the share.
    """
    points = _points(orders, per_period)
    # two real sums are the real and the imaginary part of one complex sum
    waves = 0.5 * (amplitudes[..., 0] - 1j * amplitudes[..., 1])
    mirrored = np.concatenate([orders, -orders])
    rows, row = np.unique(mirrored[:, 0], return_inverse=True)
    at = row * points[1] + mirrored[:, 1] % points[1]
    largest = np.zeros(len(waves))
    for first in range(0, len(waves), 2):
        pair = waves[first : first + 2]
        factor = np.array([1.0, 1j])[: len(pair)]
        both = np.concatenate([factor @ pair, factor @ pair.conj()])
        size = rows.size * points[1]
        real, imaginary = (np.bincount(at, x, size) for x in (both.real, both.imag))
        part = (real + 1j * imaginary).reshape(rows.size, points[1])
        grid = np.zeros(points, dtype=complex)
        grid[rows % points[0]] = np.fft.ifft(part, axis=1, norm="forward")
        values = np.fft.ifft(grid, axis=0, norm="forward")
        found = [np.abs(values.real).max(), np.abs(values.imag).max()][: len(pair)]
        largest[first : first + 2] = found
    return largest, _least_share(orders, per_period)


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

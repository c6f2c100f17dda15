"""Polynomials on faces and sections in terms of the displacements of master nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Legendre

from swgjoint.typing import Array, Index

THROUGH = (0.0, 1.0, 0.5, 0.25, 0.75)
"""Relative depths of the masters through the wall, from the outside [-]. The first
k + 1 masters define a polynomial of degree k."""


@cache
def lobatto(order: int) -> Array:
    """Gauss-Lobatto points from 0 to 1, on which interpolation does not oscillate.

    Args:
        order: Degree of the interpolating polynomials.

    Returns:
        Increasing points (order + 1,).
    """
    inner = np.asarray(Legendre.basis(order).deriv().roots(), dtype=np.float64)
    return np.concatenate([[0.0], 0.5 * (1.0 + np.sort(inner)), [1.0]])


def lagrange(points: Array, x: Array) -> Array:
    """Values of the Lagrange polynomials on given points (n_x, n_points).

    Args:
        points: Interpolation points (n_points,).
        x: Points of evaluation (n_x,).
    """
    weights = np.empty((len(x), len(points)))
    for k, point in enumerate(points):
        others = np.delete(points, k)
        weights[:, k] = np.prod((x[:, None] - others) / (point - others), axis=1)
    return weights


def newton_polynomial(level: int, depth: Array) -> Array:
    """Polynomial that is one at a point of :data:`THROUGH` and zero at earlier points.

    The first two are straight lines, each of which is zero at the other's point.

    Args:
        level: Index of the point in :data:`THROUGH`.
        depth: Relative depths of evaluation, 0 to 1 [-].
    """
    before = THROUGH[:2] if level < 2 else THROUGH[:level]
    value = np.ones_like(depth)
    for point in before:
        if point != THROUGH[level]:
            value = value * (depth - point) / (THROUGH[level] - point)
    return value


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """Polynomials on a face of a segment or on a section, and their masters."""

    degrees: tuple[int, ...]
    """Degrees along the face or section, one per point of :data:`THROUGH` that has
    masters."""
    points: tuple[tuple[int, int], ...]
    """Level and station of every master: index of its depth in :data:`THROUGH`, and
    number of its Gauss-Lobatto point along the patch."""
    masters: Index
    """Numbers of the masters; on the last face they are negative and count from the
    end."""
    narrow: float = 0.0
    """Relative depth of the outside of the patch at its first station, where the wall
    of the cup is thinner than the rim [-]."""

    def rows(self, along: Array, depth: Array, size: int, first: int = 0) -> Array:
        """Weights of all masters of a strip at points of the patch (n, size) [-].

        Args:
            along: Relative positions of the points along the patch, 0 to 1 (n,).
            depth: Relative depths of the points from the outside to the bore side, 0 to
                1 (n,).
            size: Number of masters of the strip.
            first: Offset added to the numbers of the masters.
        """
        stations = np.array([lobatto(self.degrees[j])[k] for j, k in self.points])
        deep = np.array([THROUGH[j] for j, _ in self.points])
        # at the teeth the wall is thinner than the rim to which these masters belong
        outer = np.array([k == 0 for _, k in self.points]) & (self.narrow > 0.0)
        deep[outer] = (deep[outer] - self.narrow) / (1.0 - self.narrow)
        values = np.linalg.solve(
            self._basis(stations, deep).T, self._basis(along, depth).T
        )
        rows = np.zeros((len(along), size))
        rows[:, first + self.masters] = np.where(np.abs(values) > 1e-13, values, 0.0).T
        return rows

    def _basis(self, along: Array, depth: Array) -> Array:
        """Products of Lagrange and Newton polynomials at points (n, n_masters)."""
        columns = []
        for level, station in self.points:
            curve = lagrange(lobatto(self.degrees[level]), along)[:, station]
            columns.append(curve * newton_polynomial(level, depth))
        return np.stack(columns, axis=1)

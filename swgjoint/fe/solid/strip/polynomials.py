"""Polynomials on faces and sections in the displacements of master nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Legendre

from swgjoint.typing import Array, Index

THROUGH = (0.0, 1.0, 0.5, 0.25, 0.75)
"""Masters through the wall, from the outside: each one raises the degree by one."""


@cache
def lobatto(order: int) -> Array:
    """Points from 0 to 1, ends included, between which polynomials stay tame."""
    inner = np.asarray(Legendre.basis(order).deriv().roots(), dtype=np.float64)
    return np.concatenate([[0.0], 0.5 * (1.0 + np.sort(inner)), [1.0]])


def lagrange(points: Array, x: Array) -> Array:
    """Values of the Lagrange polynomials of the points (n_x, n_points)."""
    weights = np.empty((len(x), len(points)))
    for k, point in enumerate(points):
        others = np.delete(points, k)
        weights[:, k] = np.prod((x[:, None] - others) / (point - others), axis=1)
    return weights


def newton_polynomial(level: int, depth: Array) -> Array:
    """Newton's polynomial that is one at a point of ``THROUGH``, zero at those before.

    The first two are straight lines.
    """
    before = THROUGH[:2] if level < 2 else THROUGH[:level]
    value = np.ones_like(depth)
    for point in before:
        if point != THROUGH[level]:
            value = value * (depth - point) / (THROUGH[level] - point)
    return value


@dataclass(frozen=True, kw_only=True, eq=False)
class Patch:
    """Polynomials on a face of a segment or on a section, and the masters they have."""

    degrees: tuple[int, ...]
    """Along, by level through the wall."""
    points: tuple[tuple[int, int], ...]
    """Level and station of every master."""
    masters: Index
    """Their numbers; those of the last face count from the end."""
    narrow: float = 0.0
    """How deep below the outside the segment's own begins at the first station."""

    def rows(self, along: Array, depth: Array, size: int, first: int = 0) -> Array:
        """Weights of all masters of a strip at points (n, size).

        Args:
            along: Of the points, 0 to 1 (n,).
            depth: The same from the outside to the bore side.
            size: Of the strip.
            first: Master that number 0 stands for.
        """
        own = np.array([lobatto(self.degrees[j])[k] for j, k in self.points])
        deep = np.array([THROUGH[j] for j, _ in self.points])
        # at the teeth the outside of the wall lies between the masters
        outer = np.array([k == 0 for _, k in self.points]) & (self.narrow > 0.0)
        deep[outer] = (deep[outer] - self.narrow) / (1.0 - self.narrow)
        values = np.linalg.solve(self._basis(own, deep).T, self._basis(along, depth).T)
        rows = np.zeros((len(along), size))
        rows[:, first + self.masters] = np.where(np.abs(values) > 1e-13, values, 0.0).T
        return rows

    def _basis(self, along: Array, depth: Array) -> Array:
        """Functions of the masters, not yet one at their own and zero at the others."""
        columns = []
        for level, station in self.points:
            curve = lagrange(lobatto(self.degrees[level]), along)[:, station]
            columns.append(curve * newton_polynomial(level, depth))
        return np.stack(columns, axis=1)

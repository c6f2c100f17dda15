"""Small dense mixed complementarity problems of contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]


class ActiveSetError(ArithmeticError):
    """No active set was found, or the system of the active set is singular."""


def solve_mixed(
    matrix: Array, offset: Array, inequalities: int, start: Array
) -> tuple[Array, Array]:
    r"""Solve :math:`g = q + M z` with unilateral and free unknowns.

    .. math:: 0 \le z_i \perp g_i \ge 0 \quad (i < m), \qquad g_i = 0 \quad (i \ge m)

    Primal-dual active set, a handful of small solves; where it cycles (nearly equal
    contact points), the free unknowns are eliminated and the rest is solved as a
    non-negative least-squares problem.

    Args:
        matrix: M, symmetric, positive definite after elimination of the free unknowns.
            Shape (n, n).
        offset: q. Shape (n,).
        inequalities: m.
        start: Guess of the active set, booleans (m,).

    Returns:
        z (n,) and the active set (m,).

    Raises:
        ActiveSetError: If no set is found or the matrix is singular.
    """
    n, m = len(offset), inequalities
    active = start.copy()
    scale = np.sqrt(np.abs(np.diag(matrix))) + 1e-300
    scaled = matrix / scale[:, None] / scale
    q = offset / scale
    tolerance = 1e-12 * max(float(np.abs(q).max(initial=0.0)), 1e-300)
    for _ in range(25):
        z = _solve_active(scaled, q, active)
        gap = q + scaled @ z
        bad = np.where(active, -z[:m], -gap[:m]) > tolerance
        if not bad.any():
            return z / scale, active
        active = active ^ bad
    z = _least_squares(scaled, q, m)
    return z / scale, z[:m] > 0.0


def _solve_active(matrix: Array, offset: Array, active: NDArray[np.bool_]) -> Array:
    n, m = len(offset), len(active)
    index = np.concatenate([np.flatnonzero(active), np.arange(m, n)])
    z = np.zeros(n)
    if index.size:
        try:
            z[index] = np.linalg.solve(matrix[np.ix_(index, index)], -offset[index])
        except np.linalg.LinAlgError as error:
            raise ActiveSetError("singular contact matrix") from error
    return z


def _least_squares(matrix: Array, offset: Array, m: int) -> Array:
    """Minimise z.Mz/2 + q.z over the unilateral unknowns, the free ones eliminated."""
    coupling, block = matrix[:m, m:], matrix[m:, m:]
    try:
        reach = np.linalg.solve(block, np.column_stack([coupling.T, offset[m:]]))
        reduced = matrix[:m, :m] - coupling @ reach[:, :m]
        shift = 1e-14 * float(np.trace(reduced)) / m
        lower = np.linalg.cholesky(reduced + shift * np.eye(m))
        target = -np.linalg.solve(lower, offset[:m] - coupling @ reach[:, m])
        z, _ = nnls(lower.T, target)
    except (np.linalg.LinAlgError, RuntimeError) as error:
        raise ActiveSetError(f"no contact forces found: {error}") from error
    return np.concatenate([z, -(reach[:, m] + reach[:, :m] @ z)])

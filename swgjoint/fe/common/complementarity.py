"""Small dense mixed complementarity problems of contact."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from swgjoint.errors import Outcome
from swgjoint.typing import Array, Mask

TRIES = 120
"""Largest number of active sets that are tried. Contacts of conforming flanks need up
to 100."""
PATIENCE = 3
"""Number of active sets without fewer violated conditions than any before, after which
one contact at a time is exchanged."""


class ActiveSetError(ArithmeticError):
    """No active set was found, or the system of an active set is singular."""

    def __init__(
        self, message: str, outcome: Outcome = Outcome.ACTIVE_SET_CYCLES
    ) -> None:
        super().__init__(message)
        self.outcome = outcome


def solve_mixed(
    matrix: Array, offset: Array, inequalities: int, multipliers: int, start: Mask
) -> tuple[Array, Mask]:
    r"""Solve :math:`g = q + M z` with unilateral and free unknowns.

    .. math:: 0 \le z_i \perp g_i \ge 0 \quad (i < m), \qquad g_i = 0 \quad (i \ge m)

    A primal-dual active-set method finds the solution in a few small solves. If the
    number of violated conditions does not decrease, as nearly coincident contact points
    may cause, only the worst one is exchanged until it does. If even this cycles, the
    free unknowns are eliminated and the active set follows from a non-negative
    least-squares problem.

    Args:
        matrix: Matrix M (n, n), symmetric, positive definite after elimination of the
            free unknowns.
        offset: Offset q (n,).
        inequalities: Number m of unilateral unknowns.
        multipliers: Number of unknowns at the end of z that are multipliers of
            equations; the other free unknowns have a negative or zero diagonal.
        start: Guess of the active set (m,).

    Returns:
        Solution z (n,) and the active set of the unilateral unknowns (m,).

    Raises:
        ActiveSetError: If no active set is found or its system is singular.

    >>> import numpy as np
    >>> M, q = np.array([[2.0, 0.0], [0.0, 1.0]]), np.array([-1.0, 3.0])
    >>> z, active = solve_mixed(M, q, 2, 0, np.zeros(2, dtype=bool))
    >>> z.tolist(), active.tolist()
    ([0.5, 0.0], [True, False])
    """
    n, m = len(offset), inequalities
    active = start.copy()
    scale = np.sqrt(np.abs(np.diag(matrix))) + 1e-300
    if 0 < m < n:  # the diagonal of a free unknown may vanish
        size = np.abs(matrix[m:, :m] / scale[:m]).max(axis=1)
        scale[m:] = np.maximum(scale[m:], size)
    scaled = matrix / scale[:, None] / scale
    q = offset / scale
    tolerance = 1e-12 * max(float(np.abs(q).max(initial=0.0)), 1e-300)
    fewest, patience = m + 1, PATIENCE
    for _ in range(TRIES):
        z = _solve_active(scaled, q, active)
        gap = q + scaled @ z
        wrong = np.where(active, -z[:m], -gap[:m])
        bad = wrong > tolerance
        count = int(np.count_nonzero(bad))
        if count == 0:
            return z / scale, active
        if count < fewest:
            fewest, patience = count, PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            bad = np.arange(m) == wrong.argmax()
        active = active ^ bad
    active = _least_squares(scaled, q, m, multipliers)
    z = _solve_active(scaled, q, active)
    if (np.where(active, -z[:m], -(q + scaled @ z)[:m]) > 1e3 * tolerance).any():
        raise ActiveSetError("the active-set iteration cycles")
    return z / scale, active


def first_to_close(matrix: Array, offset: Array, contacts: int, turn: int) -> Mask:
    r"""Mask of the open contact that a free body closes first as it turns (m,).

    The rotation of the body is the unknown z_k of :math:`g = q + M z`, with the moment
    balance :math:`g_k = 0`. Without a contact in the active set it has no solution.

    Args:
        matrix: Matrix M (n, n).
        offset: Offset q (n,).
        contacts: Number m of contacts, whose forces are the first unknowns.
        turn: Index k of the rotation.

    >>> import numpy as np
    >>> M, q = np.zeros((4, 4)), np.array([0.3, 0.1, 0.1, -1.0])
    >>> M[3, :3] = M[:3, 3] = [2.0, 1.0, -2.0]
    >>> first_to_close(M, q, 3, 3).tolist()
    [False, True, False]
    """
    arm = matrix[turn, :contacts]
    with np.errstate(divide="ignore", invalid="ignore"):
        force = -offset[turn] / arm
        opened = offset[:contacts] + np.diag(matrix)[:contacts] * force
        way = np.abs(opened / arm)
    possible = (force > 0.0) & np.isfinite(way)
    first = np.zeros(contacts, dtype=bool)
    if possible.any():
        first[np.where(possible, way, np.inf).argmin()] = True
    return first


def _solve_active(matrix: Array, offset: Array, active: Mask) -> Array:
    """Solution z (n,) in which unilateral unknowns outside the active set are zero."""
    n, m = len(offset), len(active)
    index = np.concatenate([np.flatnonzero(active), np.arange(m, n)])
    z = np.zeros(n)
    if index.size:
        try:
            z[index] = np.linalg.solve(matrix[np.ix_(index, index)], -offset[index])
        except np.linalg.LinAlgError as error:
            raise ActiveSetError("singular contact matrix", Outcome.SINGULAR) from error
    return z


def _least_squares(matrix: Array, offset: Array, m: int, multipliers: int) -> Mask:
    """Active set of a minimum of z.Mz/2 + q.z subject to z >= 0.

    Multipliers are eliminated; the other free unknowns become weighted equations.
    """
    reduced, q = matrix, offset
    for k in range(len(offset) - 1, len(offset) - 1 - multipliers, -1):
        column = reduced[:k, k] / reduced[k, k]
        q = q[:k] - column * q[k]
        reduced = reduced[:k, :k] - np.outer(column, reduced[k, :k])
    rows, right = [], []
    for k in range(m, len(q)):
        weight = 1.0 / np.sqrt(max(-reduced[k, k], 1e-8))
        rows.append(weight * reduced[k, :m])
        right.append(-weight * q[k])
    try:
        lower = np.linalg.cholesky(reduced[:m, :m] + 1e-12 * np.eye(m))
        rows.extend(lower.T)
        right.extend(-np.linalg.solve(lower, q[:m]))
        z, _ = nnls(np.array(rows), np.array(right))
    except (np.linalg.LinAlgError, RuntimeError) as error:
        raise ActiveSetError(f"no contact forces found: {error}") from error
    return np.asarray(z > 0.0)

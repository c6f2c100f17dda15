"""Solution of many small complementarity problems that share one matrix."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from swgjoint.typing import Array, Index, Mask

TOLERANCE = 1e-9
"""Magnitude that counts as zero, as a fraction of a problem's largest offset [-]."""
TRIES = 20
"""Number of block exchanges without progress after which single exchanges start. With 3
instead of 20, a quarter more systems have to be solved."""
SINGLES = 60
"""Number of single exchanges without progress after which a problem is solved by
Lemke's method."""
PIVOTS = 10
"""Largest number of pivots of Lemke's method divided by the size of the problem [-].
Contact problems need about a fifth of their size."""
TIE = 1e-12
"""Tolerance of ties in the ratio test of Lemke's method, as a fraction of the largest
offset [-]."""
BATCH = 32
"""Number of problems, with active sets of similar size, that are solved at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pivoted:
    """Solutions of :func:`solve_many`, one problem per row."""

    value: Array
    """Unknowns v, zero where not active (n_problems, n)."""
    slack: Array
    """Slacks w, zero where active (n_problems, n)."""
    active: Mask
    """Active sets (n_problems, n)."""
    solved: Mask
    """Whether each problem was solved (n_problems,). If not, for example because the
    system of its active set is singular, its active unknowns and other slacks are NaN.
    """


def solve_many(matrix: Array, offset: Array, start: Mask | None = None) -> Pivoted:
    r"""Solve :math:`0 \le v \perp w = q + M v \ge 0` for every row q of the offset.

    Most unknowns are zero in every solution. The problems are therefore first solved in
    those unknowns only whose slack is negative at v = 0. Unknowns whose slack becomes
    negative are then added, and the problems are solved again.

    Args:
        matrix: Matrix M (n, n), positive definite; symmetry is not required.
        offset: Offsets q (n_problems, n).
        start: Guess of the active sets (n_problems, n); None for empty sets.

    Returns:
        Solutions of all problems.
    """
    scale = np.sqrt(np.diag(matrix))
    q = offset / scale
    tolerance = TOLERANCE * np.abs(q).max(axis=1, initial=1e-300)
    active = np.zeros(q.shape, bool) if start is None else start.copy()
    result = q.copy()  # v where active, else w
    unknown = (q < 0.0).any(axis=0) | active.any(axis=0)
    open_ = np.flatnonzero((q < 0.0).any(axis=1) | active.any(axis=1))
    while open_.size:
        inside = np.flatnonzero(unknown)
        part = np.ix_(open_, inside)
        block = matrix[np.ix_(inside, inside)] / scale[inside, None] / scale[inside]
        solved, ends = _all_unknowns(block, q[part], tolerance[open_], active[part])
        active[part] = ends
        value = np.where(ends, solved, 0.0) / scale[inside]
        result[open_] = q[open_] + value @ matrix[:, inside].T / scale
        result[part] = solved
        bad = result[open_] < -tolerance[open_, None]
        bad[:, unknown] = False
        unknown |= bad.any(axis=0)
        open_ = open_[bad.any(axis=1)]
    finite = np.asarray(np.isfinite(result).all(axis=1))
    result[~finite] = np.nan
    return Pivoted(
        value=np.where(active, result, 0.0) / scale,
        slack=np.where(active, 0.0, result) * scale,
        active=active,
        solved=finite,
    )


def _all_unknowns(
    scaled: Array, q: Array, tolerance: Array, active: Mask
) -> tuple[Array, Mask]:
    """Solutions of the problems in all given unknowns.

    The method is block principal pivoting: all infeasible unknowns switch between
    active and inactive. If this makes no progress, only the last infeasible unknown
    switches (Murty's rule), which may take many steps. If this makes no progress
    either, the problem is solved by :func:`lemke`.

    Args:
        scaled: Matrix M scaled to a unit diagonal (n, n).
        q: Scaled offsets (n_problems, n).
        tolerance: Magnitude that counts as zero (n_problems,).
        active: Guess of the active sets (n_problems, n).

    Returns:
        v where active, w elsewhere, and NaN if unsolved (n_problems, n); active sets
        (n_problems, n).

    Source:
        Júdice and Pires (1994), "A block principal pivoting algorithm for large-scale
        strictly monotone linear complementarity problems", Computers & Operations
        Research 21(5), 587-596.
    """
    count, active = len(q), active.copy()
    result = np.full(q.shape, np.nan)
    open_ = np.arange(count)
    stuck: list[int] = []
    fewest = np.full(count, q.shape[1] + 1)
    nearest = active.copy()
    tries = np.full(count, TRIES)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        while open_.size:
            order = open_[np.argsort(active[open_].sum(axis=1))]
            parts = [order[k : k + BATCH] for k in range(0, order.size, BATCH)]

            def solve(part: Index) -> Array:
                return _at_active(scaled, q[part], active[part])

            # for a single batch a thread costs more than it saves
            solve_all = pool.map if len(parts) > 1 else map
            for part, solved in zip(parts, solve_all(solve, parts), strict=True):
                result[part] = solved
            bad = result[open_] < -tolerance[open_, None]
            wrong = bad.sum(axis=1)
            better = wrong < fewest[open_]
            fewest[open_] = np.minimum(fewest[open_], wrong)
            nearest[open_[better]] = active[open_[better]]
            tries[open_] = np.where(better, TRIES, tries[open_] - 1)
            ends = tries[open_] < -SINGLES
            stuck += open_[(wrong > 0) & ends].tolist()
            left = (wrong > 0) & ~ends
            open_, bad = open_[left], bad[left]
            single = np.flatnonzero(tries[open_] < 0)
            last = bad.shape[1] - 1 - bad[single, ::-1].argmax(axis=1)
            bad[single] = False
            bad[single, last] = True
            active[open_] ^= bad

        def alone(k: int) -> Mask | None:
            return lemke(scaled, q[k], nearest[k])

        for k, ended in zip(stuck, pool.map(alone, stuck), strict=True):
            result[k] = np.nan
            if ended is not None:
                active[k] = ended
                at_end = _at_active(scaled, q[k : k + 1], active[k : k + 1])[0]
                if at_end.min() >= -tolerance[k]:
                    result[k] = at_end
    return result, active


def lemke(matrix: Array, offset: Array, start: Mask) -> Mask | None:
    """Active set of one complementarity problem, found by Lemke's method.

    An artificial unknown, large enough that no basic unknown is negative, is driven out
    of the basis: in each pivot the complement of the unknown that has just left enters.
    For a positive definite matrix this ends at the unique solution.

    Args:
        matrix: Matrix M scaled to a unit diagonal (n, n).
        offset: Offset q (n,).
        start: Guess of the active set (n,).

    Returns:
        Active set (n,); None if the search ends without a solution.

    Source:
        Lemke (1965), "Bimatrix equilibrium points and mathematical programming",
        Management Science 11(7), 681-689; Cottle, Pang and Stone (1992), "The linear
        complementarity problem", section 4.4.
    """
    n = len(offset)
    try:
        exchanged, forward = exchange(matrix, np.flatnonzero(start))
    except np.linalg.LinAlgError:
        exchanged, forward, start = matrix, np.eye(n), np.zeros(n, bool)
    begin = forward @ offset
    if begin.min() >= 0.0:
        return start
    # basic unknowns in terms of the others: w are 0 to n - 1, v are n to 2 n - 1, and
    # 2 n is the artificial unknown
    table = np.concatenate([-exchanged, -np.ones((n, 1)), begin[:, None]], axis=1)
    basis = np.arange(n) + n * start
    others = np.append(np.arange(n) + n * ~start, 2 * n)
    tie, artificial = TIE * np.abs(begin).max(), 2 * n

    def pivot(row: int, column: int) -> int:
        entering = table[:, column].copy()
        above = table[row] / entering[row]
        np.subtract(table, np.outer(entering, above), out=table)
        table[row], table[:, column] = above, -entering / entering[row]
        table[row, column] = 1.0 / entering[row]
        basis[row], others[column] = others[column], basis[row]
        return int(others[column])

    left = pivot(int(np.argmin(begin)), n)
    for _ in range(PIVOTS * n):
        entering = left + n if left < n else left - n
        column = int(np.flatnonzero(others == entering)[0])
        slope = table[:, column]
        falling = np.flatnonzero(slope > TIE)
        if not falling.size:
            return None
        ratio = table[falling, -1] / slope[falling]
        first = falling[ratio <= ratio.min() + tie]
        ends = first[basis[first] == artificial]
        left = pivot(
            int(ends[0] if ends.size else first[slope[first].argmax()]), column
        )
        if left == artificial:
            active = np.zeros(n, bool)
            active[basis[basis >= n] - n] = True
            return active
    return None


def exchange(system: Array, inside: Index) -> tuple[Array, Array]:
    """Linear map y = A z + q after some unknowns and results have been exchanged.

    Args:
        system: Matrix A (k, k).
        inside: Numbers i for which y_i becomes an unknown and z_i a result.

    Returns:
        Matrix of the exchanged map (k, k), and the matrix that multiplies q (k, k).

    Raises:
        numpy.linalg.LinAlgError: If the block of A at these numbers is singular.
    """
    stays, m = np.ones(len(system), dtype=bool), len(inside)
    stays[inside] = False
    # in blocks: the exchanged unknowns first
    order = np.concatenate([inside, np.flatnonzero(stays)])
    at = np.ix_(order, order)
    blocks = system[at]
    inverse, beside = np.linalg.inv(blocks[:m, :m]), blocks[:m, m:]
    reach = blocks[m:, :m] @ inverse
    pivoted, forward = np.empty_like(system), np.zeros_like(system)
    pivoted[at] = np.block(
        [[inverse, -inverse @ beside], [reach, blocks[m:, m:] - reach @ beside]]
    )
    forward[order, order] = 1.0
    forward[np.ix_(order, inside)] = -np.concatenate([inverse, reach])
    return pivoted, forward


def solve_active(matrix: Array, right: Array, active: Mask) -> Array:
    """Solve :math:`M v + r = 0` in the rows of every active set, with v zero elsewhere.

    Args:
        matrix: Matrix M (n, n).
        right: Vector r, the same for all problems (n,).
        active: Active sets (n_problems, n).

    Returns:
        Solutions v (n_problems, n); NaN where a system is singular.
    """
    inside = np.flatnonzero(active.any(axis=0))
    scale = np.sqrt(np.diag(matrix))[inside]
    scaled = matrix[np.ix_(inside, inside)] / scale[:, None] / scale
    q, there = right[inside] / scale, active[:, inside]
    values = np.zeros(there.shape)
    order = np.argsort(there.sum(axis=1))
    for k in range(0, order.size, BATCH):
        part = order[k : k + BATCH]
        values[part] = _at_active(scaled, np.tile(q, (part.size, 1)), there[part])
    result = np.zeros(active.shape)
    result[:, inside] = np.where(there, values, 0.0) / scale
    return result


def _at_active(matrix: Array, q: Array, active: Mask) -> Array:
    """Unknowns v where active and slacks w elsewhere (n_problems, n)."""
    size = int(active.sum(axis=1).max(initial=0))
    if size == 0:
        return q
    # active indices first, padded by equations v = 0
    index = np.argsort(~active, axis=1, kind="stable")[:, :size]
    rows = np.arange(len(q))[:, None]
    real = active[rows, index]
    system = matrix[index[:, :, None], index[:, None, :]]
    both = real[:, :, None] & real[:, None, :]
    system = np.where(both, system, np.eye(size))
    right = np.where(real, -q[rows, index], 0.0)
    v = np.zeros_like(q)
    v[rows, index] = _solved(system, right)
    w = q + v @ matrix.T
    return np.where(active, v, w)


def _solved(systems: Array, right: Array) -> Array:
    """Solutions of linear systems (n_problems, n); NaN if a system is singular."""
    try:
        return np.asarray(np.linalg.solve(systems, right[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        if len(systems) == 1:
            return np.full_like(right, np.nan)
        parts = zip(systems, right, strict=True)
        return np.concatenate([_solved(a[None], b[None]) for a, b in parts])

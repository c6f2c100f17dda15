"""Many small complementarity problems that share one matrix."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TOLERANCE = 1e-9
"""Part of the largest offset of a problem that counts as zero."""
TRIES = 3
"""Exchanges of whole blocks without progress before single ones."""
EXCHANGES = 5000
BATCH = 32
"""Problems with active sets of similar size that are solved at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pivoted:
    """Solutions of :func:`solve_many`; rows are problems."""

    value: Array
    """v, zero where not active."""
    slack: Array
    """w, zero where active."""
    active: Mask
    solved: Mask
    """Which problems were solved; the others, also those whose active set leaves the
    system singular, are NaN. Shape (n_problems,)."""


def solve_many(matrix: Array, offset: Array, start: Mask | None = None) -> Pivoted:
    r"""Solve :math:`0 \le v \perp w = q + M v \ge 0` for every row q of the offset.

    Block principal pivoting: all wrong members of the active set change sides; where
    that makes no progress only the last one does, which ends for a P-matrix (Murty).

    Args:
        matrix: M, a P-matrix of which symmetry is not asked. Shape (n, n).
        offset: Shape (n_problems, n).
        start: Guess of the active sets; empty ones if None.

    Source:
        Júdice and Pires (1994), "A block principal pivoting algorithm for large-scale
        strictly monotone linear complementarity problems", Computers & Operations
        Research 21(5), 587-596.
    """
    scale = np.sqrt(np.diag(matrix))
    scaled, q = matrix / scale[:, None] / scale, offset / scale
    count = len(q)
    active = np.zeros(q.shape, bool) if start is None else start.copy()
    result = np.full(q.shape, np.nan)  # v where active, else w
    open_ = np.arange(count)
    fewest = np.full(count, q.shape[1] + 1)
    tries = np.full(count, TRIES)
    tolerance = TOLERANCE * np.abs(q).max(axis=1, initial=1e-300)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in range(EXCHANGES):
            order = open_[np.argsort(active[open_].sum(axis=1))]
            parts = [order[k : k + BATCH] for k in range(0, order.size, BATCH)]

            def solve(part: NDArray[np.int64]) -> Array:
                return _at_active(scaled, q[part], active[part])

            # the last few problems: a thread costs more than it saves
            solve_all = pool.map if len(parts) > 1 else map
            for part, found in zip(parts, solve_all(solve, parts), strict=True):
                result[part] = found
            bad = result[open_] < -tolerance[open_, None]
            wrong = bad.sum(axis=1)
            open_, bad, wrong = (x[wrong > 0] for x in (open_, bad, wrong))
            if not open_.size:
                break
            better = wrong < fewest[open_]
            fewest[open_] = np.minimum(fewest[open_], wrong)
            tries[open_] = np.where(better, TRIES, tries[open_] - 1)
            single = np.flatnonzero(tries[open_] < 0)
            last = bad.shape[1] - 1 - bad[single, ::-1].argmax(axis=1)
            bad[single] = False
            bad[single, last] = True
            active[open_] ^= bad
    result[open_] = np.nan
    solved = np.isfinite(result).all(axis=1)
    return Pivoted(
        value=np.where(active, result, 0.0) / scale,
        slack=np.where(active, 0.0, result) * scale,
        active=active,
        solved=solved,
    )


def solve_active(matrix: Array, right: Array, active: Mask) -> Array:
    """Solve :math:`M v + r = 0` within every active set, v zero elsewhere.

    Args:
        matrix: M (n, n).
        right: r, the same for all (n,).
        active: Shape (n_problems, n).
    """
    scale = np.sqrt(np.diag(matrix))
    scaled, q = matrix / scale[:, None] / scale, right / scale
    result = np.zeros(active.shape)
    order = np.argsort(active.sum(axis=1))
    for k in range(0, order.size, BATCH):
        part = order[k : k + BATCH]
        result[part] = _at_active(scaled, np.tile(q, (part.size, 1)), active[part])
    return np.where(active, result, 0.0) / scale


def _at_active(matrix: Array, q: Array, active: Mask) -> Array:
    """V where active, w elsewhere, for given active sets."""
    size = int(active.sum(axis=1).max(initial=0))
    if size == 0:
        return q
    # the active indices first; padded by equations that say v = 0
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
    """Solutions (n_problems, n); NaN where a system is singular."""
    try:
        return np.asarray(np.linalg.solve(systems, right[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        if len(systems) == 1:
            return np.full_like(right, np.nan)
        parts = zip(systems, right, strict=True)
        return np.concatenate([_solved(a[None], b[None]) for a, b in parts])

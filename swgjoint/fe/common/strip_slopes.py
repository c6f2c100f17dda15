"""Derivatives of the output of problems with contact strips, in numpy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.fe.common.pivoting import solve_active
from swgjoint.typing import Array, Mask

if TYPE_CHECKING:
    from swgjoint.fe.common.strip_problems import StripProblems


def slopes_by_load(problems: StripProblems, active: Mask, force: Array) -> Array:
    """Derivatives of the output with respect to the load (n_problems,).

    Args:
        problems: Matrix and strips.
        active: Active sets (n_problems, m).
        force: Forces of the strips (n_problems, n_strips) [N].
    """
    matrix, by_load, by_value = problems.matrix, problems.by_load, problems.by_value
    if problems.strips is None:
        return np.asarray(solve_active(matrix, by_load, active) @ by_value)
    _, derivative = problems.strips.excess(force)
    closed, by_strip = problems.closed, problems.by_strip
    slope = np.empty(len(active))
    n, count = problems.sums.shape
    for k, row in enumerate(active):
        inside = np.flatnonzero(row)
        # forces of the strips: unknowns of open contacts, slacks of closed ones
        open_ = problems.sums.T * (row & ~closed)[:n]
        shut = problems.sums.T * (closed & ~row)[:n]
        into = np.zeros((count, len(row)))
        into[:, :n] = open_
        into = into + shut @ matrix[:n]
        d = derivative[k][:, None]
        system = np.block(
            [
                [matrix[np.ix_(inside, inside)], by_strip[inside]],
                [-d * into[:, inside], np.eye(count) - d * (shut @ by_strip[:n])],
            ]
        )
        right = [-by_load[inside], derivative[k] * (shut @ by_load[:n])]
        try:
            moves = np.linalg.solve(system, np.concatenate(right))
        except np.linalg.LinAlgError:
            moves = np.full(len(system), np.nan)
        slope[k] = np.concatenate([by_value[inside], problems.output_by_strip]) @ moves
    return slope

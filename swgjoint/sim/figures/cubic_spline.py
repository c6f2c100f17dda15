"""Cubic splines through samples, without an import of SciPy.

Importing SciPy's splines takes longer than a run needs for all its figures.
"""

from __future__ import annotations

import numpy as np

from swgjoint.kernels import kernels
from swgjoint.typing import Array


def interpolate_cubic(x: Array, y: Array, at: Array) -> Array:
    r"""Values of the cubic spline through samples, with not-a-knot ends.

    The second derivatives :math:`M_i` at the samples solve

    .. math:: h_{i-1} M_{i-1} + 2 (h_{i-1} + h_i) M_i + h_i M_{i+1}
        = 6 \left(\frac{y_{i+1} - y_i}{h_i} - \frac{y_i - y_{i-1}}{h_{i-1}}\right),
        \quad h_i = x_{i+1} - x_i ,

    and the third derivative does not jump at the second and the last but one sample.
    Without the compiled loops, SciPy's ``CubicSpline`` computes it.

    Args:
        x: Abscissas, increasing. Shape (n,) with n >= 5.
        y: Values. Shape (n,).
        at: Abscissas at which the spline is evaluated, within the samples. Shape (m,).

    Returns:
        Values of the spline. Shape (m,).
    """
    if (native := kernels()) is None:
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(x, y)(at))
    h = np.diff(x)
    slope = np.diff(y) / h
    # solutions for M = 0 at both ends, and for a unit of M at one of them
    columns = np.stack([2.0 * (h[:-1] + h[1:]), h[1:]], axis=-1)
    columns[-1, 1] = 0.0
    loads = np.zeros((x.size - 2, 3))
    loads[:, 0] = 6.0 * np.diff(slope)
    loads[0, 1], loads[-1, 2] = -h[0], -h[-1]
    assert native.solve_banded(columns, loads), "the abscissas do not increase"
    # M at both ends, on the lines through the two samples next to them
    line = np.array([1.0 + h[0] / h[1], -h[0] / h[1]])
    other = np.array([-h[-1] / h[-2], 1.0 + h[-1] / h[-2]])
    left, right = line @ loads[:2], other @ loads[-2:]
    matrix = np.array([[1.0 - left[1], -left[2]], [-right[1], 1.0 - right[2]]])
    first, last = np.linalg.solve(matrix, [left[0], right[0]])
    bend = np.concatenate([[first], loads @ [1.0, first, last], [last]])
    j = np.clip(np.searchsorted(x, at, side="right") - 1, 0, x.size - 2)
    tilt = slope - h * (2.0 * bend[:-1] + bend[1:]) / 6.0
    change = np.diff(bend) / (6.0 * h)
    d = at - x[j]
    return np.asarray(y[j] + d * (tilt[j] + d * (0.5 * bend[j] + d * change[j])))

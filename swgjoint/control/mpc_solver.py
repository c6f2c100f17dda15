r"""Many small quadratic programmes at once, by ADMM.

.. math:: \min_z \tfrac12 z^T H z + g^T z, \qquad l \le A z \le u

H and A of a kind are known before, so that an iteration is two products,

.. math::
    z \leftarrow (H + A^T R A)^{-1} (A^T(R w - y) - g), \quad
    w \leftarrow \mathrm{clip}(A z + R^{-1} y, l, u), \quad
    y \leftarrow y + R (A z - w)

Where no z is within all bounds, the result is close to the least violation.

Source:
    Stellato et al. (2020), "OSQP: an operator splitting solver for quadratic programs",
    Math. Prog. Comp. 12, 637-672; without its relaxation and step adaption.
"""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

ITERATIONS = 300
TOLERANCE = 1e-6
"""Largest violation, in the unit of the rows, at which the iteration ends."""


def prepare(hessian: Array, rows: Array) -> tuple[Array, Array]:
    """Inverse and weights R of a kind of programme.

    Args:
        hessian: H. Shape (..., n, n).
        rows: A. Shape (..., m, n).

    Returns:
        Shapes (..., n, n) and (..., m).
    """
    size = np.einsum("...ii->...", hessian) / hessian.shape[-1]
    weight = size[..., None] / np.maximum((rows**2).sum(axis=-1), 1e-300)
    whole = hessian + np.einsum("...mi,...m,...mj->...ij", rows, weight, rows)
    return np.linalg.inv(whole), weight


def solve(
    inverse: Array, weight: Array, rows: Array, g: Array, low: Array, high: Array
) -> Array:
    """Solutions z of programmes side by side.

    Args:
        inverse: From :func:`prepare`. Shape (k, n, n).
        weight: The same. Shape (k, m).
        rows: A. Shape (k, m, n).
        g: Shape (k, n).
        low: Shape (k, m).
        high: Shape (k, m).
    """
    w = np.clip(np.zeros_like(low), low, high)
    y = np.zeros_like(low)
    z = np.zeros_like(g)
    for _ in range(ITERATIONS):
        right = np.einsum("kmn,km->kn", rows, weight * w - y) - g
        z = np.einsum("kij,kj->ki", inverse, right)
        at = np.einsum("kmn,kn->km", rows, z)
        before, w = w, np.clip(at + y / weight, low, high)
        y = y + weight * (at - w)
        if max(np.abs(at - w).max(), np.abs(w - before).max()) < TOLERANCE:
            break
    return z

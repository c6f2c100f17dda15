r"""Solve many small quadratic programmes at once by ADMM.

.. math:: \min_z \tfrac12 z^T H z + g^T z, \qquad l \le A z \le u

H and A are known in advance, so that an iteration needs no factorisation:

.. math::
    z \leftarrow (H + A^T R A)^{-1} (A^T(R w - y) - g), \quad
    w \leftarrow \mathrm{clip}(A z + R^{-1} y, l, u), \quad
    y \leftarrow y + R (A z - w)

If no z satisfies the bounds, the result is close to the least violation.

Source:
    Stellato et al. (2020), "OSQP: an operator splitting solver for quadratic programs",
    Math. Prog. Comp. 12, 637-672; without its relaxation and step adaptation.
"""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

ITERATIONS = 300
"""Largest number of iterations."""
TOLERANCE = 1e-6
"""Residual below which the iteration ends, in the unit of A z."""


def prepare(hessian: Array, rows: Array) -> tuple[Array, Array]:
    """Compute the parts of the iteration that depend only on H and A.

    Args:
        hessian: Hessian H. Shape (..., n, n).
        rows: Constraint matrix A. Shape (..., m, n).

    Returns:
        Inverse of H + A^T R A, shape (..., n, n), and the diagonal of R, shape
        (..., m).
    """
    size = np.einsum("...ii->...", hessian) / hessian.shape[-1]
    weight = size[..., None] / np.maximum((rows**2).sum(axis=-1), 1e-300)
    whole = hessian + np.einsum("...mi,...m,...mj->...ij", rows, weight, rows)
    return np.linalg.inv(whole), weight


def solve(
    inverse: Array, weight: Array, rows: Array, g: Array, low: Array, high: Array
) -> Array:
    """Solve k programmes at once.

    Args:
        inverse: Inverse from :func:`prepare`. Shape (k, n, n).
        weight: Weights from :func:`prepare`. Shape (k, m).
        rows: Constraint matrices A. Shape (k, m, n).
        g: Linear terms. Shape (k, n).
        low: Lower bounds l. Shape (k, m).
        high: Upper bounds u. Shape (k, m).

    Returns:
        Solutions z. Shape (k, n).
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

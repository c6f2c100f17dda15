"""Direct solver for a symmetric ring of sectors with large faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from swgjoint.fe.common.cyclic import Insides, SingularCyclicError
from swgjoint.typing import Array, Index


class DenseCyclicFactor:
    """Factorised ring of symmetric sector matrices.

    It solves the same systems as :class:`swgjoint.fe.common.cyclic.CyclicFactor`, but
    in dense blocks, sector by sector, and without pivoting across blocks. For faces
    with a hundred degrees of freedom it is several times faster than a banded solver
    and has half of its fill. It first eliminates the interiors, then the faces one
    after the other. The elimination couples the last face to all others.
    """

    def __init__(self, blocks: Array, face: int) -> None:
        """Factorise the matrices of a ring.

        Args:
            blocks: Symmetric matrices of at least three sectors (N, n, n), with degrees
                of freedom in the order first face, interior, last face. The last face
                of a sector is the first face of the next one, cyclically.
            face: Number of degrees of freedom of a face.

        Raises:
            SingularCyclicError: If a pivot is zero.
        """
        self._last = last = len(blocks) - 1
        self._insides = Insides(blocks, face)
        schur, one, two = self._insides.schur, slice(0, face), slice(face, None)
        diagonal = schur[:, one, one] + np.roll(schur[:, two, two], 1, axis=0)
        ahead = schur[:last, one, two]  # from a face to the next one
        arrow = schur[last, two, one]  # from a face to the last one
        corner = diagonal[last].copy()
        self._lu, self._ahead, self._arrow = [], ahead[:-1], []
        for k in range(last):
            if k == last - 1:  # the next face is the last one
                arrow = arrow + ahead[k]
            lu = _factor(diagonal[k])
            far = lu_solve(lu, arrow, check_finite=False)
            corner -= arrow.T @ far
            self._lu.append(lu)
            self._arrow.append(arrow)
            if k < last - 1:
                near = lu_solve(lu, ahead[k], check_finite=False)
                diagonal[k + 1] -= ahead[k].T @ near
                arrow = -ahead[k].T @ far
        self._lu.append(_factor(corner))

    def solve(self, rhs: Array) -> Array:
        """Solve for k right-hand sides.

        Args:
            rhs: Right-hand sides by sector (N, n, k); contributions of two sectors to
                their shared face are added.

        Returns:
            Solution at the degrees of freedom of each sector (N, n, k).
        """
        last, lu = self._last, self._lu
        faces = self._insides.face_loads(rhs)
        for k in range(last):
            faces[k] = lu_solve(lu[k], faces[k], check_finite=False)
            if k < last - 1:
                faces[k + 1] -= self._ahead[k].T @ faces[k]
            faces[last] -= self._arrow[k].T @ faces[k]
        faces[last] = lu_solve(lu[last], faces[last], check_finite=False)
        for k in range(last - 1, -1, -1):
            pull = self._arrow[k] @ faces[last]
            if k < last - 1:
                pull += self._ahead[k] @ faces[k + 1]
            faces[k] -= lu_solve(lu[k], pull, check_finite=False)
        return self._insides.with_faces(faces, rhs)

    def respond(self, loads: Array, sector: Index, rows: Array) -> DenseResponse:
        """Response to d loads on all sectors and k loads on a single sector each.

        Args:
            loads: Loads on all sectors (N, n, d), as in :meth:`solve`.
            sector: Sectors of the other loads (k,).
            rows: Loads on these sectors (k, n).
        """
        d, k = loads.shape[2], len(rows)
        columns = np.concatenate([loads, np.zeros((*loads.shape[:2], k))], axis=2)
        columns[sector, :, d + np.arange(k)] = rows
        solved = self.solve(columns)
        products = np.einsum("snk,snl->kl", columns, solved, optimize=True)
        return DenseResponse(products=products, solved=solved)


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseResponse:
    """Response of a factorised ring to d + k loads."""

    products: Array
    """Products of the loads with the inverse matrix, symmetric (d + k, d + k)."""
    solved: Array
    """Solution for each of them (N, n, d + k)."""

    def combine(self, factors: Array) -> Array:
        """Solution for a linear combination of the loads (N, n).

        Args:
            factors: Factor of each load (d + k,).
        """
        return np.asarray(self.solved @ factors)


def _factor(matrix: Array) -> tuple[Array, Array]:
    lu, pivots = lu_factor(matrix, check_finite=False)
    if not np.abs(np.diag(lu)).min() > 0.0:
        raise SingularCyclicError
    return lu, pivots

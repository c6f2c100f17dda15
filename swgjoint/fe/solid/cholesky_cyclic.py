r"""Cholesky factorisation of a ring of sectors with large faces.

The interiors of all sectors are eliminated first, then the faces one after the other.
The elimination couples the last face to all others. With the lower factor L of a pivot
block and the blocks A that couple its unknowns to those that remain, the products
:math:`Y = L^{-1} A` are kept, and :math:`Y^T Y` is subtracted from the remaining
matrix.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dpotrf

from swgjoint.fe.solid.dense_cyclic import DenseCyclicFactor
from swgjoint.typing import Array


class IndefiniteCyclicError(ArithmeticError):
    """The matrix of the ring of sectors is not positive definite."""


class CholeskyCyclicFactor:
    """Factorised ring of symmetric sector matrices whose sum is positive definite.

    It solves the same systems as :class:`DenseCyclicFactor` with less than half of the
    operations. All blocks are stored transposed, which is the order of LAPACK.
    """

    def __init__(self, blocks: Array, face: int) -> None:
        """Factorise the matrices of a ring.

        Args:
            blocks: Symmetric matrices as in :class:`DenseCyclicFactor` (N, n, n).
            face: Number of degrees of freedom of a face.

        Raises:
            IndefiniteCyclicError: If the matrix is not positive definite.
        """
        sectors, n = blocks.shape[:2]
        self._face, self._last = face, sectors - 1
        self._begin, self._end = slice(0, face), slice(n - face, n)
        self._inner = inner = slice(face, n - face)
        inside = n - 2 * face
        self._inner_factor = np.empty((sectors, inside, inside))
        self._inner_reach = np.empty((sectors, 2 * face, inside))
        self._factor = np.empty((sectors, face, face))
        self._reach = np.empty((sectors - 1, 2 * face, face))
        # interiors; what remains couples both faces of a sector
        self._factor[:] = blocks[:, self._begin, self._begin]
        self._factor += np.roll(blocks[:, self._end, self._end], 1, axis=0)
        ahead = np.array(blocks[:, self._end, self._begin])
        for k, block in enumerate(blocks):
            reach = self._inner_reach[k]
            reach[:face], reach[face:] = block[:face, inner], block[self._end, inner]
            self._inner_factor[k] = block[inner, inner]
            _factorise(self._inner_factor[k])
            _divide(self._inner_factor[k], reach)
            self._factor[k] -= reach[:face] @ reach[:face].T
            self._factor[(k + 1) % sectors] -= reach[face:] @ reach[face:].T
            ahead[k] -= reach[face:] @ reach[:face].T
        # faces; the arrow couples each of them to the last one
        last, arrow = self._last, ahead[-1].T
        for k in range(last):
            reach = self._reach[k]
            if k == last - 1:  # the next face is the last one
                arrow = arrow + ahead[k]
                reach[:face] = 0.0
            else:
                reach[:face] = ahead[k]
            reach[face:] = arrow
            _factorise(self._factor[k])
            _divide(self._factor[k], reach)
            near, far = reach[:face], reach[face:]
            self._factor[last] -= far @ far.T
            if k < last - 1:
                self._factor[k + 1] -= near @ near.T
                arrow = -far @ near.T
        _factorise(self._factor[last])

    def solve(self, rhs: Array) -> Array:
        """Solve for k right-hand sides (N, n, k), see :class:`DenseCyclicFactor`."""
        face, last = self._face, self._last
        loads = np.ascontiguousarray(rhs.transpose(0, 2, 1))
        inside = np.ascontiguousarray(loads[:, :, self._inner])
        for k, reach in enumerate(self._inner_reach):
            _divide(self._inner_factor[k], inside[k])
            loads[k, :, self._begin] -= inside[k] @ reach[:face].T
            loads[k, :, self._end] -= inside[k] @ reach[face:].T
        faces = loads[:, :, self._begin] + np.roll(loads[:, :, self._end], 1, axis=0)
        # elimination, and substitution in the reverse order
        for k, reach in enumerate(self._reach):
            _divide(self._factor[k], faces[k])
            if k < last - 1:
                faces[k + 1] -= faces[k] @ reach[:face].T
            faces[last] -= faces[k] @ reach[face:].T
        _divide(self._factor[last], faces[last])
        _divide(self._factor[last], faces[last], transposed=True)
        for k in range(last - 1, -1, -1):
            reach = self._reach[k]
            faces[k] -= faces[last] @ reach[face:]
            if k < last - 1:
                faces[k] -= faces[k + 1] @ reach[:face]
            _divide(self._factor[k], faces[k], transposed=True)
        after = np.roll(faces, -1, axis=0)
        for k, reach in enumerate(self._inner_reach):
            inside[k] -= faces[k] @ reach[:face] + after[k] @ reach[face:]
            _divide(self._inner_factor[k], inside[k], transposed=True)
        solved = np.concatenate([faces, inside, after], axis=2)
        return np.asarray(solved.transpose(0, 2, 1))


def factorise_ring(
    blocks: Array, face: int
) -> CholeskyCyclicFactor | DenseCyclicFactor:
    """Factorise a ring, with pivoting only if it is not positive definite.

    Args:
        blocks: Symmetric matrices as in :class:`DenseCyclicFactor` (N, n, n).
        face: Number of degrees of freedom of a face.

    Raises:
        SingularCyclicError: If the matrix is singular.
    """
    try:
        return CholeskyCyclicFactor(blocks, face)
    except IndefiniteCyclicError:
        return DenseCyclicFactor(blocks, face)


def _factorise(matrix: Array) -> None:
    """Replace a symmetric matrix by the transpose of its lower factor, in place."""
    if not len(matrix):
        return
    _, info = dpotrf(matrix.T, lower=1, clean=0, overwrite_a=1)
    if info:
        raise IndefiniteCyclicError


def _divide(factor: Array, rows: Array, *, transposed: bool = False) -> None:
    """Multiply columns, stored as rows, by the inverse of a lower factor, in place."""
    if rows.size:
        dtrsm(1.0, factor.T, rows.T, lower=1, trans_a=int(transposed), overwrite_b=1)

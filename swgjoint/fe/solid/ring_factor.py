"""Direct solution of a symmetric ring of sectors with large faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from swgjoint.fe.cyclic import SingularRingError

Array = NDArray[np.float64]


class RingFactor:
    """Factorised ring of symmetric sector matrices.

    What :class:`swgjoint.fe.cyclic.CyclicFactor` does, sector by sector in dense blocks
    without its pivoting across them: for faces of a hundred degrees of freedom several
    times faster than a band, with half of the fill. The insides are eliminated first,
    then the faces one after the other; the last one is coupled to all.
    """

    def __init__(self, blocks: Array, face: int) -> None:
        """Factorise.

        Args:
            blocks: Symmetric sector matrices (N, n, n), degrees of freedom in the order
                first face, inside, last face; the last face of a sector is the first
                of the next, of the last sector that of sector 0. At least 3 sectors.
            face: Degrees of freedom of a face.

        Raises:
            SingularRingError: If a pivot vanishes.
        """
        n_sectors, n, _ = blocks.shape
        self._face, self._sectors = face, n_sectors
        self._inner = inner = slice(face, n - face)
        self._outer = outer = np.r_[0:face, n - face : n]
        try:
            self._inverse = np.linalg.inv(blocks[:, inner, inner])
        except np.linalg.LinAlgError as error:
            raise SingularRingError from error
        coupling = blocks[:, inner][:, :, outer]
        self._reach = self._inverse @ coupling
        schur = blocks[:, outer][:, :, outer]
        schur = schur - coupling.transpose(0, 2, 1) @ self._reach
        one, two = slice(0, face), slice(face, None)
        own = schur[:, one, one] + np.roll(schur[:, two, two], 1, axis=0)
        ahead = schur[:, one, two].copy()  # from a face to the next one
        arrow = schur[-1, two, one].copy()  # from a face to the last one
        corner = own[-1].copy()
        self._lu, self._ahead, self._arrow = [], [], []
        for k in range(n_sectors - 1):
            if k == n_sectors - 2:
                arrow = arrow + ahead[k]
            both = np.concatenate([ahead[k], arrow], axis=1)
            if k == n_sectors - 2:
                both = arrow
            lu = lu_factor(own[k], check_finite=False)
            if not np.abs(np.diag(lu[0])).min() > 0.0:
                raise SingularRingError
            solved = lu_solve(lu, both, check_finite=False)
            self._lu.append(lu)
            if k < n_sectors - 2:
                next_row = ahead[k].T @ solved
                own[k + 1] -= next_row[:, :face]
                corner -= arrow.T @ solved[:, face:]
                self._ahead.append(ahead[k])
                self._arrow.append(arrow)
                arrow = -next_row[:, face:]
            else:
                corner -= arrow.T @ solved
                self._arrow.append(arrow)
        self._corner = lu_factor(corner, check_finite=False)
        if not np.abs(np.diag(self._corner[0])).min() > 0.0:
            raise SingularRingError

    def solve(self, rhs: Array) -> Array:
        """Solve for many right-hand sides given per sector.

        Args:
            rhs: Contributions of each sector (N, n, k); those of a shared face add up.

        Returns:
            Solution at the degrees of freedom of each sector (N, n, k).
        """
        face, n, last = self._face, rhs.shape[1], self._sectors - 1
        inside = rhs[:, self._inner]
        outer = rhs[:, self._outer] - self._reach.transpose(0, 2, 1) @ inside
        faces = outer[:, :face] + np.roll(outer[:, face:], 1, axis=0)
        for k in range(last):
            faces[k] = lu_solve(self._lu[k], faces[k], check_finite=False)
            if k < last - 1:
                pushed = faces[k]
                faces[k + 1] -= self._ahead[k].T @ pushed
            faces[last] -= self._arrow[k].T @ faces[k]
        faces[last] = lu_solve(self._corner, faces[last], check_finite=False)
        for k in range(last - 1, -1, -1):
            pull = self._arrow[k] @ faces[last]
            if k < last - 1:
                pull += self._ahead[k] @ faces[k + 1]
            faces[k] -= lu_solve(self._lu[k], pull, check_finite=False)
        result = np.empty_like(rhs)
        result[:, :face] = faces
        result[:, n - face :] = np.roll(faces, -1, axis=0)
        both = result[:, self._outer]
        result[:, self._inner] = self._inverse @ inside - self._reach @ both
        return result

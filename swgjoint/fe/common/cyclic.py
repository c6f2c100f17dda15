"""Direct solution of rings of condensed sectors, and shifts of fields around a ring."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgbtrf, dgbtrs

from swgjoint.typing import Array, Index


class SingularCyclicError(ArithmeticError):
    """The system of equations of the ring of sectors is singular."""


class Insides:
    """Elimination of the interior unknowns of all sectors before those of the faces."""

    def __init__(self, blocks: Array, face: int) -> None:
        """Eliminate the interior unknowns.

        Args:
            blocks: Sector matrices (N, n, n) as in :class:`CyclicFactor`.
            face: Number of degrees of freedom of a face.

        Raises:
            SingularCyclicError: If an interior block is singular.
        """
        n_sectors, n = blocks.shape[:2]
        size = 2 * face
        self._face = face
        self._inner = slice(face, n - face)
        self._outer = np.r_[0:face, n - face : n]
        self._inverse = np.empty((n_sectors, n - size, n - size))
        self._reach = np.empty((n_sectors, n - size, size))
        self.schur = np.empty((n_sectors, size, size))
        """Schur complement of each sector on its two faces (N, 2 face, 2 face)."""
        self.update(blocks, np.arange(n_sectors))

    def update(self, blocks: Array, changed: Index) -> None:
        """Eliminate the interior unknowns of some sectors anew, in place.

        Args:
            blocks: All sector matrices after the change (N, n, n).
            changed: Sectors whose matrices changed (k,).

        Raises:
            SingularCyclicError: If an interior block is singular.
        """
        inner, outer = self._inner, self._outer
        try:
            self._inverse[changed] = np.linalg.inv(blocks[changed, inner, inner])
        except np.linalg.LinAlgError as error:
            raise SingularCyclicError from error
        # sector by sector: products of all sectors at once would not fit in the cache
        for k in changed:
            columns, reach = blocks[k][:, outer], self._reach[k]
            np.matmul(self._inverse[k], columns[inner], out=reach)
            np.subtract(columns[outer], columns[inner].T @ reach, out=self.schur[k])

    def face_loads(self, rhs: Array) -> Array:
        """Right-hand sides of the faces (N, face, k) from those of sectors (N, n, k).

        The contributions of both sectors to a face are added.
        """
        face, inside = self._face, rhs[:, self._inner]
        outer = rhs[:, self._outer] - self._reach.transpose(0, 2, 1) @ inside
        return np.asarray(outer[:, :face] + np.roll(outer[:, face:], 1, axis=0))

    def with_faces(self, faces: Array, rhs: Array) -> Array:
        """Solution at all degrees of freedom from the solution at the faces.

        Args:
            faces: Solution at the faces (N, face, k).
            rhs: Right-hand sides of the sectors (N, n, k).

        Returns:
            Solution of the sectors (N, n, k).
        """
        result = np.empty_like(rhs)
        result[:, : self._face] = faces
        result[:, rhs.shape[1] - self._face :] = np.roll(faces, -1, axis=0)
        both, inside = result[:, self._outer], rhs[:, self._inner]
        result[:, self._inner] = self._inverse @ inside - self._reach @ both
        return result


class CyclicFactor:
    """Factorised ring of sectors, each coupling its first face, interior and last face.

    The interior unknowns are eliminated sector by sector; the faces form a cyclic block
    tridiagonal matrix, which becomes banded when the ring is folded (order 0, N-1, 1,
    N-2, ...) and is factorised by LAPACK.
    """

    def __init__(self, blocks: Array, face: int) -> None:
        """Factorise the ring.

        Args:
            blocks: Sector matrices (N, n, n), degrees of freedom in the order first
                face, interior, last face. The last face of a sector is the first face
                of the next one; that of the last sector is the first face of sector 0.
            face: Number of degrees of freedom of a face.

        Raises:
            SingularCyclicError: If a pivot vanishes.
        """
        self._face, self._sectors = face, len(blocks)
        self._insides = Insides(blocks, face)
        self._factorise_faces()

    def update(self, blocks: Array, changed: Index) -> None:
        """Factorise the ring anew after a change of some sectors, in place.

        Args:
            blocks: All sector matrices after the change (N, n, n).
            changed: Sectors whose matrices changed (k,).

        Raises:
            SingularCyclicError: If a pivot vanishes.
        """
        self._insides.update(blocks, changed)
        self._factorise_faces()

    def _factorise_faces(self) -> None:
        n_sectors, face, schur = self._sectors, self._face, self._insides.schur
        order = np.empty(n_sectors, dtype=np.int64)
        order[0::2] = np.arange((n_sectors + 1) // 2)
        order[1::2] = n_sectors - 1 - np.arange(n_sectors // 2)
        position = np.empty_like(order)
        position[order] = np.arange(n_sectors)
        self._order = order
        # neighbours are at most two places apart in the folded order
        band = 3 * face - 1 if n_sectors > 2 else 2 * face - 1
        size = n_sectors * face
        packed = np.zeros((3 * band + 1, size))
        first = position
        last = np.roll(position, -1)
        dofs = np.concatenate(
            [
                first[:, None] * face + np.arange(face),
                last[:, None] * face + np.arange(face),
            ],
            axis=1,
        )

        def place(rows: Index, columns: Index) -> tuple[Index, Index]:
            """Indices of block entries in the packed band (N, rows, columns)."""
            down, across = rows[:, :, None], columns[:, None, :]
            across = np.broadcast_to(across, (n_sectors, face, face))
            return 2 * band + down - across, across

        begin, end = dofs[:, :face], dofs[:, face:]
        # both sectors contribute to the diagonal block of a face, one to the others
        both = schur[:, :face, :face] + np.roll(schur[:, face:, face:], 1, axis=0)
        packed[place(begin, begin)] = both
        # in rings of one or two sectors the off-diagonal blocks coincide as well
        np.add.at(packed, place(begin, end), schur[:, :face, face:])
        np.add.at(packed, place(end, begin), schur[:, face:, :face])
        self._band = band
        self._lu, self._pivots, info = dgbtrf(packed, band, band, overwrite_ab=True)
        if info != 0:
            raise SingularCyclicError

    def solve(self, rhs: Array) -> Array:
        """Solution for k right-hand sides.

        Args:
            rhs: Contributions of each sector (N, n, k); contributions to a shared face
                are added.

        Returns:
            Solution at the degrees of freedom of each sector (N, n, k).

        Raises:
            SingularCyclicError: If LAPACK rejects the system.
        """
        face = self._face
        faces = self._insides.face_loads(rhs)
        folded = faces[self._order].reshape(self._sectors * face, -1)
        solved, info = dgbtrs(self._lu, self._band, self._band, folded, self._pivots)
        if info != 0:
            raise SingularCyclicError
        faces = np.empty_like(faces)
        faces[self._order] = solved.reshape(self._sectors, face, -1)
        return self._insides.with_faces(faces, rhs)


def shift_rows(values: Array, shift: float) -> Array:
    """Rows shifted around the ring, interpolated by a cubic through four neighbours.

    Args:
        values: One row per sector (N, ...).
        shift: Shift in sectors, not necessarily an integer [-].
    """
    whole = int(np.floor(shift))
    t = shift - whole
    return np.asarray(
        t * (t + 1) * (t - 1) / 6 * np.roll(values, whole + 2, axis=0)
        - t * (t - 2) * (t + 1) / 2 * np.roll(values, whole + 1, axis=0)
        + (t - 1) * (t - 2) * (t + 1) / 2 * np.roll(values, whole, axis=0)
        - t * (t - 1) * (t - 2) / 6 * np.roll(values, whole - 1, axis=0)
    )

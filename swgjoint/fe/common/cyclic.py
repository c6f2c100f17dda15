"""Direct solution of rings of condensed sectors, and shifts of fields around a ring."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

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

    def outer_loads(self, sectors: Index, rhs: Array) -> Array:
        """Loads of some sectors on their two faces.

        Args:
            sectors: The sectors (m,).
            rhs: Their right-hand sides (m, n, k).

        Returns:
            Loads on first and last face (m, 2 face, k).
        """
        inside, reach = rhs[:, self._inner], self._reach[sectors]
        return np.asarray(rhs[:, self._outer] - reach.transpose(0, 2, 1) @ inside)

    def substitute_faces(self, sectors: Index, faces: Array, rhs: Array) -> Array:
        """Solution of some sectors from the solution at their faces.

        Args:
            sectors: The sectors (m,).
            faces: Solution at first and last face (m, 2 face, k).
            rhs: Right-hand sides of the sectors (m, n, k).

        Returns:
            Solution of the sectors (m, n, k).
        """
        result = np.empty_like(rhs)
        result[:, self._outer] = faces
        moved = self._inverse[sectors] @ rhs[:, self._inner]
        result[:, self._inner] = moved - self._reach[sectors] @ faces
        return result

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


@dataclass(frozen=True, kw_only=True)
class _Band:
    """Places of the faces of a folded ring in the packed band of LAPACK."""

    order: Index
    """Sector whose first face is at each place of the folded ring (N,)."""
    place: Index
    """Place of the first face of each sector (N,)."""
    width: int
    """Number of diagonals on either side."""
    diagonal: Index
    """Flat indices of the block of each face (N, face, face)."""
    forward: Index
    """Flat indices of the block that couples it with the next face (N, face, face)."""
    back: Index
    """Flat indices of the transposed block (N, face, face)."""

    @classmethod
    @lru_cache(maxsize=64)
    def fold(cls, sectors: int, face: int, first: int) -> _Band:
        """Fold a ring in the order first, first - 1, first + 1, first - 2, ...

        Args:
            sectors: Number of sectors N.
            face: Number of degrees of freedom of a face.
            first: Sector whose first face is eliminated first.
        """
        order = np.empty(sectors, dtype=np.int64)
        order[0::2] = np.arange((sectors + 1) // 2)
        order[1::2] = sectors - 1 - np.arange(sectors // 2)
        order = (order + first) % sectors
        place = np.empty_like(order)
        place[order] = np.arange(sectors)
        # neighbours are at most two places apart in the folded order
        width = 3 * face - 1 if sectors > 2 else 2 * face - 1
        begin = place[:, None] * face + np.arange(face)
        end = np.roll(begin, -1, axis=0)

        def flat(rows: Index, columns: Index) -> Index:
            down, across = rows[:, :, None], columns[:, None, :]
            return np.asarray(across * (3 * width + 1) + 2 * width + down - across)

        return cls(
            order=order,
            place=place,
            width=width,
            diagonal=flat(begin, begin),
            forward=flat(begin, end),
            back=flat(end, begin),
        )

    @classmethod
    def for_loads(cls, sectors: int, face: int, loaded: Index) -> _Band:
        """Fold a ring so that the faces of loaded sectors are eliminated last.

        Args:
            sectors: Number of sectors N.
            face: Number of degrees of freedom of a face.
            loaded: Sectors in which most of the loads act (k,).
        """
        place = cls.fold(sectors, face, 0).place
        faces = np.unique(np.concatenate([loaded, loaded + 1]) % sectors)
        starts = np.arange(sectors)
        places = place[(faces - starts[:, None]) % sectors]
        earliest = places.min(axis=1, initial=sectors)
        return cls.fold(sectors, face, int(earliest.argmax()))


class CyclicFactor:
    """Factorised ring of sectors, each coupling its first face, interior and last face.

    The interior unknowns are eliminated sector by sector; the faces form a cyclic block
    tridiagonal matrix, which becomes banded when the ring is folded (order 0, N-1, 1,
    N-2, ...) and is factorised by LAPACK.
    """

    def __init__(self, blocks: Array, face: int, loaded: Index | None = None) -> None:
        """Factorise the ring.

        Args:
            blocks: Sector matrices (N, n, n), degrees of freedom in the order first
                face, interior, last face. The last face of a sector is the first face
                of the next one; that of the last sector is the first face of sector 0.
            face: Number of degrees of freedom of a face.
            loaded: Sectors (k,) for which :meth:`solve_within` shall be cheap.

        Raises:
            SingularCyclicError: If a pivot vanishes.
        """
        self._face, self._sectors = face, len(blocks)
        some = np.zeros(0, dtype=np.int64) if loaded is None else loaded
        self._band = _Band.for_loads(self._sectors, face, some)
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
        face, schur, band = self._face, self._insides.schur, self._band
        packed = np.zeros(self._sectors * face * (3 * band.width + 1))
        # both sectors contribute to the diagonal block of a face, one to the others
        both = schur[:, :face, :face] + np.roll(schur[:, face:, face:], 1, axis=0)
        packed[band.diagonal] = both
        into = packed.__setitem__
        if self._sectors <= 2:  # the off-diagonal blocks coincide as well
            into = partial(np.add.at, packed)
        into(band.forward, schur[:, :face, face:])
        into(band.back, schur[:, face:, :face])
        # columns one after the other, as LAPACK has them
        matrix = packed.reshape(self._sectors * face, -1).T
        self._lu, self._pivots, info = dgbtrf(
            matrix, band.width, band.width, overwrite_ab=True
        )
        if info != 0:
            raise SingularCyclicError

    def _solve_faces(self, loads: Array, start: int) -> Array:
        """Solution at the last folded faces; those before ``start`` have no load.

        Args:
            loads: Loads on the folded unknowns from ``start`` on (m, k).
            start: First of these unknowns, ``band.width`` before the first load.
        """
        width = self._band.width
        solved, info = dgbtrs(
            self._lu[:, start:], width, width, loads, self._pivots[start:] - start
        )
        if info != 0:
            raise SingularCyclicError
        return np.asarray(solved)

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
        faces, order = self._insides.face_loads(rhs), self._band.order
        folded = faces[order].reshape(self._sectors * self._face, -1)
        faces[order] = self._solve_faces(folded, 0).reshape(faces.shape)
        return self._insides.with_faces(faces, rhs)

    def solve_within(self, sectors: Index, rhs: Array) -> Array:
        """Solution in some sectors for k right-hand sides that act only there.

        Args:
            sectors: Different sectors (m,).
            rhs: Contributions of these sectors (m, n, k).

        Returns:
            Solution at the degrees of freedom of these sectors (m, n, k).

        Raises:
            SingularCyclicError: If LAPACK rejects the system.
        """
        face, place = self._face, self._band.place
        ends = np.stack([place[sectors], place[(sectors + 1) % self._sectors]])
        first = int(ends.min(initial=self._sectors - 1))
        start = max(0, first * face - self._band.width)
        loads = np.zeros((self._sectors * face - start, rhs.shape[2]))
        at = ends[:, :, None] * face + np.arange(face) - start
        outer = self._insides.outer_loads(sectors, rhs)
        loads[at[0]] = outer[:, :face]
        # a sector may be the next one of another
        np.add.at(loads, at[1], outer[:, face:])
        solved = self._solve_faces(loads, start)
        both = np.concatenate([solved[at[0]], solved[at[1]]], axis=1)
        return self._insides.substitute_faces(sectors, both, rhs)


def shift_rows(values: Array, shift: float) -> Array:
    """Rows shifted around the ring, interpolated by a cubic through four neighbours.

    Args:
        values: One row per sector (N, ...).
        shift: Shift in sectors, not necessarily an integer [-].
    """
    whole = int(np.floor(shift))
    t, rows = shift - whole, np.arange(len(values)) - whole
    return np.asarray(
        t * (t + 1) * (t - 1) / 6 * values.take(rows - 2, axis=0, mode="wrap")
        - t * (t - 2) * (t + 1) / 2 * values.take(rows - 1, axis=0, mode="wrap")
        + (t - 1) * (t - 2) * (t + 1) / 2 * values.take(rows, axis=0, mode="wrap")
        - t * (t - 1) * (t - 2) / 6 * values.take(rows + 1, axis=0, mode="wrap")
    )

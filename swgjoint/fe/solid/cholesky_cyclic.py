r"""Cholesky factorisation of a ring of sectors with large faces.

The interiors of all sectors are eliminated first. Neighbouring sectors are then merged
in pairs, the pairs again in pairs, and so on; each merge eliminates the face between
two parts of the ring. With the lower factor L of a pivot block and the block A that
couples its unknowns to those of the two outer faces, the product :math:`Y = L^{-1} A`
is kept, and :math:`Y^T Y` is subtracted from the matrix of the outer faces.

A load on one sector passes only the few parts that contain this sector. Products
:math:`R^T A^{-1} R` of loads R need no back substitution: with the forward substitution
:math:`Z = L^{-1} R` they are :math:`Z^T Z`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from swgjoint.fe.solid.dense_cyclic import DenseCyclicFactor
from swgjoint.typing import Array, Index


class IndefiniteCyclicError(ArithmeticError):
    """The matrix of the ring of sectors is not positive definite."""


class SectorBlocks(Protocol):
    """Symmetric matrices of the sectors of a ring, an array (N, n, n) for example."""

    def __len__(self) -> int:
        """Number of sectors N."""

    def __getitem__(self, sector: int, /) -> Array:
        """Matrix of a sector (n, n)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A sector, two merged parts, or the closed ring, with its eliminated unknowns."""

    first: int
    """First sector."""
    end: int
    """Sector after the last one."""
    factor: Array
    """Transposed lower factor L of the p pivots (p, p)."""
    reach: Array
    """Transposed product Y: first face, then last face (2 face, p); no rows for the
    closed ring."""
    merged: tuple[int, ...] = ()
    """Numbers of the merged parts; empty for a sector."""


class CholeskyCyclicFactor:
    """Factorised ring of symmetric sector matrices whose sum is positive definite.

    It solves the same systems as :class:`DenseCyclicFactor` with less than half of the
    operations. All blocks are stored transposed, which is the order of LAPACK.
    """

    def __init__(self, blocks: SectorBlocks, face: int) -> None:
        """Factorise the matrices of a ring.

        Args:
            blocks: Symmetric matrices as in :class:`DenseCyclicFactor` (N, n, n).
            face: Number of degrees of freedom of a face.

        Raises:
            IndefiniteCyclicError: If the matrix is not positive definite.
        """
        self._face, self._sectors = face, len(blocks)
        self.parts: list[Part] = []
        """All parts; merged parts follow those that they consist of."""
        whole, outer = self._eliminate(blocks, 0, len(blocks))
        left, between, right = self._split(outer)
        closed = left + right
        closed += between
        closed += between.T
        self.parts.append(
            Part(
                first=0,
                end=len(blocks),
                factor=_factorised(closed),
                reach=np.zeros((0, face)),
                merged=(whole,),
            )
        )

    def _split(self, outer: Array) -> tuple[Array, Array, Array]:
        """Blocks of a matrix of two faces: first face, coupling, last face."""
        face = self._face
        return outer[:face, :face], outer[:face, face:], outer[face:, face:]

    def _eliminate(
        self, blocks: SectorBlocks, first: int, end: int
    ) -> tuple[int, Array]:
        """Eliminate all unknowns of some neighbouring sectors but their outer faces.

        Args:
            blocks: Matrices of all sectors (N, n, n).
            first: First of the sectors.
            end: Sector after the last one.

        Returns:
            Number of the part that they make up, and the upper triangle of the matrix
            of its outer faces.
        """
        face, outer = self._face, np.empty((2 * self._face, 2 * self._face))
        left, coupling, right = self._split(outer)
        merged: tuple[int, ...] = ()
        if end - first == 1:
            block = blocks[first]
            n = len(block)
            start, inner, stop = slice(face), slice(face, n - face), slice(n - face, n)
            left[:], coupling[:] = block[start, start], block[start, stop]
            right[:] = block[stop, stop]
            pivots = block[inner, inner].copy()
            reach = np.concatenate([block[start, inner], block[stop, inner]])
        else:
            middle = (first + end) // 2
            one, before = self._eliminate(blocks, first, middle)
            other, behind = self._eliminate(blocks, middle, end)
            merged = one, other
            left[:], to_middle, last = self._split(before)
            begin, from_middle, right[:] = self._split(behind)
            coupling[:] = 0.0
            pivots, reach = last + begin, np.concatenate([to_middle, from_middle.T])
        factor = _factorised(pivots)
        _divide(factor, reach)
        _subtract_square(outer, reach)
        self.parts.append(
            Part(first=first, end=end, factor=factor, reach=reach, merged=merged)
        )
        return len(self.parts) - 1, outer

    def respond(self, loads: Array, sector: Index, rows: Array) -> CholeskyResponse:
        """Response to d loads on all sectors and k loads on a single sector each.

        Args:
            loads: Loads on all sectors; contributions of two sectors to their shared
                face are added (N, n, d).
            sector: Sectors of the other loads (k,).
            rows: Loads on these sectors (k, n).
        """
        order = np.argsort(sector, kind="stable")
        begin = np.searchsorted(sector[order], np.arange(self._sectors + 1))
        d = loads.shape[2]
        products = np.zeros((d + len(rows), d + len(rows)))
        forward = list(self._forward(loads, rows[order], begin))
        for part, z in zip(self.parts, forward, strict=True):
            square, own = z @ z.T, slice(d + begin[part.first], d + begin[part.end])
            products[:d, :d] += square[:d, :d]
            products[:d, own] += square[:d, d:]
            products[own, own] += square[d:, d:]
        products[d:, :d] = products[:d, d:].T
        place = np.concatenate([np.arange(d), d + np.argsort(order)])
        return CholeskyResponse(
            products=products[np.ix_(place, place)],
            factor=self,
            forward=forward,
            begin=begin,
            order=np.concatenate([np.arange(d), d + order]),
        )

    def _forward(self, loads: Array, rows: Array, begin: Index) -> Iterator[Array]:
        """Forward substitution: loads on the pivots of each part, divided by L.

        Args:
            loads: Loads on all sectors (N, n, d).
            rows: Loads on single sectors, sorted by sector (k, n).
            begin: Range of the rows of each sector (N + 1,).

        Yields:
            Values of the d loads and of the rows within the part (d + k_part, p).
        """
        face, d = self._face, loads.shape[2]
        outer: list[Array] = []
        for part in self.parts:
            count = begin[part.end] - begin[part.first]
            faces = np.zeros((d + count, 2 * face))
            if not part.merged:
                own = rows[begin[part.first] : begin[part.end]]
                both = np.concatenate([loads[part.first].T, own])
                faces[:, :face], faces[:, face:] = both[:, :face], both[:, -face:]
                z = both[:, face : both.shape[1] - face].copy()
            elif len(part.merged) == 1:
                before = outer[part.merged[0]]
                z = before[:, :face] + before[:, face:]
            else:
                one, other = (outer[k] for k in part.merged)
                apart = len(one)
                faces[:apart, :face] = one[:, :face]
                faces[:d, face:], faces[apart:, face:] = (
                    other[:d, face:],
                    other[d:, face:],
                )
                z = np.concatenate([one[:, face:], other[d:, :face]])
                z[:d] += other[:d, :face]
            _divide(part.factor, z)
            if len(part.reach):
                faces -= z @ part.reach.T
            outer.append(faces)
            yield z

    def solve(self, rhs: Array) -> Array:
        """Solve for k right-hand sides (N, n, k), see :class:`DenseCyclicFactor`."""
        none = np.zeros(self._sectors + 1, dtype=np.int64)
        forward = list(self._forward(rhs, np.zeros((0, rhs.shape[1])), none))
        return np.asarray(self.substitute_back(forward).transpose(0, 2, 1))

    def substitute_back(self, forward: list[Array]) -> Array:
        """Back substitution after the forward substitution of k loads.

        Args:
            forward: Values on the pivots of each part (k, p).

        Returns:
            Solution at the degrees of freedom of each sector (N, k, n).
        """
        face, parts = self._face, self.parts
        k, inside = len(forward[0]), forward[0].shape[1]
        solved = np.empty((self._sectors, k, 2 * face + inside))
        outer: dict[int, Array] = {}
        for number in range(len(parts) - 1, -1, -1):
            part, x = parts[number], forward[number].copy()
            if len(part.reach):
                x -= outer[number] @ part.reach
            _divide(part.factor, x, transposed=True)
            if not part.merged:
                faces = outer.pop(number)
                both = faces[:, :face], x, faces[:, face:]
                solved[part.first] = np.concatenate(both, axis=1)
            elif len(part.merged) == 1:
                outer[part.merged[0]] = np.concatenate([x, x], axis=1)
            else:
                faces, (one, other) = outer.pop(number), part.merged
                outer[one] = np.concatenate([faces[:, :face], x], axis=1)
                outer[other] = np.concatenate([x, faces[:, face:]], axis=1)
        return solved


@dataclass(frozen=True, kw_only=True, eq=False)
class CholeskyResponse:
    """Response of a factorised ring R to d loads on all sectors and k on single ones.

    Only combinations of the responses need a back substitution.
    """

    products: Array
    """Products of the loads with the inverse matrix, symmetric (d + k, d + k)."""
    factor: CholeskyCyclicFactor
    forward: list[Array]
    """Forward substitution of the loads by part, in the order of the sectors."""
    begin: Index
    """Range of the single loads of each sector in this order (N + 1,)."""
    order: Index
    """Numbers of all loads in this order (d + k,)."""

    def combine(self, factors: Array) -> Array:
        """Solution for a linear combination of the loads (N, n).

        Args:
            factors: Factor of each load (d + k,).
        """
        ordered = factors[self.order]
        d = len(ordered) - int(self.begin[-1])
        forward = []
        for part, z in zip(self.factor.parts, self.forward, strict=True):
            own = slice(d + self.begin[part.first], d + self.begin[part.end])
            forward.append((ordered[:d] @ z[:d] + ordered[own] @ z[d:])[None])
        return np.asarray(self.factor.substitute_back(forward)[:, 0])


def factorise_ring(
    blocks: SectorBlocks, face: int
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
        every = np.stack([blocks[k] for k in range(len(blocks))])
        return DenseCyclicFactor(every, face)


def _factorised(matrix: Array) -> Array:
    """Transposed lower factor of a matrix, of which only the upper triangle is used.

    The factor replaces the matrix.
    """
    if len(matrix):
        _, info = dpotrf(matrix.T, lower=1, clean=0, overwrite_a=1)
        if info:
            raise IndefiniteCyclicError
    return matrix


def _divide(factor: Array, rows: Array, *, transposed: bool = False) -> None:
    """Multiply columns, stored as rows, by the inverse of a lower factor, in place."""
    if rows.size:
        dtrsm(1.0, factor.T, rows.T, lower=1, trans_a=int(transposed), overwrite_b=1)


def _subtract_square(matrix: Array, rows: Array) -> None:
    """Subtract R R^T from the upper triangle of a matrix, in place."""
    if rows.size:
        dsyrk(-1.0, rows.T, beta=1.0, c=matrix.T, trans=1, lower=1, overwrite_c=1)

r"""Factorised tangent of a ring of sectors, in compiled code where possible.

:meth:`RingFactor.condense` returns the matrix :math:`L^T A^{-1} L` of loads L that act
on all sectors or on a single one. A problem condensed to a few contacts needs nothing
else of the ring, and with a Cholesky factor it needs only the forward substitution.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.fe.common.cyclic import CyclicFactor
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

if TYPE_CHECKING:
    from swgjoint.kernels import compiled


class RingFactor:
    """Factorised ring of symmetric sector matrices.

    The compiled factorisation needs a positive definite matrix. Without it, or without
    compiled loops, :class:`swgjoint.fe.common.cyclic.CyclicFactor` is used instead.
    """

    def __init__(self, blocks: Array, face: int, loaded: Index | None = None) -> None:
        """Factorise the ring.

        Args:
            blocks: Symmetric sector matrices as in
                :class:`swgjoint.fe.common.cyclic.CyclicFactor` (N, n, n). The array is
                kept for updates.
            face: Number of degrees of freedom of a face.
            loaded: Sectors (k,) whose rows are passed to :meth:`condense`; others are
                possible as well.

        Raises:
            SingularCyclicError: If the matrix is singular.
        """
        self._blocks, self._face, self._loaded = blocks, face, loaded
        self._pivoted: CyclicFactor | None = None
        self._native: compiled.RingFactor | None = None
        if (native := kernels()) is not None:
            self._native = native.RingFactor(*blocks.shape[:2], face)
        self.update(np.arange(len(blocks)))

    def update(self, changed: Index) -> None:
        """Factorise the ring anew after some of its matrices were changed, in place.

        Args:
            changed: Sectors whose matrices changed (k,).

        Raises:
            SingularCyclicError: If the matrix becomes singular.
        """
        if self._native is not None:
            if self._native.update(np.ascontiguousarray(self._blocks), changed):
                return
            self._native = None
        if self._pivoted is None:
            self._pivoted = CyclicFactor(self._blocks, self._face, self._loaded)
        else:
            self._pivoted.update(self._blocks, changed)

    def solve(self, rhs: Array) -> Array:
        """Solve for k right-hand sides.

        Args:
            rhs: Contributions of each sector (N, n, k); contributions to a shared face
                are added.

        Returns:
            Solution at the degrees of freedom of each sector (N, n, k).
        """
        if self._pivoted is not None:
            return self._pivoted.solve(rhs)
        assert self._native is not None
        solved = np.array(rhs, order="C")
        self._native.solve(solved)
        return solved

    def condense(self, loads: Array, sector: Index, rows: Array) -> Array:
        """Products of loads with the inverse matrix.

        Args:
            loads: Loads on all sectors (N, n, d).
            sector: Sectors of the other loads (k,).
            rows: Loads on these sectors (k, n).

        Returns:
            Symmetric matrix over the d loads and then the k rows (d + k, d + k).
        """
        if self._pivoted is not None:
            return _condense(self._pivoted, loads, sector, rows)
        assert self._native is not None
        size = loads.shape[2] + len(rows)
        result = np.empty((size, size))
        self._native.condense(
            np.ascontiguousarray(loads),
            np.ascontiguousarray(sector),
            np.ascontiguousarray(rows),
            result,
        )
        return result

    def solve_contacts(
        self,
        loads: Array,
        sector: Index,
        rows: Array,
        gaps: tuple[Array, Array, Array, Array],
        *,
        turns: bool,
        held: bool,
        active: Mask,
        result: Array,
    ) -> tuple[Array, float] | None:
        """Contact forces of a Newton step of the 2D model, in compiled code only.

        See :class:`swgjoint.fe.plane.newton_step.NewtonProblem`, whose numpy version
        uses :meth:`condense` and :meth:`solve`.

        Args:
            loads: Minus the gradient and both constraints (N, n, 3).
            sector: Sectors of the k lines of force (k,).
            rows: Loads of the lines on these sectors (k, n).
            gaps: Gaps of the lines without forces (k,) [m], their lever arms (k,) [m],
                their compliance (k, k) [m/N], and three numbers: the stiffness of the
                anchor, the moment on the circular spline and the rotation error.
            turns: Whether the circular spline turns.
            held: Whether the rotation of the flexspline is prescribed.
            active: Whether each line carries force: first guess, then result (k,).
            result: Unknowns of the condensed system (k + 3,), written.

        Returns:
            Increment (N, n) [m] and compliance of the output [rad/(N·m)]. None without
            a compiled factor or if no set of active contacts is found; ``active`` is
            then of no use.
        """
        if self._native is None:
            return None
        increment = np.empty((*loads.shape[:2], 1))
        gap, arm, compliance, numbers = gaps
        output = self._native.solve_contacts(
            np.ascontiguousarray(loads),
            np.ascontiguousarray(sector),
            np.ascontiguousarray(rows),
            np.ascontiguousarray(gap),
            np.ascontiguousarray(arm),
            np.ascontiguousarray(compliance),
            np.ascontiguousarray(numbers),
            turns,
            held,
            active,
            result,
            increment,
        )
        return None if np.isnan(output) else (increment[:, :, 0], output)


def _condense(factor: CyclicFactor, loads: Array, sector: Index, rows: Array) -> Array:
    """Reference of :meth:`RingFactor.condense`."""
    d, k = loads.shape[2], len(rows)
    moved, result = factor.solve(loads), np.empty((d + k, d + k))
    result[:d, :d] = np.einsum("snf,snl->fl", loads, moved)
    by_row = np.einsum("kn,knf->kf", rows, moved[sector])
    result[d:, :d], result[:d, d:] = by_row, by_row.T
    sectors, which = np.unique(sector, return_inverse=True)
    pushes = np.zeros((len(sectors), rows.shape[1], k))
    pushes[which, :, np.arange(k)] = rows
    response = factor.solve_within(sectors, pushes)
    result[d:, d:] = _at_sectors(rows, which, response)
    return result


def _at_sectors(rows: Array, sector: Index, response: Array) -> Array:
    """Products of rows with the responses of their sectors (k, n_columns).

    Args:
        rows: One row per product (k, n).
        sector: Sector of each row (k,).
        response: Responses of all sectors (N, n, n_columns).
    """
    products = np.empty((len(rows), response.shape[2]))
    for number in np.unique(sector):
        here = sector == number
        products[here] = rows[here] @ response[number]
    return products

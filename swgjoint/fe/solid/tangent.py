r"""Factorised tangent of the ring, kept over iterations.

The tangent changes little between iterations near an equilibrium, except where bore
nodes open or close. With the derivative B of the gaps and the inverse compliance
:math:`W^{-1}` over the touching points, a sector whose contact changed from 0 to 1
changes by

.. math:: B_1^T W_1^{-1} B_1 - B_0^T W_0^{-1} B_0 = U C U^T ,

which has few columns U. The formula of Sherman, Morrison and Woodbury adds it to the
factorised tangent. The result of Newton's method does not depend on the tangent.
"""

from __future__ import annotations

import numpy as np

from swgjoint.fe.solid.cholesky_cyclic import factorise_ring
from swgjoint.fe.solid.linearise import BoreContact, SolidLinearised
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.typing import Array, Index

NEGLIGIBLE = 1e-3
"""Eigenvalues of a change that are neglected, relative to the largest of a sector [-].
"""


class SolidTangent:
    """Factorised tangent of the ring with the bore of the diaphragm held."""

    def __init__(self, model: SolidSectorModel, linear: SolidLinearised) -> None:
        """Factorise the tangent of a linearised ring.

        Args:
            model: The 3D model.
            linear: The linearised ring. Its tangent is overwritten.

        Raises:
            SingularCyclicError: If the tangent is singular.
        """
        if linear.hessian is None:
            raise ValueError("linear: linearised without a tangent")
        matrix, self._model = linear.hessian, model
        self._held = held = model.dofs(model.strip.masters.held)
        self.by_held = matrix[:, :, held]
        """Columns of the tangent of the degrees of freedom that are held (N, n, h)
        [N/m]."""
        n_sectors, size = matrix.shape[:2]
        scale = float(np.mean(np.einsum("sii->si", matrix)))
        matrix[:, held] = 0.0
        matrix[:, :, held] = 0.0
        matrix[:, held, held] = scale
        self._fixed = None
        if linear.race is not None:
            self._fixed = fixed = np.zeros((n_sectors, size), dtype=bool)
            fixed[:, model.race_dofs] = linear.race.fixed
            matrix[fixed] = 0.0
            matrix.transpose(0, 2, 1)[fixed] = 0.0
            matrix.reshape(n_sectors, -1)[:, :: size + 1][fixed] = scale
        # a half model is closed by the factors of its last face
        self._sign = sign = model.face_closure
        matrix[-1, -len(sign) :] *= sign[:, None]
        matrix[-1, :, -len(sign) :] *= sign
        self._factor = factorise_ring(matrix, len(sign))
        self._bore = linear.bore
        self._active = linear.bore.active

    def solve(self, columns: Array, bore: BoreContact) -> Array:
        """Solve the ring for k right-hand sides.

        Args:
            columns: Right-hand sides by sector, overwritten (N, n, k) [N].
            bore: Contact points on the bore; where other points touch than in the
                factorised tangent, the tangent follows.

        Returns:
            Solution at the degrees of freedom of each sector (N, n, k) [m].
        """
        k = columns.shape[2]
        sector, shape, stiffness = self._changes(bore)
        if len(sector):
            added = np.zeros((*columns.shape[:2], len(sector)))
            into = self._model.contact_dofs
            added[sector[:, None], into, np.arange(len(sector))[:, None]] = shape
            columns = np.concatenate([columns, added], axis=2)
        columns[:, self._held] = 0.0
        if self._fixed is not None:
            columns[self._fixed] = 0.0
        size = len(self._sign)
        columns[-1, -size:] *= self._sign[:, None]
        solved = self._factor.solve(columns)
        solved[-1, -size:] *= self._sign[:, None]
        if not len(sector):
            return solved
        seen = np.einsum("rm,rmk->rk", shape, solved[sector][:, into])
        system = np.diag(1.0 / stiffness) + seen[:, k:]
        answer = solved[..., :k] - solved[..., k:] @ np.linalg.solve(
            system, seen[:, :k]
        )
        return np.asarray(answer)

    def _changes(self, bore: BoreContact) -> tuple[Index, Array, Array]:
        """Change of the tangent since it was factorised.

        Returns:
            For each of r columns of U: its sector (r,), its components at the degrees
            of freedom on which the gaps depend (r, m), and its factor in C (r,) [N/m].
        """
        old = self._bore
        sectors, shapes, factors = [], [], []
        for s in np.flatnonzero((bore.active != self._active).any(axis=1)):
            now, was = bore.active[s], self._active[s]
            both = np.concatenate([bore.rows[s][now], old.rows[s][was]])
            n = int(now.sum())
            middle = np.zeros((len(both), len(both)))
            middle[:n, :n] = bore.inverse[s][np.ix_(now, now)]
            middle[n:, n:] = -old.inverse[s][np.ix_(was, was)]
            basis, parts = np.linalg.qr(both.T)
            values, vectors = np.linalg.eigh(parts @ middle @ parts.T)
            large = np.abs(values) > NEGLIGIBLE * np.abs(values).max(initial=0.0)
            shapes.append((basis @ vectors[:, large]).T)
            factors.append(values[large])
            sectors.append(np.full(int(large.sum()), s))
        if not sectors:
            none = np.zeros(0)
            return none.astype(np.int64), none, none
        return np.concatenate(sectors), np.concatenate(shapes), np.concatenate(factors)

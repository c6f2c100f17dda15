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

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.solid.cholesky_cyclic import CholeskyResponse, factorise_ring
from swgjoint.fe.solid.dense_cyclic import DenseResponse
from swgjoint.fe.solid.linearise import BoreContact, SolidLinearised
from swgjoint.fe.solid.sector_matrices import SupportedSectors
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
            linear: The linearised ring.

        Raises:
            SingularCyclicError: If the tangent is singular.
        """
        if linear.hessian is None:
            raise ValueError("linear: linearised without a tangent")
        self._model = model
        self._held = held = model.dofs(model.strip.masters.held)
        self.by_held = linear.hessian.columns(held)
        """Columns of the tangent of the degrees of freedom that are held (N, n, h)
        [N/m]."""
        self._fixed = None
        if linear.race is not None:
            self._fixed = np.zeros((model.sectors, model.size), dtype=bool)
            self._fixed[:, model.race_dofs] = linear.race.fixed
        # a half model is closed by the factors of its last face
        self._sign = sign = model.face_closure
        supported = SupportedSectors(
            matrices=linear.hessian,
            held=held,
            fixed=self._fixed,
            sign=sign,
            scale=linear.hessian.mean_diagonal,
        )
        self._factor = factorise_ring(supported, len(sign))
        self._bore = linear.bore
        self._active = linear.bore.active

    def respond(
        self, loads: Array, sector: Index, rows: Array, bore: BoreContact
    ) -> TangentResponse:
        """Response of the ring to d loads on all sectors and k loads on a single one.

        Args:
            loads: Loads on all sectors (N, n, d) [N].
            sector: Sectors of the other loads (k,).
            rows: Loads on these sectors (k, n) [N].
            bore: Contact points on the bore; where other points touch than in the
                factorised tangent, the tangent follows.
        """
        at, shape, stiffness = self._changes(bore)
        added = np.zeros((len(at), loads.shape[1]))
        added[:, self._model.contact_dofs] = shape
        sector, rows = np.concatenate([sector, at]), np.concatenate([rows, added])
        # no loads at prescribed degrees of freedom
        loads = loads.copy()
        loads[:, self._held] = rows[:, self._held] = 0.0
        if self._fixed is not None:
            loads[self._fixed] = 0.0
            rows[self._fixed[sector]] = 0.0
        last = slice(-len(self._sign), None)
        loads[-1, last] *= self._sign[:, None]
        rows[sector == len(loads) - 1, last] *= self._sign
        ring = self._factor.respond(loads, sector, rows)
        products = ring.products
        k = len(products) - len(at)
        system = np.diag(1.0 / stiffness) + products[k:, k:]
        correction = np.asarray(np.linalg.solve(system, products[k:, :k]))
        return TangentResponse(
            products=products[:k, :k] - products[:k, k:] @ correction,
            ring=ring,
            correction=correction,
            sign=self._sign,
        )

    def _changes(self, bore: BoreContact) -> tuple[Index, Array, Array]:
        """Change of the tangent since it was factorised.

        Returns:
            For each of r columns of U: its sector (r,), its components at the degrees
            of freedom on which the gaps depend (r, m), and its factor in C (r,) [N/m].
        """
        old = self._bore
        sectors, shapes, factors = [], [], []
        for s in np.flatnonzero((bore.active != self._active).any(axis=1)):
            now, was = int(bore.active[s].sum()), int(self._active[s].sum())
            both = np.concatenate([bore.rows[s, :now], old.rows[s, :was]])
            middle = np.zeros((len(both), len(both)))
            middle[:now, :now] = bore.inverse[s, :now, :now]
            middle[now:, now:] = -old.inverse[s, :was, :was]
            basis, parts = np.linalg.qr(both.T)
            values, vectors = np.linalg.eigh(parts @ middle @ parts.T)
            large = np.abs(values) > NEGLIGIBLE * np.abs(values).max(initial=0.0)
            shapes.append((basis @ vectors[:, large]).T)
            factors.append(values[large])
            sectors.append(np.full(int(large.sum()), s))
        if not sectors:
            shape = np.zeros((0, old.rows.shape[2]))
            return np.zeros(0, dtype=np.int64), shape, np.zeros(0)
        return np.concatenate(sectors), np.concatenate(shapes), np.concatenate(factors)


def keeps_tangent(
    history: list[float], since: int, limits: tuple[float, float], *, settled: bool
) -> bool:
    """Whether the next iteration can use the tangent of an earlier one.

    A kept tangent follows the contacts of the bore. While these change one after the
    other, a new tangent would not save iterations. Once they are settled, a tangent
    from farther away is renewed, because the compliance of the output follows from it.

    Args:
        history: Largest displacement increments of all iterations [m].
        since: Number of iterations before the tangent was computed.
        limits: Largest increment, and largest sum of increments at settled contact
            [m]; ratio of two increments above which settled iterations need a new
            tangent [-].
        settled: Whether the last iteration changed no contact of the bore.
    """
    keep_below, slowest = limits
    if not history or not history[-1] < keep_below:
        return False
    if not settled:
        return True
    slow = len(history) > 1 and not history[-1] < slowest * history[-2]
    return sum(history[since:]) < keep_below and not slow


@dataclass(frozen=True, kw_only=True, eq=False)
class TangentResponse:
    """Response of the ring to k loads."""

    products: Array
    """Products of the loads with the inverse tangent (k, k)."""
    ring: CholeskyResponse | DenseResponse
    """Response of the factorised ring to the loads and to the r columns of U."""
    correction: Array
    """Negative factors of the columns of U per load (r, k)."""
    sign: Array
    """Factors on the degrees of freedom of the face that closes the ring."""

    def combine(self, factors: Array) -> Array:
        """Motion of each sector under a combination of the loads (N, n).

        Args:
            factors: Factor of each load (k,).
        """
        moved = self.ring.combine(np.concatenate([factors, -self.correction @ factors]))
        moved[-1, -len(self.sign) :] *= self.sign
        return moved

"""Trilinear hexahedron with incompatible modes, for bending without locking."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from skfem import ElementHex1
from skfem.element import DiscreteField


class ElementHexIncompatible(ElementHex1):  # type: ignore[misc]
    r"""Eight-node hexahedron with three incompatible modes per component.

    Beside the trilinear functions the element has the modes :math:`4x(1-x)`,
    :math:`4y(1-y)` and :math:`4z(1-z)` as interior degrees of freedom. Their gradients
    are taken with the Jacobian of the element centre,

    .. math:: \nabla\phi = \frac{\det J_0}{\det J} J_0^{-T} \hat\nabla\phi,

    so that they do no work against a constant stress and the patch test holds on
    distorted meshes. The thesis uses the same class of element (C3D8I).

    Source:
        Taylor, Beresford and Wilson (1976), "A non-conforming element for stress
        analysis", IJNME 10, 1211-1219.
    """

    interior_dofs = 3
    dofnames: ClassVar[list[str]] = ["u", "bx", "by", "bz"]
    doflocs = np.concatenate([ElementHex1.doflocs, np.full((3, 3), 0.5)])

    def lbasis(self, X: Any, i: int) -> tuple[Any, Any]:
        """Trilinear functions 0 to 7, incompatible modes 8 to 10."""
        if i < 8:
            return super().lbasis(X, i)  # type: ignore[no-any-return]
        x = X[i - 8]
        slope = np.zeros_like(X)
        slope[i - 8] = 4 - 8 * x
        return 4 * x * (1 - x), slope

    def gbasis(
        self, mapping: Any, X: Any, i: int, tind: Any = None
    ) -> tuple[DiscreteField, ...]:
        """Map to the global element, the modes with the Jacobian of the centre."""
        if i < 8:
            return super().gbasis(mapping, X, i, tind)  # type: ignore[no-any-return]
        phi, dphi = self.lbasis(X, i)
        centre = np.full((3, 1), 0.5)
        inverse = mapping.invDF(centre, tind)[:, :, :, 0]  # (3, 3, n_elements)
        scale = mapping.detDF(centre, tind) / mapping.detDF(X, tind)
        # one set of points for all elements, or one per element (facets)
        points = "il" if np.ndim(X) == 2 else "ikl"
        grad = np.einsum(f"ijk,{points}->jkl", inverse, dphi) * scale
        value = np.broadcast_to(phi, grad.shape[1:])
        return (DiscreteField(value=value, grad=grad),)

"""Elements with incompatible modes, which bend without shear locking."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from skfem import ElementQuad1
from skfem.element import DiscreteField


class IncompatibleModes:
    r"""Mixin that adds the modes :math:`4x(1-x)`, one per direction, to an element.

    The modes are interior degrees of freedom of a linear element. Their gradients use
    the Jacobian at the element centre,

    .. math:: \nabla\phi = \frac{\det J_0}{\det J} J_0^{-T} \hat\nabla\phi,

    so that they do no work against a constant stress and the patch test holds on
    distorted meshes.

    Source:
        Taylor, Beresford and Wilson (1976), "A non-conforming element for stress
        analysis", International Journal for Numerical Methods in Engineering 10(6),
        1211-1219.
    """

    corners: ClassVar[int]
    """Number of shape functions of the linear element, one per corner."""

    def lbasis(self, X: Any, i: int) -> tuple[Any, Any]:
        """Local shape functions: those of the corners, then the incompatible modes.

        Args:
            X: Points in the reference element (dim, ...).
            i: Number of the shape function.

        Returns:
            Value (...) and gradient (dim, ...) in the reference element.
        """
        if i < self.corners:
            return super().lbasis(X, i)  # type: ignore[misc, no-any-return]
        x = X[i - self.corners]
        slope = np.zeros_like(X)
        slope[i - self.corners] = 4 - 8 * x
        return 4 * x * (1 - x), slope

    def gbasis(
        self, mapping: Any, X: Any, i: int, tind: Any = None
    ) -> tuple[DiscreteField, ...]:
        """Global shape functions; the modes use the Jacobian at the element centre.

        Args:
            mapping: Mapping of the mesh.
            X: Points in the reference element.
            i: Number of the shape function.
            tind: Elements to map; all if None.

        Returns:
            Discrete field with value and gradient.
        """
        if i < self.corners:
            return super().gbasis(mapping, X, i, tind)  # type: ignore[misc, no-any-return]
        phi, dphi = self.lbasis(X, i)
        centre = np.full((len(X), 1), 0.5)
        inverse = mapping.invDF(centre, tind)[:, :, :, 0]  # (dim, dim, n_elements)
        scale = mapping.detDF(centre, tind) / mapping.detDF(X, tind)
        # one set of points for all elements, or one per element (facets)
        points = "il" if np.ndim(X) == 2 else "ikl"
        grad = np.einsum(f"ijk,{points}->jkl", inverse, dphi) * scale
        value = np.broadcast_to(phi, grad.shape[1:])
        return (DiscreteField(value=value, grad=grad),)


class ElementQuadIncompatible(IncompatibleModes, ElementQuad1):  # type: ignore[misc]
    """Four-node quadrilateral with two incompatible modes per component (QM6).

    The thesis uses the same class of element (CPS4I).
    """

    corners = 4
    interior_dofs = 2
    dofnames: ClassVar[list[str]] = ["u", "bx", "by"]
    doflocs = np.array(
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5], [0.5, 0.5]]
    )

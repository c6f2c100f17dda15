"""2D linear elasticity on quadrilaterals: stiffness and stress recovery.

The section is in plane stress, in plane strain or in a state between the two.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from skfem import Basis, BilinearForm, ElementVector, MeshQuad
from skfem.helpers import ddot, eye, sym_grad, trace

from swgjoint.fe.common.element import ElementQuadIncompatible
from swgjoint.typing import Array


def plane_basis(mesh: MeshQuad) -> Basis:
    """Vector basis of incompatible-mode quadrilaterals with 2 x 2 Gauss points."""
    return Basis(mesh, ElementVector(ElementQuadIncompatible()), intorder=3)


def in_plane_constants(
    youngs_modulus: float, poisson_ratio: float, confinement: float
) -> tuple[float, float]:
    r"""Constants with which the plane-stress equations describe a confined section.

    The axial stress is the fraction c of its value in plane strain,
    :math:`\sigma_{zz} = c\nu(\sigma_{xx} + \sigma_{yy})`. Hooke's law in the plane
    then has the constants

    .. math:: E' = \frac{E}{1 - c\nu^2}, \quad
        \nu' = \frac{\nu(1 + c\nu)}{1 - c\nu^2}, \quad
        \frac{E'}{2(1 + \nu')} = \frac{E}{2(1 + \nu)} .

    Args:
        youngs_modulus: Young's modulus E [Pa].
        poisson_ratio: Poisson's ratio nu [-].
        confinement: Confinement c [-]; 0 is plane stress, 1 plane strain.

    Returns:
        E' [Pa] and nu' [-].
    """
    share = 1.0 - confinement * poisson_ratio**2
    constrained = poisson_ratio * (1.0 + confinement * poisson_ratio)
    return youngs_modulus / share, constrained / share


def stiffness_matrix(
    basis: Basis,
    youngs_modulus: float,
    poisson_ratio: float,
    width: float,
    confinement: float = 0.0,
) -> sparse.csr_matrix:
    r"""Stiffness matrix of a disc of constant width.

    .. math:: a(u, v) = w \int \sigma(u) : \varepsilon(v), \quad
        \sigma = 2\mu\varepsilon + \lambda^*\,\mathrm{tr}\,\varepsilon\,I, \quad
        \lambda^* = \frac{E'\nu'}{1-\nu'^2}

    In plane stress :math:`\lambda^* = 2\mu\lambda/(\lambda + 2\mu)`.

    Args:
        basis: Basis from :func:`plane_basis`.
        youngs_modulus: Young's modulus of the material [Pa].
        poisson_ratio: Poisson's ratio of the material [-].
        width: Width w of the disc [m].
        confinement: Confinement c, see :func:`in_plane_constants` [-].

    Returns:
        Sparse matrix (n_dofs, n_dofs) [N/m].
    """
    youngs_modulus, poisson_ratio = in_plane_constants(
        youngs_modulus, poisson_ratio, confinement
    )
    lame = youngs_modulus * poisson_ratio / (1.0 - poisson_ratio**2)
    shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio))

    @BilinearForm  # type: ignore[untyped-decorator]
    def elasticity(u: Any, v: Any, w: Any) -> Any:
        strain = sym_grad(u)
        stress = 2.0 * shear * strain + lame * eye(trace(strain), 2)
        return width * ddot(stress, sym_grad(v))

    return elasticity.assemble(basis).tocsr()


def nodal_stress_operator(
    basis: Basis,
    youngs_modulus: float,
    poisson_ratio: float,
    confinement: float = 0.0,
) -> sparse.csr_matrix:
    """Stress at the nodes as a linear operator on the degrees of freedom.

    The stress is evaluated at the 2 x 2 Gauss points, extrapolated bilinearly to the
    corners of each element and averaged with equal weights over the elements that share
    a node.

    Args:
        basis: Basis from :func:`plane_basis`.
        youngs_modulus: Young's modulus of the material [Pa].
        poisson_ratio: Poisson's ratio of the material [-].
        confinement: Confinement c, see :func:`in_plane_constants` [-].

    Returns:
        Matrix (3 n_nodes, n_dofs) [Pa/m]; rows 3 i to 3 i + 2 are xx, yy and xy of
        node i.
    """
    mesh = basis.mesh
    n_elements = mesh.t.shape[1]
    gauss = basis.X  # (2, n_points) on the unit square
    # bilinear extrapolation from the Gauss points to the corners
    corners = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])

    def bilinear(x: Array) -> Array:
        return np.stack([np.ones_like(x[0]), x[0], x[1], x[0] * x[1]], axis=-1)

    extrapolate = bilinear(corners) @ np.linalg.inv(bilinear(gauss))
    youngs_modulus, poisson_ratio = in_plane_constants(
        youngs_modulus, poisson_ratio, confinement
    )
    factor = youngs_modulus / (1.0 - poisson_ratio**2)
    law = factor * np.array(
        [
            [1.0, poisson_ratio, 0.0],
            [poisson_ratio, 1.0, 0.0],
            [0.0, 0.0, (1.0 - poisson_ratio) / 2.0],
        ]
    )
    weight = 1.0 / np.bincount(mesh.t.ravel(), minlength=mesh.p.shape[1])
    rows, columns, values = [], [], []
    for k in range(basis.Nbfun):
        grad = np.asarray(basis.basis[k][0].grad)  # (2, 2, n_elements, n_points)
        strain = np.stack([grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]])
        stress = np.einsum("ab,beq,cq->ace", law, strain, extrapolate)
        for c in range(4):
            node = mesh.t[c]
            for a in range(3):
                rows.append(3 * node + a)
                columns.append(basis.element_dofs[k])
                values.append(stress[a, c] * weight[node])
    shape = (3 * mesh.p.shape[1], basis.N)
    assert len(rows[0]) == n_elements
    return sparse.coo_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape
    ).tocsr()


def stress_maxima(stress: Array) -> tuple[Array, Array, Array]:
    """Largest tensile, largest compressive and von Mises stress at each point.

    The in-plane principal stresses determine the first two: the axial stress of a
    confined section is between the lowest and the highest of these stresses and zero.

    Args:
        stress: Components xx, yy, xy and, unless it is zero, zz in the last axis
            (..., 3 or 4) [Pa].

    Returns:
        Tensile stress, compressive stress as a magnitude, and von Mises stress, each of
        shape (...) [Pa]; the first two are zero if there is no tension or compression.
    """
    xx, yy, xy = stress[..., 0], stress[..., 1], stress[..., 2]
    middle, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    squared = xx**2 + yy**2 - xx * yy + 3.0 * xy**2
    if stress.shape[-1] == 4:
        zz = stress[..., 3]
        squared = squared + zz * (zz - xx - yy)
    return (
        np.maximum(middle + radius, 0.0),
        np.maximum(radius - middle, 0.0),
        np.sqrt(squared),
    )

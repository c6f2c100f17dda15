"""Linear elasticity of solids on hexahedra: stiffness and stress recovery."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from skfem import Basis, BilinearForm, ElementVector, MeshHex
from skfem.helpers import ddot, eye, sym_grad, trace

from swgjoint.fe.solid.strip.hexahedron import ElementHexIncompatible
from swgjoint.typing import Array

# components of stress and strain: xx, yy, zz, xy, yz, zx
ROWS, COLUMNS = (0, 1, 2, 0, 1, 2), (0, 1, 2, 1, 2, 0)


def solid_basis(mesh: MeshHex) -> Basis:
    """Vector basis of hexahedra with incompatible modes and 2 x 2 x 2 Gauss points."""
    return Basis(mesh, ElementVector(ElementHexIncompatible()), intorder=3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """Stiffness and stress of a mesh with n nodes in terms of nodal displacements.

    The degrees of freedom are x, y, z of one node after the other. The incompatible
    modes are eliminated element by element.
    """

    stiffness: sparse.csr_matrix
    """Stiffness (3 n, 3 n) [N/m]."""
    stress: sparse.csr_matrix
    """Nodal stress per displacement (6 n, 3 n) [Pa/m]; rows 6 i to 6 i + 5 contain the
    components xx, yy, zz, xy, yz, zx at node i."""


def solid(mesh: MeshHex, youngs_modulus: float, poisson_ratio: float) -> Solid:
    r"""Assemble stiffness and stress recovery of a mesh.

    .. math:: a(u, v) = \int \sigma(u) : \varepsilon(v), \quad
        \sigma = 2\mu\varepsilon + \lambda\,\mathrm{tr}\,\varepsilon\,I

    Args:
        mesh: Mesh of hexahedra.
        youngs_modulus: Young's modulus [Pa].
        poisson_ratio: Poisson's ratio [-].
    """
    basis = solid_basis(mesh)
    mu = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    lame = 2.0 * mu * poisson_ratio / (1.0 - 2.0 * poisson_ratio)

    @BilinearForm  # type: ignore[untyped-decorator]
    def elasticity(u: Any, v: Any, w: Any) -> Any:
        strain = sym_grad(u)
        stress = 2.0 * mu * strain + lame * eye(trace(strain), 3)
        return ddot(stress, sym_grad(v))

    # stiffness of the incompatible modes of every element, and its inverse
    matrix = elasticity.assemble(basis).tocsr()
    at_nodes = basis.nodal_dofs.T.ravel()
    modes = np.asarray(basis.interior_dofs)  # (9, n_elements)
    rows = np.broadcast_to(modes[:, None], (9, *modes.shape))
    columns = np.broadcast_to(modes[None], rows.shape)
    mode_stiffness = np.asarray(matrix[rows.ravel(), columns.ravel()]).reshape(
        rows.shape
    )
    inverse = np.linalg.inv(np.moveaxis(mode_stiffness, 2, 0))
    mode_inverse = sparse.block_diag(inverse, format="csr")
    # modes as functions of the nodal displacements, and the condensed matrices
    order = modes.T.ravel()
    coupling = matrix[order][:, at_nodes]
    from_nodes = -(mode_inverse @ coupling)
    reduced = matrix[at_nodes][:, at_nodes] + coupling.T @ from_nodes
    recovery = _stress_operator(basis, mu, lame)
    return Solid(
        stiffness=(0.5 * (reduced + reduced.T)).tocsr(),
        stress=(recovery[:, at_nodes] + recovery[:, order] @ from_nodes).tocsr(),
    )


def _stress_operator(basis: Basis, mu: float, lame: float) -> sparse.csr_matrix:
    """Nodal stress as a linear operator on all degrees of freedom.

    Stress is evaluated at the 2 x 2 x 2 Gauss points and extrapolated trilinearly to
    the corners of each element. At a node all its elements have the same weight.
    """
    mesh = basis.mesh
    corners = np.asarray(mesh.elem.doflocs).T  # (3, 8)

    def trilinear(x: Array) -> Array:
        one = np.ones_like(x[0])
        return np.stack(
            [
                *(one, x[0], x[1], x[2]),
                *(x[0] * x[1], x[1] * x[2], x[2] * x[0], x[0] * x[1] * x[2]),
            ],
            axis=-1,
        )

    extrapolate = trilinear(corners) @ np.linalg.inv(trilinear(np.asarray(basis.X)))
    weight = 1.0 / np.bincount(mesh.t.ravel(), minlength=mesh.p.shape[1])
    rows, columns, values = [], [], []
    for k in range(basis.Nbfun):
        grad = np.asarray(basis.basis[k][0].grad)  # (3, 3, n_elements, n_points)
        volume = lame * np.einsum("iieq->eq", grad)
        stress = np.stack(
            [
                mu * (grad[i, j] + grad[j, i]) + (volume if i == j else 0.0)
                for i, j in zip(ROWS, COLUMNS, strict=True)
            ]
        )
        at_corners = np.einsum("aeq,cq->ace", stress, extrapolate)
        for c in range(8):
            node = mesh.t[c]
            for a in range(6):
                rows.append(6 * node + a)
                columns.append(basis.element_dofs[k])
                values.append(at_corners[a, c] * weight[node])
    shape = (6 * mesh.p.shape[1], basis.N)
    entries = np.concatenate(rows), np.concatenate(columns)
    return sparse.coo_matrix((np.concatenate(values), entries), shape).tocsr()


def stress_maxima(stress: Array) -> tuple[Array, Array, Array]:
    """Extreme principal stresses and von Mises stress at every point [Pa].

    Args:
        stress: Stress with components xx, yy, zz, xy, yz, zx in the last axis [Pa].

    Returns:
        Largest tensile stress, largest compressive stress as a magnitude, and von Mises
        stress, all without the last axis of ``stress``.
    """
    tensor = np.empty((*stress.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):
        tensor[..., i, j] = tensor[..., j, i] = stress[..., k]
    principal = np.linalg.eigvalsh(tensor)
    xx, yy, zz, xy, yz, zx = np.moveaxis(stress, -1, 0)
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    von_mises = np.sqrt(0.5 * normal + 3.0 * (xy**2 + yz**2 + zx**2))
    return (
        np.maximum(principal[..., 2], 0.0),
        np.maximum(-principal[..., 0], 0.0),
        von_mises,
    )

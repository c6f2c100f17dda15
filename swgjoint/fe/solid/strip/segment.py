"""Static condensation of the segments of a strip to masters and loaded surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from swgjoint.fe.solid.strip.elasticity import Solid, solid
from swgjoint.fe.solid.strip.masters import SegmentMasters
from swgjoint.fe.solid.strip.mesh import SegmentMesh
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class StripSegment:
    r"""One condensed segment in the frame of its tooth.

    With d the displacements of its masters, F forces on the loaded surfaces:

    .. math:: u_b = A d + C F, \quad f = \hat K d - A^T F,

    and every node moves by :math:`u = N d + N_F F`. Vectors list x, y, z point after
    point.
    """

    name: str
    mesh: SegmentMesh
    masters: Index
    """Masters of the strip (n_m,)."""
    position: Array
    """Their reference positions (n_m, 3) [m]."""
    stiffness: Array
    """K hat [N/m]. Shape (3 n_m, 3 n_m)."""
    loaded: Index
    """Loaded degrees of freedom among those of the nodes (n_b,); none for a cup."""
    spread: sparse.csr_matrix
    """S, forces there of forces F; u_b are averages with it (n_b, n_b)."""
    loaded_from_masters: Array
    """A. Shape (n_b, 3 n_m)."""
    compliance: Array
    """C [m/N]. Shape (n_b, n_b)."""
    nodal: Array
    """N. Shape (3 n_nodes, 3 n_m)."""
    nodal_from_force: Array
    """N_F [m/N]. Shape (3 n_nodes, n_b)."""
    stress: sparse.csr_matrix
    """Stress at the nodes from their displacements (6 n_nodes, 3 n_nodes) [Pa/m]."""

    def nodal_force(self, force: Array) -> Array:
        """Forces S F at the loaded degrees of freedom (n, n_b) [N]."""
        return np.asarray((self.spread @ force.T).T)

    def displacement(self, d: Array, force: Array | None = None) -> Array:
        """Displacement of all nodes (n, n_nodes, 3) [m].

        Args:
            d: Of the masters in n sectors (n, 3 n_m) [m].
            force: F on the loaded surfaces (n, n_b) [N].
        """
        u = d @ self.nodal.T
        if force is not None:
            u += force @ self.nodal_from_force.T
        return u.reshape(len(d), -1, 3)

    def stresses(self, u: Array) -> Array:
        """Stress xx, yy, zz, xy, yz, zx at the nodes (n, n_nodes, 6) [Pa].

        Args:
            u: From :meth:`displacement`.
        """
        found = self.stress @ u.reshape(len(u), -1).T
        return np.asarray(found.T).reshape(len(u), -1, 6)


def condense_segment(
    mesh: SegmentMesh,
    masters: SegmentMasters,
    position: Array,
    *,
    youngs_modulus: float,
    poisson_ratio: float,
    loaded: Index | None = None,
    spread: sparse.csr_matrix | None = None,
    held: Index | None = None,
) -> StripSegment:
    """Condense a segment, in real arithmetic, once per member.

    Args:
        mesh: The segment.
        masters: What its faces and sections follow.
        position: All masters of the strip (n, 3) [m].
        youngs_modulus: [Pa].
        poisson_ratio: [-].
        loaded: Degrees of freedom at which forces may act (n_b,).
        spread: S of :class:`StripSegment`; by default forces act where they are.
        held: Nodes that do not move, beside the boundary.
    """
    body = solid(mesh.mesh, youngs_modulus, poisson_ratio)
    return _condensed(mesh, body, masters, position, loaded, spread, held)


def _condensed(
    mesh: SegmentMesh,
    body: Solid,
    masters: SegmentMasters,
    position: Array,
    loaded: Index | None,
    spread: sparse.csr_matrix | None,
    held: Index | None,
) -> StripSegment:
    def dofs(nodes: Index) -> Index:
        return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel(), dtype=np.int64)

    matrix, size = body.stiffness.tocsc(), body.stiffness.shape[0]
    boundary = dofs(masters.boundary)
    fixed = boundary if held is None else np.union1d(boundary, dofs(held))
    free = np.setdiff1d(np.arange(size), fixed)
    follow = np.kron(masters.weight, np.eye(3))
    force_dofs = np.zeros(0, dtype=np.int64) if loaded is None else loaded
    if spread is None:
        spread = sparse.eye_array(len(force_dofs), format="csr")
    factor = splu(
        matrix[free][:, free].tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    )
    pull = matrix[free][:, boundary] @ follow
    units = np.zeros((len(free), len(force_dofs)))
    units[np.searchsorted(free, force_dofs)] = spread.toarray()
    solved = factor.solve(np.concatenate([-pull, units], axis=1))
    n = follow.shape[1]
    nodal = np.zeros((size, n))
    nodal[boundary], nodal[free] = follow, solved[:, :n]
    nodal_from_force = np.zeros((size, len(force_dofs)))
    nodal_from_force[free] = solved[:, n:]
    stiffness = follow.T @ (matrix[boundary][:, boundary] @ follow)
    stiffness += pull.T @ solved[:, :n]
    stiffness = 0.5 * (stiffness + stiffness.T)
    if held is None:
        # strips travel a thousand times farther than they strain: make rigid
        # translation free of force to the last digit, not only to the solver's
        count = n // 3
        move = np.tile(np.eye(3), (count, 1)) / np.sqrt(count)
        strain = np.eye(n) - move @ move.T
        stiffness = strain @ stiffness @ strain
        carried = np.tile(np.eye(3), (size // 3, 1)) / np.sqrt(count)
        nodal += (carried - nodal @ move) @ move.T
    compliance = spread.T @ nodal_from_force[force_dofs]
    return StripSegment(
        name=mesh.name,
        mesh=mesh,
        masters=masters.masters,
        position=position[masters.masters],
        stiffness=stiffness,
        loaded=force_dofs,
        spread=spread,
        loaded_from_masters=spread.T @ nodal[force_dofs],
        compliance=0.5 * (compliance + compliance.T),
        nodal=nodal,
        nodal_from_force=nodal_from_force,
        stress=body.stress,
    )

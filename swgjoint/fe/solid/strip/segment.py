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

    With the displacements d of its masters and the forces F on its loaded surfaces, the
    displacements of these surfaces and the forces on the masters are

    .. math:: u_b = A d + C F, \quad f = \hat K d - A^T F,

    and all nodes move by :math:`u = N d + N_F F`. Vectors contain x, y, z of one point
    after the other.
    """

    name: str
    mesh: SegmentMesh
    masters: Index
    """Numbers of its masters in the strip (n_m,)."""
    position: Array
    """Reference positions X of its masters (n_m, 3) [m]."""
    stiffness: Array
    """Stiffness K hat (3 n_m, 3 n_m) [N/m]."""
    loaded: Index
    """Loaded degrees of freedom among those of all nodes (n_b,); empty for segments of
    the cup."""
    spread: sparse.csr_matrix
    """Matrix S from the forces F to nodal forces; its transpose averages nodal
    displacements to u_b (n_b, n_b) [-]."""
    loaded_from_masters: Array
    """Matrix A from masters to loaded surfaces (n_b, 3 n_m) [-]."""
    compliance: Array
    """Compliance C of the loaded surfaces with fixed masters (n_b, n_b) [m/N]."""
    nodal: Array
    """Matrix N from masters to all nodes (3 n_nodes, 3 n_m) [-]."""
    nodal_from_force: Array
    """Displacement N_F of all nodes per force F (3 n_nodes, n_b) [m/N]."""
    stress: sparse.csr_matrix
    """Nodal stress per nodal displacement (6 n_nodes, 3 n_nodes) [Pa/m]."""

    def nodal_force(self, force: Array) -> Array:
        """Nodal forces S F at the loaded degrees of freedom (n, n_b) [N].

        Args:
            force: Forces F on the loaded surfaces (n, n_b) [N].
        """
        return np.asarray((self.spread @ force.T).T)

    def displacement(self, d: Array, force: Array | None = None) -> Array:
        """Displacements of all nodes (n, n_nodes, 3) [m].

        Args:
            d: Displacements of the masters in n sectors (n, 3 n_m) [m].
            force: Forces F on the loaded surfaces (n, n_b) [N]; None if unloaded.
        """
        u = d @ self.nodal.T
        if force is not None:
            u += force @ self.nodal_from_force.T
        return u.reshape(len(d), -1, 3)

    def stresses(self, u: Array) -> Array:
        """Stress xx, yy, zz, xy, yz, zx at the nodes (n, n_nodes, 6) [Pa].

        Args:
            u: Displacements of all nodes, see :meth:`displacement` (n, n_nodes, 3) [m].
        """
        stress = self.stress @ u.reshape(len(u), -1).T
        return np.asarray(stress.T).reshape(len(u), -1, 6)


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
    """Condense a segment to its masters and loaded surfaces.

    Args:
        mesh: Mesh of the segment.
        masters: Masters that move its faces and sections.
        position: Positions of all masters of the strip (n, 3) [m].
        youngs_modulus: Young's modulus [Pa].
        poisson_ratio: Poisson's ratio [-].
        loaded: Degrees of freedom at which forces may act (n_b,); None if there are
            none.
        spread: Matrix S of :class:`StripSegment` (n_b, n_b); None if the forces are not
            spread.
        held: Numbers of nodes that are fixed in space, in addition to those that follow
            the masters; None if there are none.
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

    # nodes on the boundary follow the masters, all others are free
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
    # response of the free nodes to the masters and to forces on the loaded surfaces
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
        # strips move a thousand times more than they deform: a rigid translation must
        # cause no forces within rounding, not only within the accuracy of the solver
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

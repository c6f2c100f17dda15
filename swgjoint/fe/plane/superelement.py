"""Static condensation of a tooth sector to its faces, its bore and its flanks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse.linalg import splu

from swgjoint.fe.common.contact_patch import average_spline
from swgjoint.fe.plane.elasticity import (
    nodal_stress_operator,
    plane_basis,
    stiffness_matrix,
)
from swgjoint.fe.plane.sector_mesh import SectorMesh
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Superelement:
    r"""Condensed sector, in the frame of its tooth (tooth centred on +y).

    The n_a skeleton nodes (a) are those of the first face, then those of the bore
    between the faces, then those of the last face. The n_b flank nodes (b) are those of
    the right and then those of the left flank, without the nodes on the faces. Under
    forces F on the flank nodes, the flank displacements, the forces on the skeleton and
    the stresses are

    .. math:: d_b = A d_a + C F, \quad
        f_a = \hat K d_a - A^T F, \quad
        \sigma = M_a d_a + M_F F .

    Vectors list x and y of the first node, then of the next one, and so on.
    """

    sectors: int
    """Number of sectors of the whole member."""
    skeleton: Array
    """Reference positions of the skeleton nodes (n_a, 2) [m]."""
    face_size: int
    """Number of nodes of a face."""
    stiffness: Array
    """Condensed stiffness K hat (2 n_a, 2 n_a) [N/m]."""
    flank_from_skeleton: Array
    """Flank displacement per skeleton displacement, A (2 n_b, 2 n_a) [-]."""
    flank_compliance: Array
    """Flank displacement per flank force, C (2 n_b, 2 n_b) [m/N]."""
    stress_from_skeleton: Array
    """Stress per skeleton displacement, M_a (n_nodes, 3, 2 n_a) [Pa/m]."""
    stress_from_flank: Array
    """Stress per flank force, M_F (n_nodes, 3, 2 n_b) [Pa/N]."""
    displacement_from_skeleton: Array
    """Displacement of all nodes per skeleton displacement (n_nodes, 2, 2 n_a) [-]."""
    displacement_from_flank: Array
    """Displacement of all nodes per flank force (n_nodes, 2, 2 n_b) [m/N]."""
    axial_stress: float = 0.0
    """Axial stress divided by the sum of the in-plane normal stresses, c nu [-]; see
    :func:`swgjoint.fe.plane.elasticity.in_plane_constants`."""
    mesh: SectorMesh
    """Mesh of the sector."""
    profile: ToothProfile
    """Tooth profile."""
    spline: CubicSpline
    """Weights of one flank's nodes in the mean displacement of a contact patch, as
    functions of the arc length [m] of its centre."""

    @cached_property
    def mean_stiffness(self) -> float:
        """Mean of the diagonal of K hat [N/m]."""
        return float(np.mean(np.diag(self.stiffness)))

    @cached_property
    def slope_products(self) -> Array:
        """Matrix Q of the second-order elongation (2 n_a, 2 n_a) [1/m]."""
        return np.asarray(self.rim_slopes.T @ self.rim_slopes)

    @cached_property
    def turning_parts(self) -> Array:
        r"""Parts of K hat and of Q that turn with the sector.

        In axes from which the sector is turned by :math:`\varphi`, the matrices are
        the sums of their parts times :math:`1, \cos 2\varphi, \sin 2\varphi`.

        Returns:
            Flattened matrices, three parts of K hat and three of Q (6, (2 n_a)^2).
        """
        parts = []
        for matrix in (self.stiffness, self.slope_products):
            blocks = matrix.reshape(len(self.skeleton), 2, len(self.skeleton), 2)
            (xx, xy), (yx, yy) = blocks.transpose(1, 3, 0, 2)
            even, odd = 0.5 * (xx + yy), 0.5 * (xy - yx)
            along, across = 0.5 * (xx - yy), 0.5 * (xy + yx)
            for part in (
                [[even, odd], [-odd, even]],
                [[along, across], [across, -along]],
                [[-across, along], [along, across]],
            ):
                parts.append(np.array(part).transpose(2, 0, 3, 1).ravel())
        return np.array(parts)

    @property
    def flank_size(self) -> int:
        """Number of nodes of one flank."""
        return int(self.flank_compliance.shape[0]) // 4

    @property
    def bore_size(self) -> int:
        """Number of bore nodes inside the sector, without its corners."""
        return len(self.skeleton) - 2 * self.face_size

    @cached_property
    def rim_slopes(self) -> Array:
        r"""Matrix B that gives the rotations of the bore relative to the sector frame.

        It has one row per interval between bore nodes, multiplied by the square root of
        the interval's length, so that :math:`\int \omega^2 ds = d^T B^T B d`.
        Shape (n_bore + 1, 2 n_a) [m^(-1/2)].
        """
        size, count = self.face_size, len(self.skeleton)
        along = np.r_[size - 1 : size + self.bore_size, count - 1]
        chord = np.diff(self.skeleton[along], axis=0)
        length = np.hypot(chord[:, 0], chord[:, 1])
        # rotation of a chord: relative normal motion of its ends divided by its length
        row = np.stack([-chord[:, 1], chord[:, 0]], axis=-1) / length[:, None] ** 1.5
        rows, interval = np.zeros((len(chord), count, 2)), np.arange(len(chord))
        rows[interval, along[1:]] = row
        rows[interval, along[:-1]] = -row
        return rows.reshape(len(chord), -1)

    @cached_property
    def elongation(self) -> Array:
        """Displacements p that elongate the bore by one unit of length (2 n_a,) [-].

        The elongation is uniform over the sector.
        """
        size = self.face_size
        x = self.skeleton[:, 0]
        moved = np.zeros_like(self.skeleton)
        moved[:, 0] = (x - x.mean()) / abs(x[size - 1] - x[-1])
        return moved.ravel()

    @cached_property
    def flank_range(self) -> tuple[float, float]:
        """Arc lengths [m] between which a flank can touch: from land to land."""
        low, high = self.profile.contact_range
        return max(low, float(self.spline.x[0])), min(high, float(self.spline.x[-1]))


def condense(
    mesh: SectorMesh,
    profile: ToothProfile,
    *,
    youngs_modulus: float,
    poisson_ratio: float,
    width: float,
    confinement: float = 0.0,
) -> Superelement:
    """Condensed sector of a tooth from its mesh.

    Args:
        mesh: Mesh of the sector.
        profile: Tooth profile from which the mesh was made.
        youngs_modulus: Young's modulus of the material [Pa].
        poisson_ratio: Poisson's ratio of the material [-].
        width: Face width [m].
        confinement: Confinement [-]; 0 is plane stress, 1 plane strain.
    """
    basis = plane_basis(mesh.mesh)
    matrix = stiffness_matrix(basis, youngs_modulus, poisson_ratio, width, confinement)
    skeleton = np.concatenate([mesh.face_first, mesh.bore[1:-1], mesh.face_last])
    flank = np.concatenate([mesh.flank_right[:-1], mesh.flank_left[:-1]])

    def dofs(nodes: Index) -> Index:
        return np.asarray(basis.nodal_dofs[:, nodes].T.ravel(), dtype=np.int64)

    a, b = dofs(skeleton), dofs(flank)
    kept = np.concatenate([a, b])
    inner = np.setdiff1d(np.arange(basis.N), kept)
    columns = matrix.tocsc()
    factor = splu(
        columns[np.ix_(inner, inner)],
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    )
    inner_from_kept = -factor.solve(columns[np.ix_(inner, kept)].toarray())
    reduced = columns[np.ix_(kept, kept)].toarray()
    reduced += columns[np.ix_(kept, inner)] @ inner_from_kept
    reduced = 0.5 * (reduced + reduced.T)

    n = a.size
    compliance = np.linalg.inv(reduced[n:, n:])
    compliance = 0.5 * (compliance + compliance.T)
    flank_from_skeleton = -compliance @ reduced[n:, :n]
    stiffness = reduced[:n, :n] + reduced[:n, n:] @ flank_from_skeleton
    stiffness = 0.5 * (stiffness + stiffness.T)

    # all degrees of freedom from the kept ones, then from skeleton and flank forces
    recovery = np.zeros((basis.N, kept.size))
    recovery[kept, np.arange(kept.size)] = 1.0
    recovery[inner] = inner_from_kept
    all_from_a = recovery[:, :n] + recovery[:, n:] @ flank_from_skeleton
    all_from_flank = recovery[:, n:] @ compliance
    operator = nodal_stress_operator(basis, youngs_modulus, poisson_ratio, confinement)
    from_a, from_flank = operator @ all_from_a, operator @ all_from_flank
    at_nodes = basis.nodal_dofs.T.ravel()
    # sectors move a thousand times farther than they deform, so the error of the sparse
    # solver is too large: make translations free of force and stress to round-off
    move = np.tile(np.eye(2), (len(skeleton), 1)) / np.sqrt(len(skeleton))
    strain = np.eye(n) - move @ move.T
    stiffness = strain @ stiffness @ strain
    from_a = from_a @ strain
    carried = np.tile(np.eye(2), (len(flank), 1)) / np.sqrt(len(skeleton))
    flank_from_skeleton += (carried - flank_from_skeleton @ move) @ move.T

    nodes = mesh.mesh.p.shape[1]
    stations = mesh.flank_stations[:-1]
    return Superelement(
        sectors=profile.teeth,
        skeleton=np.ascontiguousarray(mesh.mesh.p[:, skeleton].T),
        face_size=len(mesh.face_first),
        stiffness=stiffness,
        flank_from_skeleton=flank_from_skeleton,
        flank_compliance=compliance,
        stress_from_skeleton=from_a.reshape(nodes, 3, -1),
        stress_from_flank=from_flank.reshape(nodes, 3, -1),
        displacement_from_skeleton=all_from_a[at_nodes].reshape(nodes, 2, -1),
        displacement_from_flank=all_from_flank[at_nodes].reshape(nodes, 2, -1),
        axial_stress=confinement * poisson_ratio,
        mesh=mesh,
        profile=profile,
        spline=average_spline(stations),
    )

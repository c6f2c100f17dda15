"""The elastic circular spline in 3D: small displacements, fixed outer surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from scipy.sparse.linalg import splu

from swgjoint.errors import DesignError
from swgjoint.fe.common.block_circulant import contact_compliance, respond
from swgjoint.fe.solid.across import spread_forces
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.dense_cyclic import DenseCyclicFactor
from swgjoint.fe.solid.strip.elasticity import Solid, solid
from swgjoint.fe.solid.strip.mesh import StripMesh
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index

REACH = 4
"""Number of teeth on either side of a loaded tooth that are displaced with it. Since
the outer surface is fixed, teeth farther away move by less than 0.1 % of its
displacement."""
WINDOW = 12
"""Number of teeth of the closed ring in which the response to one loaded tooth is
computed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ElasticCircularSpline:
    """Response of all teeth to forces on the flanks of one tooth.

    Forces and displacements at the flanks have the components x and y in the frames of
    the teeth, plane after plane, the right flank before the left one. Forces are spread
    over patches of a fixed axial length, and the displacements of the flanks are
    averaged over the same patches.
    """

    mesh: StripMesh
    """Mesh of one tooth sector."""
    body: Solid
    """Stiffness and stress of this mesh."""
    offsets: Index
    """Offsets between a loaded tooth and the teeth that it displaces (n_offsets,)."""
    flank: Array
    """Compliance G of the flanks (n_offsets, n_b, n_b) [m/N]."""
    nodal: Array
    """Displacement of all nodes of a sector per flank force
    (n_offsets, 3 n_nodes, n_b) [m/N]."""

    def displacement(self, force: Array) -> Array:
        """Flank displacements (N_c, n_b) [m] under flank forces (N_c, n_b) [N]."""
        return respond(self.offsets, self.flank, force)

    def nodal_displacement(self, force: Array) -> Array:
        """Displacements of all nodes (N_c, n_nodes, 3) [m] under flank forces [N]."""
        return respond(self.offsets, self.nodal, force).reshape(len(force), -1, 3)

    def contact_compliance(self, tooth: Index, weight: Array, teeth: int) -> Array:
        """Compliance between contact points (n, n) [m/N].

        Args:
            tooth: Tooth of each contact point (n,).
            weight: Derivatives of the gaps by the displacements of the flank nodes
                (n, n_b) [-].
            teeth: Number of teeth of the circular spline in the model.
        """
        return contact_compliance(
            self.offsets, self.flank, tooth, weight, teeth, self._sides
        )

    @cached_property
    def _sides(self) -> list[tuple[Index, Array]]:
        """Degrees of freedom of the right and of the left flank, with their rows."""
        size = self.flank.shape[1]
        dofs = np.arange(size).reshape(len(self.mesh.teeth.z), 2, -1)
        both = dofs[:, 0].ravel(), dofs[:, 1].ravel()
        return [(rows, np.ascontiguousarray(self.flank[:, rows])) for rows in both]


def condense_circular_spline(
    design: Design, profile: ToothProfile, mesh: StripMesh
) -> ElasticCircularSpline:
    """Condense the circular spline of a design to its flanks.

    Args:
        design: The drive.
        profile: Tooth profile of the circular spline.
        mesh: Mesh of :func:`swgjoint.fe.solid.strip.mesh.circular_spline_strip`.

    Raises:
        DesignError: If the outer surface of the circular spline is free.
    """
    if design.circular_spline.outer_rim == "free":
        raise DesignError(
            f"{design.drive.name}: circular_spline.outer_rim = 'free': the 3d model"
            " expects 'fixed'"
        )
    material = design.material_of("circular_spline")
    segment, teeth = mesh.teeth.segment, mesh.teeth
    body = solid(segment.mesh, material.youngs_modulus, material.poisson_ratio)
    matrix, size = body.stiffness.tocsc(), body.stiffness.shape[0]

    def dofs(nodes: Index) -> Index:
        return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel(), dtype=np.int64)

    # condense a sector to its faces, with forces on the flanks
    outside = teeth.nodes[:, teeth.plane.bore].ravel()
    inside = ~np.isin(segment.first, outside)
    first, last = dofs(segment.first[inside]), dofs(segment.last[inside])
    fixed = dofs(outside)
    boundary = np.concatenate([first, last])
    free = np.setdiff1d(np.arange(size), np.concatenate([boundary, fixed]))
    flank = (3 * teeth.flank.ravel()[:, None] + np.arange(2)).ravel()
    factor = splu(
        matrix[free][:, free].tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        options={"SymmetricMode": True},
    )
    units = np.zeros((len(free), len(flank)))
    spread = spread_forces(teeth.z, 2 * teeth.flank.shape[1])
    units[np.searchsorted(free, flank)] = spread.toarray()
    pull = matrix[free][:, boundary].toarray()
    solved = factor.solve(np.concatenate([-pull, units], axis=1))
    n = len(boundary)
    stiffness = matrix[boundary][:, boundary].toarray() + pull.T @ solved[:, :n]
    # the last face of a tooth is the first face of the next tooth, in whose frame it is
    pitch = about_z(np.array(2.0 * pi / profile.teeth))
    turn = np.eye(n)
    turn[n // 2 :, n // 2 :] = np.kron(np.eye(n // 6), pitch)
    stiffness = turn.T @ stiffness @ turn
    load = turn.T @ (-pull.T @ solved[:, n:])
    # close a ring of sectors and load the first tooth
    rhs = np.zeros((WINDOW, n, len(flank)))
    rhs[0] = load
    blocks = np.broadcast_to(0.5 * (stiffness + stiffness.T), (WINDOW, n, n))
    faces = turn @ DenseCyclicFactor(blocks, n // 2).solve(rhs)
    # displacement of all nodes of the teeth within reach
    offsets = np.arange(-REACH, REACH + 1)
    nodal = np.zeros((len(offsets), size, len(flank)))
    for k, offset in enumerate(offsets):
        nodal[k][boundary] = faces[offset % WINDOW]
        nodal[k][free] = solved[:, :n] @ faces[offset % WINDOW]
    nodal[REACH][free] += solved[:, n:]
    return ElasticCircularSpline(
        mesh=mesh,
        body=body,
        offsets=offsets,
        flank=np.stack([spread.T @ part[flank] for part in nodal]),
        nodal=nodal,
    )

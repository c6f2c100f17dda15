"""The condensed strip of the flexspline: masters, segments, loaded surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline

from swgjoint.fe.common.contact_patch import average_spline
from swgjoint.fe.solid.across import spread_forces
from swgjoint.fe.solid.strip.masters import Masters, Orders, strip_masters
from swgjoint.fe.solid.strip.mesh import StripMesh
from swgjoint.fe.solid.strip.segment import StripSegment, condense_segment
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Strip:
    """One condensed tooth sector of the flexspline; the teeth are the first segment.

    Forces act at flank nodes, plane after plane, right flank before left flank, and
    then at bore nodes, plane after plane. All of them are spread over a part of the
    face width.
    """

    sectors: int
    mesh: StripMesh
    masters: Masters
    segments: tuple[StripSegment, ...]
    profile: ToothProfile

    @property
    def teeth(self) -> StripSegment:
        """The toothed segment."""
        return self.segments[0]

    @cached_property
    def flank_dofs(self) -> int:
        """Number of loaded degrees of freedom on the flanks."""
        return int(3 * self.mesh.teeth.flank.size)

    @property
    def planes(self) -> int:
        """Number of mesh planes over the face width."""
        return len(self.mesh.teeth.z)

    @cached_property
    def spline(self) -> CubicSpline:
        """Weights of the flank nodes of a plane as functions of the arc length."""
        return average_spline(self.mesh.teeth.plane.flank_stations[:-1])

    @property
    def flank_size(self) -> int:
        """Number of nodes of one flank in a plane."""
        return int(self.mesh.teeth.flank.shape[1]) // 2

    @property
    def flank_range(self) -> tuple[float, float]:
        """Range of arc length over which a flank can touch, between the lands [m]."""
        low, high = self.profile.contact_range
        return max(low, float(self.spline.x[0])), min(high, float(self.spline.x[-1]))

    @cached_property
    def flank(self) -> Array:
        """Reference positions of the flank nodes (n_planes, 2 n_b, 3) [m]."""
        points = np.asarray(self.mesh.teeth.segment.mesh.p).T
        return np.ascontiguousarray(points[self.mesh.teeth.flank])

    @cached_property
    def bore(self) -> Array:
        """Reference positions of the bore nodes (n_planes n_phi, 3) [m]."""
        points = np.asarray(self.mesh.teeth.segment.mesh.p).T
        return np.ascontiguousarray(points[self.mesh.teeth.bore.ravel()])


def flexspline(
    design: Design,
    profile: ToothProfile,
    mesh: StripMesh,
    *,
    orders: Orders | None = None,
) -> Strip:
    """Condense a strip of the flexspline.

    Args:
        design: The drive.
        profile: Flank of the flexspline.
        mesh: Mesh of :func:`swgjoint.fe.solid.strip.mesh.flexspline_strip`.
        orders: Polynomial degrees of the displacements of faces and sections.
    """
    masters = strip_masters(mesh, orders)
    material = design.material_of("flexspline")
    flank, bore = mesh.teeth.flank.ravel(), mesh.teeth.bore.ravel()
    loaded = (3 * np.concatenate([flank, bore])[:, None] + np.arange(3)).ravel()
    spread = sparse.block_diag(
        [
            spread_forces(mesh.teeth.z, 3 * surface.shape[1])
            for surface in (mesh.teeth.flank, mesh.teeth.bore)
        ],
        format="csr",
    )
    segments = tuple(
        condense_segment(
            segment,
            follow,
            masters.position,
            youngs_modulus=material.youngs_modulus,
            poisson_ratio=material.poisson_ratio,
            loaded=loaded if number == 0 else None,
            spread=spread if number == 0 else None,
        )
        for number, (segment, follow) in enumerate(
            zip(mesh.segments, masters.segments, strict=True)
        )
    )
    return Strip(
        sectors=profile.teeth,
        mesh=mesh,
        masters=masters,
        segments=segments,
        profile=profile,
    )

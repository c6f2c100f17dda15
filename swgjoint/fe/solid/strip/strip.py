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
    """One condensed tooth sector of the flexspline.

    Forces act at the flank nodes, plane after plane with the right flank before the
    left one, and then at the bore nodes, plane after plane. All of them are spread over
    patches of a fixed axial length.
    """

    sectors: int
    """Number of sectors in the whole flexspline."""
    mesh: StripMesh
    masters: Masters
    segments: tuple[StripSegment, ...]
    """Condensed segments, the toothed one first."""
    profile: ToothProfile
    """Tooth profile of the flexspline."""

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
        """Number of planes of nodes over the face width."""
        return len(self.mesh.teeth.z)

    @cached_property
    def spline(self) -> CubicSpline:
        """Weights of the nodes of a flank in its averaged displacement.

        They are functions of the arc length [m] along the profile.
        """
        return average_spline(self.mesh.teeth.plane.flank_stations[:-1])

    @property
    def flank_size(self) -> int:
        """Number of nodes of one flank in a plane."""
        return int(self.mesh.teeth.flank.shape[1]) // 2

    @property
    def flank_range(self) -> tuple[float, float]:
        """Range of arc length in which a flank can touch, between the lands [m]."""
        low, high = self.profile.contact_range
        return max(low, float(self.spline.x[0])), min(high, float(self.spline.x[-1]))

    @cached_property
    def flank(self) -> Array:
        """Reference positions of the nodes of both flanks (n_planes, 2 n_b, 3) [m]."""
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
        profile: Tooth profile of the flexspline.
        mesh: Mesh of :func:`swgjoint.fe.solid.strip.mesh.flexspline_strip`.
        orders: Polynomial degrees of the displacements of faces and sections; None for
            the default degrees.
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

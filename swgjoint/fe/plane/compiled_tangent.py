"""Interface to the compiled loops that linearise the 2D model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from swgjoint.fe.plane.bore_contact import BoreStations
from swgjoint.fe.plane.corotation import Frames, sector_frames
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

if TYPE_CHECKING:
    from swgjoint.kernels.compiled import Bore


@dataclass(frozen=True, kw_only=True, eq=False)
class CompiledBore:
    """Contact of the bore with a rigid wave generator in compiled loops."""

    bore: Bore
    """The loops with the stations of a sector."""

    @classmethod
    def for_stations(cls, stations: BoreStations) -> CompiledBore | None:
        """Compiled loops for the stations of a sector; None without compiled loops."""
        if (native := kernels()) is None:
            return None
        if (bore := _bores.get(stations)) is None:
            made = native.Bore(stations.weights, len(stations.stiffness))
            bore = _bores[stations] = cls(bore=made)
        return bore

    def gaps(
        self,
        nodes: Array,
        touching: Mask,
        outline: Array,
        angle: float,
        centre: Array | None,
        far: float,
    ) -> tuple[Array, Array, Array]:
        """Gap, normal and curvature at the stations.

        Args:
            nodes: Nodes that the stations follow (N, m, 2) [m].
            touching: Whether each station is in contact (N, q).
            outline: Rows of the outline (n, 7), see ``ClosedCurve.rows``.
            angle: Rotation of the outline [rad].
            centre: Centre of the outline in its frame (2,) [m]; None for zero.
            far: Gap above which an interval has one value for all its stations [m].
        """
        gap, normal = np.empty(touching.shape), np.empty((*touching.shape, 2))
        curvature = np.empty(touching.shape)
        self.bore.gaps(
            np.ascontiguousarray(nodes),
            np.ascontiguousarray(touching),
            outline,
            angle,
            np.zeros(2) if centre is None else np.ascontiguousarray(centre),
            far,
            gap,
            normal,
            curvature,
        )
        return gap, normal, curvature

    def add_forces(
        self,
        spring: Array,
        gap: Array,
        normal: Array,
        into: Index,
        gradient: Array,
        hessian: Array | None,
        *,
        curvature: Array | None = None,
        sign: Array | None = None,
    ) -> None:
        """Add the forces and tangents of springs at the stations.

        Args:
            spring: Stiffness of each spring, zero where there is none (N, q) [N/m].
            gap: Gaps of the stations (N, q) [m].
            normal: Outward normals of the outline (N, q, 2).
            into: Degrees of freedom of the nodes that the stations follow (2 m,).
            gradient: Gradient to add to (N, n) [N].
            hessian: Tangent to add to (N, n, n) [N/m]; None adds the forces only.
            curvature: Curvatures of the parallel curves through the stations (N, q)
                [1/m]; None neglects them.
            sign: Signs of the degrees of freedom (N, n); None if all are 1.
        """
        self.bore.forces(
            np.ascontiguousarray(spring),
            np.ascontiguousarray(gap),
            np.ascontiguousarray(normal),
            curvature,
            into,
            sign,
            gradient,
            hessian,
        )

    def gaps_after(
        self, gap: Array, normal: Array, into: Index, increment: Array
    ) -> Array:
        """Gaps of the stations (N, q) [m] after an increment.

        Args:
            gap: Gaps before (N, q) [m].
            normal: Outward normals of the outline (N, q, 2).
            into: Degrees of freedom of the nodes that the stations follow (2 m,).
            increment: Increment of all degrees of freedom (N, n) [m].
        """
        result = np.empty(gap.shape)
        self.bore.gaps_after(
            np.ascontiguousarray(gap),
            np.ascontiguousarray(normal),
            into,
            np.ascontiguousarray(increment),
            result,
        )
        return result


_bores: WeakKeyDictionary[BoreStations, CompiledBore] = WeakKeyDictionary()
"""Loops of the stations of a model, which all its equilibria use."""


def add_blocks(blocks: Array, into: Index, matrices: Array) -> None:
    """Add blocks in the same rows and columns of all matrices.

    Args:
        blocks: Blocks (n, k, k).
        into: Rows and columns (k,).
        matrices: Matrices (n, m, m), which are changed.
    """
    if (native := kernels()) is None:
        matrices[:, into[:, None], into] += blocks
    else:  # numpy copies the blocks of the matrices twice
        native.add_blocks(np.ascontiguousarray(blocks), into, matrices)


def find_frames(
    element: Superelement,
    positions: Array,
    place: Array,
    *,
    fixed: Array | None = None,
) -> Frames:
    """Frames of the sectors.

    Its twin :func:`swgjoint.fe.plane.corotation.sector_frames` explains the method.

    Args:
        element: The condensed sector.
        positions: Skeleton nodes in the global frame (N, n_a, 2) [m].
        place: Angle of each sector in the undeformed ring (N,) [rad].
        fixed: Frame rotations of a linear model (N,) [rad]; None to fit them to the
            faces.
    """
    if fixed is not None or kernels() is None:
        return sector_frames(element, positions, place, fixed=fixed)
    force = np.zeros((len(place), len(element.flank_compliance)))
    dofs = np.arange(element.skeleton.size)
    gradient = np.zeros((len(place), dofs.size))
    frames, _ = add_sector_tangents(
        element, place, positions, force, dofs, gradient, None
    )
    return frames


def add_sector_tangents(
    element: Superelement,
    place: Array,
    positions: Array,
    flank_force: Array,
    dofs: Index,
    gradient: Array,
    hessian: Array | None,
) -> tuple[Frames, Array]:
    """Add elastic forces and tangents of sectors, with compiled loops.

    Args:
        element: The condensed sector.
        place: Angle of each sector in the undeformed ring (N,) [rad].
        positions: Skeleton nodes in the global frame (N, n_a, 2) [m].
        flank_force: Tooth forces as nodal forces in the sector frames (N, 2 n_b) [N].
        dofs: Degrees of freedom of the skeleton within a sector (2 n_a,).
        gradient: Gradient to add to (N, n) [N].
        hessian: Tangent to fill (N, n, n) [N/m]; None adds the forces only.

    Returns:
        Frames of the sectors, and displacements of the flank nodes in these frames
        (N, 2 n_b) [m].
    """
    native = kernels()
    assert native is not None
    sectors, size = len(place), dofs.size
    angle, gyration = np.empty(sectors), np.empty(sectors)
    kinematics = np.empty((5, sectors, size))
    flank = np.empty(flank_force.shape)
    sector = native.Sector(
        np.ascontiguousarray(element.skeleton),
        element.face_size,
        np.ascontiguousarray(element.stiffness),
        element.turning_parts,
        np.ascontiguousarray(element.rim_slopes),
        element.elongation,
        np.ascontiguousarray(element.flank_from_skeleton),
        np.ascontiguousarray(element.flank_compliance),
    )
    sector.tangents(
        place,
        np.ascontiguousarray(positions),
        np.ascontiguousarray(flank_force),
        dofs,
        angle,
        gyration,
        kinematics,
        flank,
        gradient,
        hessian,
    )
    position, displacement, deformation, elongating, spin = kinematics
    frames = Frames(
        angle=angle,
        position=position,
        displacement=displacement,
        deformation=deformation,
        elongating=elongating,
        spin=spin,
        gyration=gyration,
    )
    return frames, flank

"""3D mesh of one tooth sector of a member: a strip of segments along the axis.

The axis z points from the open end to the closed end and is zero in the middle of the
face width. The strip of the flexspline consists of the teeth, three segments of the
cylinder, the fillet and two segments of the diaphragm (thesis figures 3.21 to 3.23).
That of the circular spline consists of the teeth alone. In the corotational model each
segment has its own rotation.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.spatial import cKDTree
from skfem import MeshHex

from swgjoint.errors import DesignError
from swgjoint.fe.plane.sector_mesh import (
    BORE,
    LOWER_RIM,
    SectorMesh,
    refine_count,
    sector_mesh,
)
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index
from swgjoint.units import mm

FACE_WIDTH = 10
"""Number of elements of the thesis mesh along the face width."""
# elements of the thesis mesh along the parts of the cup: with a refinement of one a
# sector of the cup has 24 stations of 33 nodes behind the teeth
CYLINDER, FILLET, DIAPHRAGM = (2, 3, 4, 3), 4, (4, 4)
# relative lengths of the parts of cylinder and diaphragm, from the teeth to the bore;
# the first part belongs to the toothed segment, so that no section is at the back edge
# of the teeth
CYLINDER_PARTS, DIAPHRAGM_PARTS = (0.05, 0.15, 0.5, 0.3), (0.3, 0.7)
LARGEST_WALL = 0.9
"""Largest thickness of the lower rim, which the cup continues, relative to that of the
rim [-]; the layers of elements below the roots need the rest of the rim."""
SMALLEST_INNER_FILLET = 0.1
"""Smallest ratio of inner fillet radius to wall thickness that can be meshed [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentMesh:
    """One segment of a strip, in the frame of its tooth, which is on +y.

    Sections are arrays of node numbers. Their first axis runs around the sector from
    the first face to the last face, their second axis through the wall from the outside
    to the bore side.
    """

    name: str
    """Name of the segment in results."""
    mesh: MeshHex
    """Mesh of the segment [m]."""
    first: Index
    """Numbers of the nodes on the clockwise face (n,)."""
    last: Index
    """Numbers of the nodes on the counter-clockwise face, in the same order (n,)."""
    position: Array
    """Relative positions of the face nodes along the meridian, from 0 at the end
    closer to the open end of the strip to 1 (n,) [-]."""
    depth: Array
    """Relative depths of the face nodes, from 0 at the outside to 1 at the bore side
    (n,) [-]."""
    begin: Index | None
    """Section towards the teeth (n_phi, n_wall); None for the toothed segment."""
    end: Index | None
    """Section towards the bore of the diaphragm (n_phi, n_wall); None if the strip is
    only the toothed segment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TeethMesh:
    """The toothed segment and its surfaces."""

    segment: SegmentMesh
    plane: SectorMesh
    """The 2D mesh that is extruded over the face width."""
    z: Array
    """Coordinates z of the planes of nodes, starting at the open end (n_planes,) [m].
    """
    nodes: Index
    """Node numbers by plane and node of the 2D mesh (n_planes, n_plane_nodes)."""

    @property
    def flank(self) -> Index:
        """Nodes of the right, then the left flank, except on faces (n_planes, n_b)."""
        plane = self.plane
        return self.nodes[:, np.r_[plane.flank_right[:-1], plane.flank_left[:-1]]]

    @property
    def bore(self) -> Index:
        """Nodes of the bore, except on faces (n_planes, n_phi)."""
        return self.nodes[:, self.plane.bore[1:-1]]


@dataclass(frozen=True, kw_only=True, eq=False)
class StripMesh:
    """Segments of a strip from the open end to the bore of the diaphragm."""

    teeth: TeethMesh
    cup: tuple[SegmentMesh, ...] = ()
    """Segments behind the toothed one; empty for a ring without a cup."""

    @property
    def segments(self) -> tuple[SegmentMesh, ...]:
        """All segments, the teeth first."""
        return (self.teeth.segment, *self.cup)

    @property
    def narrow(self) -> float:
        """Depth of the outside of the cup below the root circle, in rims [-]."""
        end = self.teeth.segment.end
        if end is None:
            return 0.0
        seen = np.flatnonzero(self.teeth.segment.first == end[0, 0])
        return float(self.teeth.segment.depth[seen[0]])

    @property
    def nodes(self) -> int:
        """Number of nodes; a section between segments counts once, both faces count."""
        shared = sum(seg.begin.size for seg in self.cup if seg.begin is not None)
        return int(sum(seg.mesh.p.shape[1] for seg in self.segments) - shared)

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return int(sum(seg.mesh.t.shape[1] for seg in self.segments))


def cup_wall(design: Design) -> float:
    """Wall thickness of the cup, thesis eq. (3.50) [m]."""
    assert design.cup is not None
    return design.cup.thickness_coefficient * design.flexspline.rim_mm * mm


def flexspline_strip(design: Design, profile: ToothProfile) -> StripMesh:
    """Mesh a strip of the flexspline; without a ``[cup]`` only the toothed segment.

    Args:
        design: The drive.
        profile: Tooth profile of the flexspline.

    Raises:
        DesignError: If the fillet is too small for the wall or the cup too short.
    """
    rim, n = design.flexspline.rim_mm * mm, design.mesh.refinement
    wall = None if design.cup is None else min(cup_wall(design), LARGEST_WALL * rim)
    plane = sector_mesh(profile, rim, n, lower_rim=wall)
    width = design.drive.face_width_mm * mm
    if wall is None:
        return StripMesh(teeth=teeth_mesh(plane, width, n))
    apron, *cup = cup_segments(design, plane, width, n)
    return StripMesh(teeth=teeth_mesh(plane, width, n, apron), cup=tuple(cup))


def circular_spline_strip(design: Design, profile: ToothProfile) -> StripMesh:
    """Mesh a strip of the circular spline: the toothed segment over the face width.

    Args:
        design: The drive.
        profile: Tooth profile of the circular spline.
    """
    rim, n = design.circular_spline.rim_mm * mm, design.mesh.refinement
    plane = sector_mesh(profile, rim, n)
    return StripMesh(teeth=teeth_mesh(plane, design.drive.face_width_mm * mm, n))


def teeth_mesh(
    plane: SectorMesh, width: float, n: float, apron: SegmentMesh | None = None
) -> TeethMesh:
    """Extrude a 2D mesh over the face width and join the first part of the cup.

    Args:
        plane: The 2D mesh.
        width: Face width [m].
        n: Mesh refinement, a factor on the number of elements per direction [-].
        apron: First part of the cup; None without a cup.
    """
    # copies of the 2D mesh at every z, and hexahedra between them
    z = np.linspace(-0.5 * width, 0.5 * width, refine_count(FACE_WIDTH, n) + 1)
    size = plane.mesh.p.shape[1]
    nodes = np.arange(len(z))[:, None] * size + np.arange(size)
    points = np.concatenate([np.vstack([plane.mesh.p, np.full(size, k)]).T for k in z])
    quads = np.asarray(plane.mesh.t)
    cells = np.concatenate(
        [
            np.vstack([quads + k * size, quads + (k + 1) * size])
            for k in range(len(z) - 1)
        ],
        axis=1,
    )
    first, last = nodes[:, plane.face_first].ravel(), nodes[:, plane.face_last].ravel()
    mesh, end = _hexahedra(points, cells), None
    if apron is not None:
        assert apron.begin is not None and apron.end is not None
        mesh, number = _joined(mesh, apron.mesh)
        behind = apron.position > 0.0
        first = np.concatenate([first, number[apron.first[behind]]])
        last = np.concatenate([last, number[apron.last[behind]]])
        end = number[apron.end]
    face = np.asarray(mesh.p)[:, first]
    radius, along = np.hypot(face[0], face[1]), face[2]
    segment = SegmentMesh(
        name="teeth",
        mesh=mesh,
        first=first,
        last=last,
        position=(along - along.min()) / np.ptp(along),
        depth=(radius - radius[0]) / (radius[len(plane.face_first) - 1] - radius[0]),
        begin=None,
        end=end,
    )
    return TeethMesh(segment=segment, plane=plane, z=z, nodes=nodes)


def _joined(mesh: MeshHex, more: MeshHex) -> tuple[MeshHex, Index]:
    """Join two meshes at coincident nodes.

    Returns:
        The joined mesh, and the numbers of the second mesh's nodes in it.
    """
    first, second = np.asarray(mesh.p).T, np.asarray(more.p).T
    apart, nearest = cKDTree(first).query(second)
    new = apart > 1e-9
    number = np.where(new, len(first) + np.cumsum(new) - 1, nearest)
    points = np.concatenate([first, second[new]])
    cells = np.concatenate([np.asarray(mesh.t), number[np.asarray(more.t)]], axis=1)
    return MeshHex(np.ascontiguousarray(points.T), cells), number


def cup_segments(
    design: Design, plane: SectorMesh, width: float, n: float
) -> tuple[SegmentMesh, ...]:
    """Mesh the segments of cylinder, fillet and diaphragm or flange.

    Args:
        design: The drive, with a ``[cup]``.
        plane: 2D mesh of the teeth, whose lower rim the cup continues.
        width: Face width [m].
        n: Mesh refinement, a factor on the number of elements per direction [-].

    Raises:
        DesignError: If the fillet is too small for the wall or the cup too short.
    """
    # dimensions of the meridian, and their limits
    cup = design.cup
    assert cup is not None
    name, wall = design.drive.name, cup_wall(design)
    fillet, length, bore = (
        value * mm for value in (cup.fillet_mm, cup.length_mm, cup.bore_radius_mm)
    )
    if fillet < (1.0 + SMALLEST_INNER_FILLET) * wall:
        raise DesignError(
            f"{name}: cup.fillet_mm = {cup.fillet_mm:g}: with a wall of"
            f" {wall / mm:.3g} mm the mesh needs at least"
            f" {(1.0 + SMALLEST_INNER_FILLET) * wall / mm:.3g} mm"
        )
    if length < 2.0 * fillet:
        raise DesignError(
            f"{name}: cup.length_mm = {cup.length_mm:g}: with a fillet of"
            f" {cup.fillet_mm:g} mm expected at least {2 * cup.fillet_mm:g} mm"
        )
    face = plane.mesh.p[:, plane.face_first]
    inner = float(np.hypot(*face).min())
    z0, z1 = 0.5 * width, 0.5 * width + length
    inward = cup.kind == "cup"
    # at the teeth the wall continues the lower rim
    rows = refine_count(LOWER_RIM, n) + 1
    at_teeth = np.hypot(*face)[-rows:]
    across = np.linspace(1.0, 0.0, rows)  # outside to bore side
    # meridian of every part: r and z by station and position through the wall
    parts = []
    straight = z1 - fillet - z0
    start = z0
    radii = np.stack([inner + wall * across] * 2)
    for k, (share, count) in enumerate(zip(CYLINDER_PARTS, CYLINDER, strict=True)):
        stop = start + share * straight
        z = np.linspace(start, stop, refine_count(count, n) + 1)
        r = np.repeat(radii[:1], len(z), axis=0)
        if k == 0:
            r[0] = at_teeth
        parts.append((f"cylinder {k + 1}", r, np.repeat(z[:, None], rows, axis=1)))
        start = stop
    # a fillet inward to a diaphragm or outward to a flange
    turn = np.linspace(0.0, 0.5 * pi, refine_count(FILLET, n) + 1)[:, None]
    if inward:
        centre = inner + wall - fillet
        radius = fillet - wall + wall * across
        r = centre + radius * np.cos(turn)
    else:
        centre = inner + fillet
        radius = fillet - wall * across
        r = centre - radius * np.cos(turn)
    parts.append(("fillet", r, z1 - fillet + radius * np.sin(turn)))
    ends = np.cumsum([0.0, *DIAPHRAGM_PARTS])
    disc = "diaphragm" if inward else "flange"
    for k, count in enumerate(DIAPHRAGM):
        along = np.linspace(ends[k], ends[k + 1], refine_count(count, n) + 1)[:, None]
        r = np.repeat(centre + along * (bore - centre), rows, axis=1)
        z = np.repeat((z1 - fillet + radius)[None], len(along), axis=0)
        parts.append((f"{disc} {k + 1}", r, z))
    half = plane.half_pitch
    phi = np.linspace(
        half, -half, 2 * refine_count(BORE, n) + 1
    )  # clockwise face first
    return tuple(_shell(title, r, z, phi) for title, r, z in parts)


def _shell(name: str, r: Array, z: Array, phi: Array) -> SegmentMesh:
    """Structured mesh of a segment between two sections.

    Args:
        name: Name of the segment.
        r: Radii by station and position through the wall (n_s, n_w) [m].
        z: Coordinates z of the same points (n_s, n_w) [m].
        phi: Angles clockwise from the tooth axis, starting at the first face (n_phi,)
            [rad].
    """
    shape = (len(r), len(phi), r.shape[1])
    x = r[:, None, :] * np.sin(phi)[None, :, None]
    y = r[:, None, :] * np.cos(phi)[None, :, None]
    points = np.stack([x, y, np.broadcast_to(z[:, None, :], shape)], axis=-1)
    grid = np.arange(points[..., 0].size).reshape(shape)
    corner = [
        grid[a : a - 1 or None, b : b - 1 or None, c : c - 1 or None]
        for a in (0, 1)
        for b in (0, 1)
        for c in (0, 1)
    ]
    # a quadrilateral at a station, then the opposite one at the next station
    cells = np.stack([corner[k].ravel() for k in (0, 1, 3, 2, 4, 5, 7, 6)])
    middle = np.hypot(np.diff(r.mean(axis=1)), np.diff(z.mean(axis=1)))
    along = np.concatenate([[0.0], np.cumsum(middle)])
    rows = r.shape[1]
    return SegmentMesh(
        name=name,
        mesh=_hexahedra(points.reshape(-1, 3), cells),
        first=grid[:, 0].ravel(),
        last=grid[:, -1].ravel(),
        position=np.repeat(along / along[-1], rows),
        depth=np.tile(np.linspace(0.0, 1.0, rows), len(r)),
        begin=grid[0],
        end=grid[-1],
    )


def _hexahedra(points: Array, cells: Index) -> MeshHex:
    """Mesh from cells that list the corners of two opposite quadrilaterals."""
    # scikit-fem's numbers of the corners (0,0,0) (1,0,0) (1,1,0) (0,1,0) of the unit
    # cube, which is the order in the cells, and of the same corners at z = 1
    cube = np.array([7, 4, 1, 5, 6, 2, 0, 3])
    sorted_cells = np.empty_like(cells)
    sorted_cells[[7, 4, 1, 5, 6, 2, 0, 3]] = cells
    a, b, d, e = (points[cells[k]] for k in (0, 1, 3, 4))
    volume = np.einsum("ei,ei->e", np.cross(b - a, d - a), e - a)
    mirrored = np.empty_like(cells)
    mirrored[cube] = cells[[0, 3, 2, 1, 4, 7, 6, 5]]
    final = np.where(volume > 0.0, sorted_cells, mirrored)
    return MeshHex(np.ascontiguousarray(points.T), np.ascontiguousarray(final))

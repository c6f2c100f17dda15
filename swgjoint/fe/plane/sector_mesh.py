"""Mapped mesh of one tooth sector of a member (thesis figure 3.18)."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, sin

import numpy as np
from skfem import MeshQuad

from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index

# numbers of elements of the thesis mesh per half tooth: along the flank, in depth below
# it, along the inner (outer) diameter and through the lower rim; a whole tooth has 181
# nodes and 146 elements
FLANK, LAYERS, BORE, LOWER_RIM = 21, 3, 5, 2
# depth of the centre point of the tooth mesh in half rim thicknesses (thesis table 4.4)
POSITIONING_FACTOR = 1.1
# thickness ratio of a layer to the one above it: bending stress peaks at the surface of
# the fillet ("finer elements near the tooth flanks", thesis section 4.3)
LAYER_GROWTH = 1.5


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorMesh:
    """Mesh of the sector of one tooth, centred on the +y axis.

    Its two faces are half a pitch from the axis on either side; the first face is the
    clockwise one (x > 0). Node sets hold indices into the columns of ``mesh.p``.
    Where the member is a circular spline, the "bore" is its outer diameter.
    """

    mesh: MeshQuad
    """Quadrilaterals, with node positions in metres."""
    half_pitch: float
    """Half of the tooth pitch [rad]."""
    face_first: Index
    """Nodes of the clockwise face, from the root land to the bore."""
    face_last: Index
    """Nodes of the counter-clockwise face, in the same order."""
    bore: Index
    """Nodes of the inner diameter (of the outer one of a circular spline) from the
    clockwise to the counter-clockwise corner, both included."""
    flank_right: Index
    """Nodes of the right flank from the end of the top land to the root land."""
    flank_left: Index
    """Nodes of the left flank, the mirror images of the right ones in the same order.
    """
    flank_stations: Array
    """Arc lengths of the nodes of one flank on the profile (n_flank,) [m]."""


def refine_count(elements: int, refinement: float) -> int:
    """Number of elements along an edge of the refined mesh.

    Args:
        elements: Number of elements in the mesh of the thesis.
        refinement: Factor on the number of elements [-].
    """
    return ceil(elements * refinement)


def sector_mesh(
    profile: ToothProfile,
    rim: float,
    refinement: float,
    *,
    lower_rim: float | None = None,
) -> SectorMesh:
    """Mesh a tooth sector with the topology of the thesis mesh.

    Each half tooth is one block of 21 elements along the flank (from the end of the top
    land to the middle of the root land) and 3 elements deep. Its inner edge follows the
    tooth axis down to a point near the middle of the rim and then the circle through
    this point. The lower rim, between this circle and the bore, is a second block.

    Args:
        profile: Tooth profile of the member.
        rim: Thickness between root circle and bore [m].
        refinement: Factor on the number of elements per direction [-], see
            :func:`refine_count`.
        lower_rim: Thickness of the lower rim, to which a cup connects [m]; by default
            that of the 2D mesh of the thesis.

    Returns:
        The sector; its two halves are mirror images of each other.
    """
    n, layers = refine_count(FLANK, refinement), refine_count(LAYERS, refinement)
    bore, lower = refine_count(BORE, refinement), refine_count(LOWER_RIM, refinement)
    side = -1.0 if profile.internal else 1.0
    inner = profile.dedendum_radius - side * rim
    if lower_rim is None:
        lower_rim = (1.0 - 0.5 * POSITIONING_FACTOR) * rim
    middle = inner + side * lower_rim
    names = [part.name for part in profile.segments]
    stations = profile.stations
    start = float(stations[1]) if names[0] == "top_land" else 0.0
    s = np.linspace(start, float(stations[-1]), n + 1)
    flank, _, _ = profile.evaluate(s)
    half = profile.half_pitch

    # inner edge of the block: down the tooth axis to the middle of the rim and along it
    down = n - bore
    axis = np.linspace(profile.addendum_radius, middle, down + 1)
    turn = np.linspace(0.0, half, bore + 1)
    edge = np.concatenate(
        [
            np.stack([np.zeros(down + 1), axis], axis=-1),
            np.stack([middle * np.sin(turn), middle * np.cos(turn)], axis=-1)[1:],
        ]
    )
    thickness = LAYER_GROWTH ** (np.arange(layers) / refinement)
    share = np.concatenate([[0.0], np.cumsum(thickness)]) / thickness.sum()
    depth = share[:, None, None]
    block = (1.0 - depth) * flank + depth * edge  # (layers + 1, n + 1, 2)
    # the first column of nodes is on the top land, the last one on the sector face
    top = np.arctan2(flank[0, 0], flank[0, 1]) * (1.0 - share)
    block[:, 0] = profile.addendum_radius * np.stack([np.sin(top), np.cos(top)], -1)
    radius = profile.dedendum_radius + share * (middle - profile.dedendum_radius)
    block[:, -1] = radius[:, None] * np.array([sin(half), cos(half)])
    # lower rim: from the middle of the rim to the bore
    radius = np.linspace(middle, inner, lower + 1)
    rim_block = radius[:, None, None] * np.stack([np.sin(turn), np.cos(turn)], -1)

    def quads(rows: int, columns: int, offset: int) -> Index:
        corner = np.arange(rows * columns).reshape(rows, columns) + offset
        return np.stack(
            [corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]]
        ).reshape(4, -1)

    right = np.concatenate([block.reshape(-1, 2), rim_block.reshape(-1, 2)])
    cells = np.concatenate(
        [
            quads(layers + 1, n + 1, 0),
            quads(lower + 1, bore + 1, (layers + 1) * (n + 1)),
        ],
        axis=1,
    )
    points = np.concatenate([right, right * np.array([-1.0, 1.0])])
    mirrored = cells[[0, 3, 2, 1]] + len(right)
    cells = np.concatenate([cells, mirrored], axis=1)

    # merge the coincident nodes of the blocks and of the two halves
    grid = np.round(points / (1e-6 * profile.pitch_radius / profile.teeth)).astype(int)
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    points, cells = points[first], inverse.ravel()[cells]
    # counter-clockwise cells
    a, b, c, _ = (points[cells[k]] for k in range(4))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    cells = np.where(area > 0, cells, cells[[0, 3, 2, 1]])

    def find(wanted: Array) -> Index:
        distance = np.linalg.norm(points[None] - wanted[:, None], axis=-1)
        return np.asarray(np.argmin(distance, axis=1), dtype=np.int64)

    face = np.concatenate([block[:, -1], rim_block[1:, -1]])
    bore_right = rim_block[-1]
    mirror = np.array([-1.0, 1.0])
    return SectorMesh(
        mesh=MeshQuad(np.ascontiguousarray(points.T), np.ascontiguousarray(cells)),
        half_pitch=half,
        face_first=find(face),
        face_last=find(face * mirror),
        bore=find(np.concatenate([bore_right[::-1], (bore_right * mirror)[1:]])),
        flank_right=find(flank),
        flank_left=find(flank * mirror),
        flank_stations=s,
    )

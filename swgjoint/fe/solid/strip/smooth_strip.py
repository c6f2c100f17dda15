"""A flexspline without teeth, for comparison with closed forms."""

from __future__ import annotations

from math import pi

import numpy as np
from skfem import MeshQuad

from swgjoint.fe.plane.sector_mesh import (
    BORE,
    LAYERS,
    LOWER_RIM,
    SectorMesh,
    refine_count,
)
from swgjoint.fe.solid.strip.mesh import (
    LARGEST_WALL,
    StripMesh,
    cup_segments,
    cup_wall,
    teeth_mesh,
)
from swgjoint.gear.design.design import Design
from swgjoint.units import mm


def smooth_strip(design: Design) -> StripMesh:
    """Mesh a strip whose first segment is the rim without its tooth.

    The lower rim has the rows of elements of the toothed strip, so that the same cup
    can be joined to it.
    """
    n, rim = design.mesh.refinement, design.flexspline.rim_mm * mm
    side = refine_count(BORE, n)
    inner, half = design.flexspline_inner_radius, pi / design.drive.teeth_flexspline
    wall = LARGEST_WALL * rim
    if design.cup is not None:
        wall = min(cup_wall(design), wall)
    # rows of nodes above and in the lower rim, on a grid of radius and angle
    above = np.linspace(inner + rim, inner + wall, refine_count(LAYERS, n) + 1)
    below = np.linspace(inner + wall, inner, refine_count(LOWER_RIM, n) + 1)
    radius = np.concatenate([above, below[1:]])
    phi = np.linspace(half, -half, 2 * side + 1)  # clockwise face first
    grid = np.arange(len(radius) * len(phi)).reshape(len(radius), len(phi))
    points = radius[:, None, None] * np.stack([np.sin(phi), np.cos(phi)], axis=-1)
    cells = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]])
    plane = SectorMesh(
        mesh=MeshQuad(
            np.ascontiguousarray(points.reshape(-1, 2).T),
            np.ascontiguousarray(cells.reshape(4, -1)),
        ),
        half_pitch=half,
        face_first=grid[:, 0],
        face_last=grid[:, -1],
        bore=grid[-1],
        flank_right=grid[0, : side + 1],
        flank_left=grid[0, : side - 1 : -1],
        flank_stations=phi[: side + 1],
    )
    width = design.drive.face_width_mm * mm
    if design.cup is None:
        return StripMesh(teeth=teeth_mesh(plane, width, n))
    apron, *cup = cup_segments(design, plane, width, n)
    return StripMesh(teeth=teeth_mesh(plane, width, n, apron), cup=tuple(cup))

"""Fields of 3D equilibria for display.

:mod:`swgjoint.fe.plane.figures.shape_fields` has those in 2D.

The displayed surface starts at the bore of the open edge, follows the outline of the
teeth at both edges of the face width and continues along the outside of the cup, with
one row of nodes per section between segments.
"""

from __future__ import annotations

import numpy as np

from swgjoint.fe.plane.figures.shape_fields import (
    EVERY,
    SectorFields,
    ShapeSurface,
    outline_rows,
    surface_of,
)
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.stress import flexspline_stresses
from swgjoint.fe.solid.strip.elasticity import stress_maxima
from swgjoint.typing import Index


def solid_surface(model: SolidSectorModel) -> ShapeSurface:
    """Displayed surface of a sector; its nodes are numbered segment after segment."""
    strip = model.strip.mesh
    bore, outline = outline_rows(strip.teeth.plane)
    open_edge, back = strip.teeth.nodes[0], strip.teeth.nodes[-1]
    rows: list[Index] = [open_edge[bore], open_edge[outline], back[outline]]
    first = 0
    for segment in strip.segments:
        if segment.end is not None:
            rows.append(first + segment.end[::EVERY, 0])
        first += segment.mesh.p.shape[1]
    points = np.concatenate([np.asarray(s.mesh.p).T for s in strip.segments])
    return surface_of(points, rows)


def solid_fields(
    model: SolidSectorModel, state: SolidState, surface: ShapeSurface
) -> SectorFields:
    """Displacements, stresses and contact forces of a 3D equilibrium by sector.

    Args:
        model: The 3D model.
        state: The equilibrium.
        surface: Displayed surface of a sector, see :func:`solid_surface`.
    """
    loads, frames = model.loads(state), model.frames(state)
    # frames of the undeformed teeth, rotated with the bore of the diaphragm
    stood = about_z(np.array(state.rotation)) @ model.place
    moved = []
    for number, (segment, frame) in enumerate(
        zip(model.strip.segments, frames, strict=True)
    ):
        u = segment.displacement(frame.displacement, None if number else loads)
        back = np.einsum("sji,sjk->sik", stood, frame.turn)
        rest = np.asarray(segment.mesh.mesh.p).T
        moved.append(np.einsum("sij,snj->sni", back, rest + u) - rest)
    stress = flexspline_stresses(model, state)
    mises = [stress_maxima(stress[s.name])[2] for s in model.strip.segments]
    forces = model.strip.teeth.nodal_force(loads).reshape(len(loads), -1, 3)
    turned = np.einsum("sji,sjk,snk->sni", stood, frames[0].turn, forces)
    first = model.strip.flank_dofs // 3
    return SectorFields(
        displacement=np.concatenate(moved, axis=1)[:, surface.nodes],
        von_mises=np.concatenate(mises, axis=1)[:, surface.nodes],
        tooth_force=turned[:, :first].sum(axis=1),
        wave_generator_force=turned[:, first:].sum(axis=1),
    )

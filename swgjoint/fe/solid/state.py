"""One equilibrium of the 3D drive."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swgjoint.fe.plane.state import StateFigures
from swgjoint.fe.solid.teeth import ToothRows
from swgjoint.typing import Array, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidState(StateFigures):
    """One equilibrium, or the start of the search for one. Global frame, SI."""

    faces: Array
    """Masters on the first face of each sector (N, n_face, 3) [m]."""
    inside: Array
    """Masters inside the sectors (N, n_inside, 3) [m]."""
    pressure: Array
    """Force of the wave generator per gradient of its gap, at the bore nodes, at the
    vertices of the gap over the face width and of the slopes there
    (N, n_bore + 2 n_lines) [N]."""
    touching: Mask
    """Which of these points touch it, shape of ``pressure``."""
    shared: Mask
    """Lines of bore nodes along the axis whose contact the planes of the mesh share,
    instead of a vertex of the gap (N, n_lines)."""
    bore_force: Array
    """The same as nodal forces in the frames of the teeth (N, 3 n_bore) [N]."""
    flank_force: Array
    """Tooth forces as nodal forces in those frames (N, n_flank) [N]."""
    ring_force: Array
    """The same on the circular spline, in the frames of its teeth (N_c, n_c) [N]."""
    race: Array | None = None
    """Coordinates of the outer race (N, 2, 4), see
    :class:`swgjoint.fe.solid.wave_generator.race.SolidRace`; None on a rigid wave
    generator."""
    ball_force: Array | None = None
    """Force of the balls of the drive [N]."""
    held: ToothRows | None = None
    """Tooth contacts that carry force."""
    tooth_force: Array = field(default_factory=lambda: np.zeros(0))
    """Their normal forces (n_contacts,) [N]."""

"""One equilibrium of the 3D drive."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from swgjoint.fe.plane.state import StateFigures
from swgjoint.fe.solid.tooth_rows import ToothRows
from swgjoint.typing import Array, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidState(StateFigures):
    """One equilibrium, or the start of the search for one.

    The model has N sectors and N_c teeth of the circular spline. Vectors are in the
    global frame unless stated otherwise.
    """

    faces: Array
    """Positions of the masters on the first face of each sector (N, n_face, 3) [m]."""
    inside: Array
    """Positions of the masters inside the sectors (N, n_inside, 3) [m]."""
    pressure: Array
    """Contact forces of the wave generator, each of which does work on its own gap: at
    the bore nodes, then at the vertices of the gap over the face width, then at the
    slopes of the gap at these vertices (N, n_bore + 2 n_lines) [N], see
    :class:`swgjoint.fe.solid.linearise.BoreContact`."""
    touching: Mask
    """Mask of the contact points that touch the wave generator, in the shape of
    ``pressure``."""
    shared: Mask
    """Mask of the lines of bore nodes along the axis whose contact acts in several
    planes of the mesh instead of at a vertex of the gap (N, n_lines)."""
    bore_force: Array
    """Forces of the wave generator at the bore nodes, before they are spread over the
    face width, in the frames of the teeth (N, 3 n_bore) [N]."""
    flank_force: Array
    """Tooth forces at the flank nodes of the flexspline, before they are spread over
    the face width, in the frames of its teeth (N, n_flank) [N]."""
    circular_spline_force: Array
    """Tooth forces at the flank nodes of the circular spline, before they are spread
    over the face width, in the frames of its teeth (N_c, n_c) [N]."""
    race: Array | None = None
    """Coordinates of the outer race (N, 2, 4), see
    :class:`swgjoint.fe.solid.wave_generator.race.SolidRace`; None for a rigid wave
    generator."""
    ball_force: Array | None = None
    """Forces of all balls of the drive (balls,) [N]; None for a rigid wave generator.
    """
    held: ToothRows | None = None
    """Tooth contacts that carry force; None before the first search for them."""
    tooth_force: Array = field(default_factory=lambda: np.zeros(0))
    """Normal forces of these contacts (n_contacts,) [N]."""

    def extrapolate(self, earlier: SolidState, part: float) -> SolidState:
        """Start of a search: this state with a part of its change since an earlier one.

        Contacts remain those of this state; a race is left as it is.

        Args:
            earlier: State of the same model, moved to the same angles.
            part: Factor on the change [-].
        """
        moved: dict[str, Any] = {}
        for key in (
            "faces",
            "inside",
            "pressure",
            "bore_force",
            "flank_force",
            "circular_spline_force",
            "rotation",
            "circular_spline_rotation",
        ):
            here = getattr(self, key)
            moved[key] = here + part * (here - getattr(earlier, key))
        moved["pressure"] = np.clip(moved["pressure"], 0.0, None)
        return replace(self, **moved)

    def of_both_halves(self) -> SolidState:
        """State of the whole drive that a state of a half model describes.

        Energy and moments are those of the whole drive already. A race is left out.
        """
        n, teeth = len(self.faces), len(self.circular_spline_force)
        turned = np.array([-1.0, -1.0, 1.0])  # by 180 deg
        held = self.held
        if held is not None:
            half = np.repeat([0, 1], len(held))
            held = held.chosen(np.tile(np.arange(len(held)), 2))
            sector = held.contacts.sector + n * half
            # two teeth are one in the half model: the one that faces the sector
            tooth = held.contacts.tooth + teeth * half
            tooth += teeth * np.rint(sector / n - tooth / teeth).astype(np.int64)
            contacts = replace(held.contacts, sector=sector, tooth=tooth % (2 * teeth))
            held = replace(held, contacts=contacts)
        twice: dict[str, Any] = {
            key: np.concatenate([getattr(self, key)] * 2)
            for key in (
                "pressure",
                "touching",
                "shared",
                "bore_force",
                "flank_force",
                "circular_spline_force",
                "tooth_force",
            )
        }
        return replace(
            self,
            faces=np.concatenate([self.faces, self.faces * turned]),
            inside=np.concatenate([self.inside, self.inside * turned]),
            held=held,
            **twice,
        )

"""Place of the largest stress in the 2D flexspline, such as a fillet or the bore."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import KINDS, flexspline_stress

PLACES = ("fillet", "flank", "bore", "inside", "contact")
NEAR = 0.25
"""Distance from a loaded tooth contact within which a node counts as next to it
[modules]. It is a length instead of a number of elements, so that the place does not
depend on the mesh. Contact patches are smaller than this distance."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StressPlaces:
    """Places of the nodes in the flexspline sectors of a model."""

    model: SectorModel

    @cached_property
    def _of_node(self) -> NDArray[np.int64]:
        """Indices of nodes into :data:`PLACES`, without contacts, shape (n_nodes,)."""
        element = self.model.element
        mesh, profile = element.mesh, element.profile
        place = np.full(mesh.mesh.p.shape[1], PLACES.index("inside"))
        names = [part.name for part in profile.segments]
        # the fillet is the last segment before the root land
        fillet = len(names) - (2 if names[-1] == "root_land" else 1)
        at_flank = mesh.flank_stations < profile.stations[fillet]
        for side in (mesh.flank_right, mesh.flank_left):
            place[side] = np.where(
                at_flank, PLACES.index("flank"), PLACES.index("fillet")
            )
        place[mesh.bore] = PLACES.index("bore")
        return place

    def near_contact(self, state: State) -> NDArray[np.bool_]:
        """Mask of nodes next to a loaded tooth contact, shape (n_sectors, n_nodes)."""
        element = self.model.element
        points = element.mesh.mesh.p.T
        near = np.zeros((self.model.sectors, len(points)), dtype=bool)
        if state.contacts is None:
            return near
        profile = element.profile
        module = 2.0 * profile.pitch_radius / profile.teeth
        loaded = state.tooth_force > 0.0
        feet, _, _ = profile.evaluate(state.contacts.station[loaded])
        feet[:, 0] *= np.where(state.contacts.side[loaded] == 0, 1.0, -1.0)
        distance = np.linalg.norm(points[None] - feet[:, None], axis=-1)
        np.logical_or.at(near, state.contacts.sector[loaded], distance < NEAR * module)
        return near

    def largest(
        self, state: State
    ) -> tuple[dict[str, float], dict[str, float], dict[str, str]]:
        """Find the largest nodal stress, overall and away from tooth contacts.

        Returns:
            Three mappings by kind: largest stress over all nodes [Pa]; largest stress
            over the nodes that are not next to a loaded tooth contact [Pa]; place of
            the former.
        """
        near = self.near_contact(state)
        stresses = stress_maxima(flexspline_stress(self.model, state))
        overall, away, place = {}, {}, {}
        for kind, values in zip(KINDS, stresses, strict=True):
            sector, node = np.unravel_index(int(values.argmax()), values.shape)
            overall[kind] = float(values[sector, node])
            away[kind] = float(np.where(near, 0.0, values).max())
            index = PLACES.index("contact")
            place[kind] = PLACES[
                index if near[sector, node] else int(self._of_node[node])
            ]
        return overall, away, place

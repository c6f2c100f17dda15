"""What tests of tooth contact share: gaps with the indentation of the flanks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State


def open_gaps(model: SectorModel, state: State) -> NDArray[np.float64]:
    """Gaps of the contacts plus the approach of their flanks (n,) [m].

    Zero where a strip of contact carries force, and never negative.
    """
    contacts = state.contacts
    if contacts is None or not len(contacts):
        return np.zeros(0)
    if model.indentation is None:
        return contacts.gap
    strips = Strips.from_contacts(model.indentation, contacts, None, state.tooth_force)
    force = strips.sums(state.tooth_force)
    return contacts.gap + model.indentation.approach(force)[strips.strip]

"""Influence of every tooth gap on the output of the 3D drive.

Tooth contacts may open and close anywhere over the face width, but the bore nodes that
touch the wave generator are always those of the perfect drive. Contacts of crowned
teeth move over the flanks with their forces, but not with the errors: a tilt of an
arcminute moves them by a tenth of the distance of two planes.
"""

from __future__ import annotations

import numpy as np

from swgjoint.fe.common.influence import Gaps, Influence, pivot_system
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.solid.condensation import Candidates, condense
from swgjoint.fe.solid.flank_points import FlankPoints
from swgjoint.fe.solid.linearise import SolidLinearised, linearise
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.tangent import SolidTangent
from swgjoint.fe.solid.tooth_rows import ToothRows
from swgjoint.typing import Array, Mask

REACH = 0.03
"""Largest gap of a contact that may close, in lobe heights [-]. The 2D model also needs
additional points along the flanks; here they do not change the result."""


def influence(
    model: SolidSectorModel, state: SolidState, *, circular_spline_is_output: bool
) -> Influence:
    """Linearise the influence of the tooth gaps at an equilibrium of a perfect drive.

    Args:
        model: Model of all sectors, with an elastic circular spline and without errors
            of teeth or axis.
        state: The equilibrium.
        circular_spline_is_output: Whether the circular spline is the output; if not,
            the output is the bore of the diaphragm.

    Raises:
        ValueError: If the model does not meet these conditions, or if no tooth carries
            force at the equilibrium.
    """
    teeth = model.teeth
    errors = (teeth.shift, teeth.circular_spline_shift, teeth.tilt)
    flawed = any(error is not None and error.any() for error in errors)
    if model.half or teeth.elastic_circular_spline is None or flawed:
        raise ValueError(
            "the influence needs all sectors, an elastic circular spline and teeth"
            " without errors"
        )
    linear = linearise(model, state)
    moved = teeth.displace_circular_spline(state.circular_spline_force)
    contacts, carries = _tooth_contacts(model, linear, state, moved)
    tangent = SolidTangent(model, linear)
    candidates = Candidates.from_rows(model, state, contacts, moved)
    condensed = condense(model, state, linear, tangent, candidates)
    # the member that is not the output is fixed, and slopes follow the contacts
    every, n = len(contacts), len(carries)
    used = np.append(np.arange(n), every + 1 if circular_spline_is_output else every)
    slopes = np.arange(n, every)
    through = np.linalg.solve(
        condensed.system[np.ix_(slopes, slopes)], condensed.system[slopes]
    )
    system = condensed.system - condensed.system[:, slopes] @ through
    offset = condensed.offset - condensed.offset[slopes] @ through
    offset = offset[used]
    offset[n] -= state.torque
    contacts = contacts.chosen(np.arange(n))
    return pivot_system(
        system[np.ix_(used, used)],
        offset,
        _gaps(model, state, contacts, carries),
        closed_supports=np.zeros(0, dtype=bool),
        free=[n],
        output=n,
        sign=1.0,
        angle=state.circular_spline_rotation
        if circular_spline_is_output
        else state.rotation,
        torque=state.torque,
    )


def _gaps(
    model: SolidSectorModel, state: SolidState, found: ToothRows, carries: Mask
) -> Gaps:
    contacts, n = found.contacts, len(found)
    flexspline = contacts.weight.reshape(n, -1, 2).sum(axis=1)
    z = model.strip.mesh.teeth.z
    by_plane = found.circular_spline_weight.reshape(n, len(z), -1, 2).sum(axis=2)
    place = model.teeth.circular_spline_place(state.circular_spline_rotation)
    leaning = np.einsum("kpi,p->ki", by_plane, z)
    return Gaps(
        sector=contacts.sector,
        tooth=contacts.tooth,
        direction=np.stack([flexspline, by_plane.sum(axis=1)]),
        by_tilt=rotate(leaning, place[contacts.tooth]),
        carries=carries,
    )


def _tooth_contacts(
    model: SolidSectorModel,
    linear: SolidLinearised,
    state: SolidState,
    circular_spline_moved: Array,
) -> tuple[ToothRows, Mask]:
    """Contacts within reach, and a mask of those that carry force, without slopes."""
    held = state.held
    if held is None or not len(held):
        raise ValueError("the influence needs an equilibrium whose teeth carry force")
    possible = model.teeth.find(
        linear.frames[0],
        model.loads(state),
        circular_spline_moved,
        REACH * model.lobe_height,
        held,
        thorough=True,
        circular_spline_rotation=state.circular_spline_rotation,
        held_force=state.tooth_force,
    )
    contacts = len(possible) - possible.slopes
    z = model.strip.mesh.teeth.z
    old, new = (
        FlankPoints.from_contacts(
            rows.contacts, (rows.z - z[0]) / (z[1] - z[0]), len(z)
        )
        for rows in (held, possible.chosen(np.arange(contacts)))
    )
    carries = np.zeros(contacts, dtype=bool)
    low, high = model.strip.flank_range
    carries[old.nearest_in(new, high - low)] = True
    return possible, carries

"""Lines of action of the tooth forces, with the compliance of the loaded parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.common.friction import Sliding
from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.linearise import Linearised
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceLines:
    """The n lines of force of m contact candidates.

    They do not depend on the contact state of the bore. N sectors have n_dofs degrees
    of freedom each.
    """

    contacts: Contacts
    """Candidates for tooth contact (m)."""
    force: Contacts
    """Lines of force (n): the normals of the candidates and, with friction, their
    tangents."""
    sliding: Sliding | None
    """Friction on the lines; None without friction."""
    strips: Strips | None
    """Indentation strips of the candidates; None without indentation."""
    rows: Array
    """Derivatives of the gaps of the lines (n, n_dofs)."""
    constraints: Array
    """Directions of the anchor and gradient of the rotation (N, n_dofs, 2)."""
    compliance: Array
    """Compliance of flexspline teeth, circular spline and indentation (n, n) [m/N]."""
    gap: Array
    """Gaps of the lines without tooth forces, with all sectors held in place (n,) [m].
    """

    @classmethod
    def from_candidates(
        cls, model: SectorModel, state: State, linear: Linearised, contacts: Contacts
    ) -> ForceLines:
        """Lines of force of the candidates at a state.

        Args:
            model: The 2D model.
            state: State at which the ring was linearised.
            linear: The linearised ring.
            contacts: Candidates for tooth contact, m of them.
        """
        sliding = _friction_lines(model, state, contacts)
        lines = contacts if sliding is None else sliding.lines
        strips = _strips(model, state, contacts)
        rows = linear.gap_gradient(lines)
        constraints = np.stack([linear.anchor, linear.rotation_gradient], axis=-1)
        constraints[linear.fixed] = 0.0
        local = lines.weight @ model.element.flank_compliance
        same = lines.sector[:, None] == lines.sector[None, :]
        compliance = np.where(same, local @ lines.weight.T, 0.0)
        of_spline = model.circular_spline.compliance
        if of_spline is not None:
            compliance += of_spline.contact_compliance(
                lines.tooth, lines.circular_spline_weight, model.circular_spline_teeth
            )
        # remove the elastic displacements under the old tooth forces from the gaps; the
        # compliance adds those under the new forces
        old = np.einsum("kb,kb->k", local, state.flank_force[lines.sector])
        old += np.einsum(
            "kb,kb->k",
            lines.circular_spline_weight,
            linear.circular_spline_elastic[lines.tooth],
        )
        gap = lines.gap - old
        if strips is not None:
            m = len(strips.strip)
            compliance[:m, :m] += strips.compliance
            gap[:m] += strips.offset
        return cls(
            contacts=contacts,
            force=lines,
            sliding=sliding,
            strips=strips,
            rows=rows,
            constraints=constraints,
            compliance=compliance,
            gap=gap,
        )


def _friction_lines(
    model: SectorModel, state: State, contacts: Contacts
) -> Sliding | None:
    """Normal and tangential lines of force; None without friction or candidates."""
    if model.friction is None or not len(contacts):
        return None
    last = state.candidates or state.slip
    return Sliding.from_trial(model.friction, contacts, state.slip, last)


def _strips(model: SectorModel, state: State, contacts: Contacts) -> Strips | None:
    """Indentation strips of the candidates; None without indentation or candidates."""
    if model.indentation is None or not len(contacts):
        return None
    held, force = state.contacts, state.tooth_force
    return Strips.from_contacts(model.indentation, contacts, held, force)

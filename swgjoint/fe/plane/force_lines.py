"""Lines along which the teeth push, with the compliance of what they push against."""

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
    """The n lines of force of the m candidates, whatever the bore touches."""

    contacts: Contacts
    """Candidates for tooth contact (m)."""
    force: Contacts
    """Lines of force: normals, then, with friction, tangents (n)."""
    sliding: Sliding | None
    """Friction on the lines; None without."""
    strips: Strips | None
    """Indentation strips of the candidates; None without indentation."""
    rows: Array
    """Derivatives of the gaps of the lines (n, n_dofs)."""
    loads: Array
    """Right-hand sides (N, n_dofs, n + 3): a column that each solution fills with the
    gradient, then unit forces on the lines, the anchor and the rotation."""
    compliance: Array
    """Compliance of loaded teeth, circular spline and indentation (n, n) [m/N]."""
    gap: Array
    """Gaps without tooth forces, the rest of the drive held in place (n,) [m]."""

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
        n, rows = len(lines), linear.gap_gradient(lines)
        loads = np.zeros((*linear.gradient.shape, n + 3))
        loads[lines.sector, :, 1 + np.arange(n)] = rows
        loads[:, :, n + 1] = linear.anchor
        loads[:, :, n + 2] = linear.rotation_gradient
        loads[linear.fixed] = 0.0
        local = lines.weight @ model.element.flank_compliance
        same = lines.sector[:, None] == lines.sector[None, :]
        compliance = np.where(same, local @ lines.weight.T, 0.0)
        of_spline = model.circular_spline.compliance
        if of_spline is not None:
            compliance += of_spline.contact_compliance(
                lines.tooth, lines.circular_spline_weight, model.circular_spline_teeth
            )
        # gaps without the old tooth forces; the new forces bring their own share
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
            loads=loads,
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

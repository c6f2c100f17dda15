"""Lines of action of the tooth forces, and the condensed system of their forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.common.complementarity import ActiveSetError, solve_mixed
from swgjoint.fe.common.friction import Sliding
from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.plane.linearise import Linearised
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array, Index, Mask


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
    arm: Array
    """Lever arms of the lines, by which turning the circular spline closes them (n,)
    [m]."""
    loads: Array
    """Room for minus the gradient, then directions of the anchor and gradient of the
    rotation (N, n_dofs, 3)."""
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
        loads = np.empty((*linear.anchor.shape, 3))
        loads[..., 1], loads[..., 2] = linear.anchor, linear.rotation_gradient
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
            arm=np.einsum("ki,ki->k", rotate_right_angle(lines.point), lines.normal),
            loads=loads,
            compliance=compliance,
            gap=gap,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """Unknowns of the condensed system of a Newton step."""

    force: Array
    """Forces on the lines (n,) [N]."""
    active: Mask
    """Whether each candidate carries force (m,)."""
    anchor: float
    """Force of the anchor [N]."""
    circular_spline_turn: float
    """Rotation increment of the circular spline [rad]."""
    multiplier: float
    """Multiplier of the flexspline's rotation: the torque that holds it [N·m]."""
    compliance: float
    """Compliance of the output, per torque of the model [rad/(N·m)]."""


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


def solve_condensed(
    matrix: Array,
    offset: Array,
    sliding: Sliding | None,
    guess: Mask,
    *,
    turns: bool,
    held: bool,
) -> Solution:
    """Solution of the condensed system, with friction reduced to k - m forces.

    Args:
        matrix: Matrix M (n + 3, n + 3).
        offset: Offset q (n + 3,).
        sliding: Friction on the lines; None without friction.
        guess: Whether each of the m candidates carries force in the first guess (m,).
        turns: Whether the circular spline turns.
        held: Whether the rotation of the flexspline is prescribed.

    Raises:
        ActiveSetError: If no set of active contacts is found.
    """
    m = len(guess)
    k = m if sliding is None else m + len(sliding.stick)
    used = np.arange(k + 1)
    if turns:
        used = np.append(used, k + 1)
    if held:
        used = np.append(used, k + 2)
    multipliers = int(held)

    def solved_for(matrix: Array, offset: Array) -> tuple[Array, Mask]:
        system = matrix[np.ix_(used, used)]
        return solve_mixed(system, offset[used], m, multipliers, guess)

    if sliding is None:
        values, active = solved_for(matrix, offset)
    else:
        full = matrix, offset
        try:
            matrix, offset = sliding.reduce(*full)
            values, active = solved_for(matrix, offset)
        except ActiveSetError:
            # friction limits from the last normal forces make the system symmetric
            sliding = sliding.lag()
            matrix, offset = sliding.reduce(*full)
            values, active = solved_for(matrix, offset)
    z = np.zeros(k + 3)
    z[used] = values
    inside = np.concatenate([np.flatnonzero(active), used[m:]])
    anchor, circular_spline_turn, multiplier = z[k:]
    return Solution(
        force=z[:k] if sliding is None else sliding.forces(z[:k]),
        active=active,
        anchor=float(anchor),
        circular_spline_turn=float(circular_spline_turn),
        multiplier=float(multiplier),
        compliance=_output_compliance(matrix, inside, k, turns=turns),
    )


def _output_compliance(matrix: Array, held: Index, k: int, *, turns: bool) -> float:
    """Tangent compliance of the output, per torque of the model.

    Args:
        matrix: Matrix M (k + 3, k + 3) of the k forces, the anchor, the rotation of the
            circular spline and the multiplier.
        held: Indices of the unknowns that may differ from zero, increasing.
        k: Number of force unknowns.
        turns: Whether the circular spline turns.

    Returns:
        Rotation of the output against its load per torque [rad/(N·m)].
    """
    system = matrix[np.ix_(held, held)]
    if turns:
        unit = (held == k + 1).astype(float)
        return -float(np.linalg.solve(system, unit)[held == k + 1][0])
    held = held[held <= k]
    reach, turn = matrix[held, k + 2], matrix[k + 2, held]
    system = matrix[np.ix_(held, held)]
    return float(matrix[k + 2, k + 2] - turn @ np.linalg.solve(system, reach))

"""One Newton step of the 2D drive: the linearised problem with its contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.common.complementarity import ActiveSetError, solve_mixed
from swgjoint.fe.common.cyclic import CyclicFactor
from swgjoint.fe.common.friction import Sliding
from swgjoint.fe.common.indentation import Strips
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.plane.linearise import Linearised
from swgjoint.fe.plane.race import NODE
from swgjoint.fe.plane.ring import RingModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array, Mask


@dataclass(frozen=True, kw_only=True)
class Load:
    """Prescribed output torque, rotation of the flexspline, or both.

    With a torque alone the flexspline is the output; with a rotation alone the
    flexspline is held; with both it is held and the circular spline is the output.
    """

    torque: float | None = None
    """Torque T of the output on its load, whole drive [N·m]."""
    rotation: float | None = None
    """Best-fit rotation of the flexspline's bore [rad]."""
    teeth: bool = True
    """Whether the teeth can touch."""

    def __post_init__(self) -> None:
        if self.torque is None and self.rotation is None:
            raise ValueError("torque = None, rotation = None: expected at least one")

    @property
    def on_flexspline(self) -> float | None:
        """Torque of the flexspline on a load [N·m]; None if its rotation is given."""
        return self.torque if self.rotation is None else None

    @property
    def on_ring(self) -> float | None:
        """Torque of the circular spline on a load [N·m]; None if it has no load."""
        return self.torque if self.rotation is not None else None


@dataclass(frozen=True, kw_only=True, eq=False)
class NewtonStep:
    """Solution of one linearised problem."""

    lines: Contacts
    """Lines of force: normals of the candidates, then, with friction, their tangents.
    """
    line_force: Array
    """Force along each line [N]."""
    contacts: Contacts
    """Contact candidates."""
    active: NDArray[np.int64]
    """Indices of the candidates that carry force."""
    torque: float
    """Torque T of the output on its load, whole drive [N·m]."""
    holding_torque: float
    """External torque on the flexspline, whole drive [N·m]."""
    compliance: float
    """Tangent compliance -d(output rotation)/dT, whole drive [rad/(N·m)]."""
    ring_turn: float
    """Increment of the circular spline's rotation [rad]."""
    increment: Array
    """Increment of the degrees of freedom of every sector (N, n) [m]."""
    shift: Array
    """Shift of the skeleton nodes in the global frame (N, n_a, 2) [m]."""
    race_shift: Array
    """Shift of the race nodes (N, m, 2, 2) [m]; empty without a race."""
    pressure: Array
    """Force of the wave generator at each station of the bore (N, q) [N]."""
    strip_error: float
    """Error of the linearised indentation law [m]."""

    @property
    def largest(self) -> float:
        """Largest displacement increment [m]."""
        of_race = float(np.abs(self.race_shift).max(initial=0.0))
        return max(float(np.abs(self.shift).max()), of_race, self.strip_error)


def solve_newton_step(
    model: RingModel,
    state: State,
    ring: Linearised,
    load: Load,
    contacts: Contacts,
    pressing: NDArray[np.int64] | None = None,
) -> NewtonStep:
    """Condense the ring to its contact forces, solve for them, go back.

    The contacts that are ``pressing``, if given, are the first guess of those that
    carry force.

    Columns of the ring's inverse: the load, every contact candidate, a soft anchor that
    keeps the rotation of the whole ring regular and is taken out again as an unknown,
    and the gradient of the output rotation.
    """
    element = model.element
    # lines of force: the normals and, with friction, the tangents of the contacts
    m, lines, sliding = len(contacts), contacts, None
    if model.friction is not None and m:
        last = state.candidates or state.slip
        sliding = Sliding.from_trial(model.friction, contacts, state.slip, last)
        lines = sliding.lines
    n, rows = len(lines), ring.gap_gradient(lines)
    levers = np.zeros((*ring.gradient.shape, n + 2))
    levers[lines.sector, :, np.arange(n)] = rows
    levers[:, :, n] = ring.anchor
    levers[:, :, n + 1] = ring.rotation_gradient

    rhs = -ring.gradient
    columns = np.concatenate([rhs[:, :, None], levers], axis=2)
    columns[ring.fixed] = 0.0
    solved = CyclicFactor(ring.anchor_tangent(), ring.face_dofs).solve(columns)
    base, response = solved[:, :, 0], solved[:, :, 1:]

    # forces on the lines, displacement of the anchor, rotation of the circular spline,
    # multiplier of the flexspline's rotation
    matrix, offset = np.zeros((n + 3, n + 3)), np.zeros(n + 3)
    own = np.r_[0 : n + 1, n + 2]
    matrix[np.ix_(np.arange(n), own)] = np.einsum(
        "kn,knl->kl", rows, response[lines.sector]
    )
    local = lines.weight @ element.flank_compliance
    same = lines.sector[:, None] == lines.sector[None, :]
    matrix[:n, :n] += np.where(same, local @ lines.weight.T, 0.0)
    ring_compliance = model.circular_spline.compliance
    if ring_compliance is not None:
        matrix[:n, :n] += ring_compliance.contact_compliance(
            lines.tooth, lines.ring_weight, model.ring_teeth
        )
    strips = None
    if model.indentation is not None and m:
        strips = Strips.from_contacts(
            model.indentation, contacts, state.contacts, state.tooth_force
        )
        matrix[:m, :m] += strips.compliance
    last_two = np.array([n, n + 2])
    matrix[np.ix_(last_two, own)] = np.einsum("snf,snl->fl", levers[:, :, n:], response)
    matrix[:n, last_two] = matrix[last_two, :n].T
    matrix[n, n] -= 1.0 / ring.anchor_stiffness
    # turning the circular spline towards the teeth closes the gap by the lever arm
    arm = np.einsum("ki,ki->k", rotate_right_angle(lines.point), lines.normal)
    matrix[:n, n + 1] = matrix[n + 1, :n] = -arm
    offset[n + 1] = -(load.on_ring or 0.0) / model.copies
    # gaps as if the old tooth forces were gone; the new ones bring their own share
    old = np.einsum("kb,kb->k", local, state.flank_force[lines.sector])
    old += np.einsum("kb,kb->k", lines.ring_weight, ring.ring_elastic[lines.tooth])
    moved = np.einsum("kn,kn->k", rows, base[lines.sector])
    offset[:n] = lines.gap - old + moved
    if strips is not None:
        offset[:m] += strips.offset
    offset[last_two] = np.einsum("snf,sn->f", levers[:, :, n:], base)
    offset[n + 2] += ring.rotation - (load.rotation or 0.0)

    k = m if sliding is None else m + len(sliding.stick)
    used = np.arange(k + 1)
    if load.on_ring is not None:
        used = np.append(used, k + 1)
    if load.rotation is not None:
        used = np.append(used, k + 2)
    guess = offset[:m] < 0.0
    if state.contacts is not None and len(state.contacts):
        guess = contacts.share_flank_with(state.contacts)
    if pressing is not None:
        guess = np.isin(np.arange(m), pressing)

    def solved_for(matrix: Array, offset: Array) -> tuple[Array, Mask]:
        return solve_mixed(
            matrix[np.ix_(used, used)],
            offset[used],
            m,
            int(load.rotation is not None),
            guess,
        )

    if sliding is None:
        found, active = solved_for(matrix, offset)
    else:
        full = matrix, offset
        try:
            matrix, offset = sliding.reduce(*full)
            found, active = solved_for(matrix, offset)
        except ActiveSetError:
            # without friction in proportion to the normal forces it is symmetric
            sliding = sliding.lag()
            matrix, offset = sliding.reduce(*full)
            found, active = solved_for(matrix, offset)
    z = np.zeros(k + 3)
    z[used] = found
    held = np.concatenate([np.flatnonzero(active), used[m:]])
    compliance = output_compliance(matrix, held, k, load)
    force = z[:k] if sliding is None else sliding.forces(z[:k])
    anchor, ring_turn, multiplier = z[k:]

    solution = np.concatenate([force, [anchor, multiplier]])
    increment = base + response @ solution
    holding = model.copies * float(multiplier)
    return NewtonStep(
        lines=lines,
        line_force=force,
        contacts=contacts,
        active=np.flatnonzero(active),
        torque=-holding if load.torque is None else load.torque,
        holding_torque=holding if load.on_flexspline is None else -load.on_flexspline,
        compliance=compliance / model.copies,
        ring_turn=float(ring_turn),
        increment=increment,
        shift=ring.rotate_to_global(increment),
        race_shift=increment[:, model.race_dofs[:-NODE]].reshape(
            model.sectors, -1, 2, 2
        ),
        pressure=np.where(
            state.touching, -model.stations.stiffness * ring.gap_after(increment), 0.0
        ),
        strip_error=0.0 if strips is None else strips.error(force[:m]),
    )


def wrong_stations(state: State, gap: Array) -> Array:
    """Violation of the assumed contact state at each station.

    Args:
        state: State whose bore contact is assumed.
        gap: Gap at each station (N, q) [m].

    Returns:
        Gap of stations assumed in contact, overlap of the others (N, q) [m]; positive
        values are violations.
    """
    return np.asarray(np.where(state.touching, gap, -gap))


def output_compliance(
    matrix: Array, held: NDArray[np.int64], k: int, load: Load
) -> float:
    """Tangent compliance of the output, per torque of the model.

    Args:
        matrix: Matrix of k force unknowns, anchor, ring rotation and multiplier.
        held: Unknowns that are not zero.
        k: Number of force unknowns.
        load: Prescribed torque or rotation.

    Returns:
        Rotation of the output against its load per torque [rad/(N·m)].
    """
    system = matrix[np.ix_(held, held)]
    if load.on_ring is not None:
        unit = (held == k + 1).astype(float)
        return -float(np.linalg.solve(system, unit)[held == k + 1][0])
    held = held[held <= k]
    reach, turn = matrix[held, k + 2], matrix[k + 2, held]
    system = matrix[np.ix_(held, held)]
    return float(matrix[k + 2, k + 2] - turn @ np.linalg.solve(system, reach))

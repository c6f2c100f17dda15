"""One Newton step of the 2D model: the linearised problem with its contacts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.fe.common.complementarity import ActiveSetError, solve_mixed
from swgjoint.fe.common.friction import Sliding
from swgjoint.fe.common.ring_factor import RingFactor
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.plane.force_lines import ForceLines
from swgjoint.fe.plane.linearise import Linearised
from swgjoint.fe.plane.race import NODE
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array, Index, Mask


@dataclass(frozen=True, kw_only=True)
class Load:
    """Prescribed output torque, rotation of the flexspline, or both.

    If only the torque is given, the flexspline is the output. If only the rotation is
    given, the flexspline is held. If both are given, the flexspline is held and the
    circular spline is the output.
    """

    torque: float | None = None
    """Torque T of the output on its load, whole drive [N·m]."""
    rotation: float | None = None
    """Best-fit rotation of the flexspline's bore [rad]."""
    teeth: bool = True
    """Whether the teeth can touch."""

    def __post_init__(self) -> None:
        if self.torque is None and self.rotation is None:
            raise ValueError(
                "torque = None, rotation = None: expected a number for at least one"
            )

    @property
    def on_flexspline(self) -> float | None:
        """Torque of the flexspline on its load [N·m]; None if its rotation is given."""
        return self.torque if self.rotation is None else None

    @property
    def on_circular_spline(self) -> float | None:
        """Torque of the circular spline on its load [N·m]; None if it cannot turn."""
        return self.torque if self.rotation is not None else None


@dataclass(frozen=True, kw_only=True, eq=False)
class NewtonStep:
    """Solution of one linearised problem."""

    lines: Contacts
    """Lines of force (n): the normals of the candidates and, with friction, their
    tangents."""
    line_force: Array
    """Force along each line (n,) [N]."""
    contacts: Contacts
    """Contact candidates (m)."""
    active: Index
    """Indices of the candidates that carry force (n_active,)."""
    torque: float
    """Torque T of the output on its load, whole drive [N·m]."""
    holding_torque: float
    """External torque on the flexspline, whole drive [N·m]."""
    compliance: float
    """Tangent compliance -d(output rotation)/dT, whole drive [rad/(N·m)]."""
    circular_spline_turn: float
    """Increment of the circular spline's rotation [rad]."""
    increment: Array
    """Increment of the degrees of freedom of every sector (N, n_dofs) [m]."""
    shift: Array
    """Shift of the skeleton nodes in the global frame (N, n_a, 2) [m]."""
    race_shift: Array
    """Shift of the race nodes (N, m, 2, 2) [m]; empty without a race."""
    gap: Array
    """Gaps of the stations of the bore after the step (N, q) [m]."""
    pressure: Array
    """Normal force on the bore at each of its stations (N, q) [N]."""
    strip_error: float
    """Largest error of the linearised indentation law [m]; zero without indentation."""

    @property
    def largest(self) -> float:
        """Largest increment of a node, or the error of the indentation law [m]."""
        of_race = float(np.abs(self.race_shift).max(initial=0.0))
        return max(float(np.abs(self.shift).max()), of_race, self.strip_error)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Solution:
    """Unknowns of the condensed system, see :class:`NewtonProblem`."""

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


@dataclass(frozen=True, kw_only=True, eq=False)
class NewtonProblem:
    """A ring linearised at a state and condensed to its contact forces.

    The condensed system g = q + M z has n + 3 unknowns z and as many rows:

    ========== ========================================= ===========================
    entry      unknown                                   row
    ========== ========================================= ===========================
    0 to n - 1 forces on the lines [N]: normals of the   gaps of the lines [m]
               m candidates, then, with friction, their
               m tangents
    n          force of the anchor [N]                   misfit of its spring [m]
    n + 1      rotation of the circular spline [rad]     its residual moment [N·m]
    n + 2      multiplier of the flexspline's rotation   rotation error [rad]
               [N·m]
    ========== ========================================= ===========================

    The anchor is a spring that makes the tangent regular although the ring may rotate
    as a whole; the force of the anchor cancels that of the spring. With friction the
    line forces are reduced to k unknowns: the m normal forces and one friction force
    per sticking flank pair, so that the last three entries are k to k + 2. Without
    friction k = n = m. The rotation of the circular spline is used only if a torque
    acts on it, and the multiplier only if the rotation of the flexspline is prescribed.
    """

    model: SectorModel
    """The 2D model."""
    load: Load
    """Prescribed torque or rotation."""
    state: State
    """State at which the ring was linearised."""
    linear: Linearised
    """The linearised ring."""
    lines: ForceLines
    """Lines of force of the candidates."""
    factor: RingFactor
    """Factorised tangent with the anchor spring."""

    @classmethod
    def from_candidates(
        cls,
        model: SectorModel,
        state: State,
        linear: Linearised,
        load: Load,
        contacts: Contacts,
    ) -> NewtonProblem:
        """Newton problem of a linearised ring.

        Args:
            model: The 2D model.
            state: State at which the ring was linearised.
            linear: The linearised ring.
            load: Prescribed torque or rotation.
            contacts: Candidates for tooth contact, m of them.

        Raises:
            SingularCyclicError: If the tangent of the ring is singular.
        """
        return cls(
            model=model,
            load=load,
            state=state,
            linear=linear,
            lines=ForceLines.from_candidates(model, state, linear, contacts),
            factor=RingFactor(
                linear.anchor_tangent(), linear.face_dofs, np.unique(contacts.sector)
            ),
        )

    def exchange(self, stations: Mask) -> NewtonProblem:
        """The problem with the contact state of some bore stations inverted.

        It is valid for a rigid wave generator only. The linearised ring and its factor
        are updated in place, so that the original problem cannot be solved afterwards.

        Args:
            stations: Whether to switch each station (N, q).

        Raises:
            SingularCyclicError: If the tangent becomes singular.
        """
        touching = self.state.touching
        changed = self.linear.exchange(stations, touching)
        self.factor.update(self.linear.anchor_tangent(changed), changed)
        return replace(self, state=replace(self.state, touching=touching ^ stations))

    def solve(self, pressing: Index | None = None) -> NewtonStep:
        """Solution for the contact forces and the increment of the nodes.

        Args:
            pressing: Indices of the candidates that carry force in the first guess. By
                default these are the candidates on flanks that carry force in the state
                or, if there are none, those that overlap.

        Raises:
            ActiveSetError: If no set of active contacts is found.
        """
        linear, lines = self.linear, self.lines
        loads = np.concatenate([-linear.gradient[:, :, None], lines.constraints], 2)
        loads[linear.fixed] = 0.0
        sector = lines.force.sector
        products = self.factor.condense(loads, sector, lines.rows)
        matrix, offset = self._matrix(products), self._offset(products[0])
        guess = _first_guess(self.state, lines.contacts, offset, pressing)
        solution = _solve_condensed(matrix, offset, lines.sliding, guess, self.load)
        # the loads of the solution together: on all sectors and on those of the teeth
        load = loads @ np.array([1.0, solution.anchor, solution.multiplier])
        np.add.at(load, sector, solution.force[:, None] * lines.rows)
        moved = self.factor.solve(load[:, :, None])[:, :, 0]
        return self._step(solution, moved)

    def _matrix(self, products: Array) -> Array:
        """Matrix M (n + 3, n + 3).

        Args:
            products: Products with the compliance of the ring of minus the gradient,
                the constraints and the n lines (n + 3, n + 3).
        """
        lines = self.lines.force
        n, matrix = len(lines), np.zeros((len(lines) + 3, len(lines) + 3))
        matrix[:n, :n] = products[3:, 3:] + self.lines.compliance
        # anchor and rotation of the flexspline
        constrained = np.array([n, n + 2])
        matrix[:n, constrained] = products[3:, 1:3]
        matrix[constrained, :n] = products[1:3, 3:]
        matrix[np.ix_(constrained, constrained)] = products[1:3, 1:3]
        matrix[n, n] -= 1.0 / self.linear.anchor_stiffness
        # turning the circular spline towards the teeth closes the gap by the lever arm
        arm = np.einsum("ki,ki->k", rotate_right_angle(lines.point), lines.normal)
        matrix[:n, n + 1] = matrix[n + 1, :n] = -arm
        return matrix

    def _offset(self, products: Array) -> Array:
        """Offset q (n + 3,).

        Args:
            products: Row of minus the gradient in the products of :meth:`_matrix`: the
                changes without line forces (n + 3,).
        """
        lines, load = self.lines, self.load
        n, offset = len(lines.force), np.zeros(len(lines.force) + 3)
        offset[:n] = lines.gap + products[3:]
        # anchor and rotation of the flexspline, torque on the circular spline
        offset[[n, n + 2]] = products[1:3]
        offset[n + 1] = -(load.on_circular_spline or 0.0) / self.model.copies
        offset[n + 2] += self.linear.rotation - (load.rotation or 0.0)
        return offset

    def _step(self, solution: _Solution, increment: Array) -> NewtonStep:
        """Step with the displacements, torques and bore forces of a solution.

        Args:
            solution: Unknowns of the condensed system.
            increment: Increment of the degrees of freedom (N, n_dofs) [m].
        """
        model, linear, load, lines = self.model, self.linear, self.load, self.lines
        force, strips = solution.force, lines.strips
        race_shift = increment[:, model.race_dofs[:-NODE]]
        gap = linear.gap_after(increment)
        push = -model.stations.stiffness * gap
        holding = model.copies * solution.multiplier
        on_flexspline = load.on_flexspline
        return NewtonStep(
            lines=lines.force,
            line_force=force,
            contacts=lines.contacts,
            active=np.flatnonzero(solution.active),
            torque=-holding if load.torque is None else load.torque,
            holding_torque=holding if on_flexspline is None else -on_flexspline,
            compliance=solution.compliance / model.copies,
            circular_spline_turn=solution.circular_spline_turn,
            increment=increment,
            shift=linear.rotate_to_global(increment),
            race_shift=race_shift.reshape(model.sectors, -1, 2, 2),
            gap=gap,
            pressure=np.where(self.state.touching, push, 0.0),
            strip_error=0.0
            if strips is None
            else strips.error(force[: len(lines.contacts)]),
        )


def _first_guess(
    state: State, contacts: Contacts, offset: Array, pressing: Index | None
) -> Mask:
    """Whether each candidate carries force in the first guess (m,)."""
    m = len(contacts)
    if pressing is not None:
        return np.isin(np.arange(m), pressing)
    if state.contacts is not None and len(state.contacts):
        return contacts.share_flank_with(state.contacts)
    return np.asarray(offset[:m] < 0.0)


def _solve_condensed(
    matrix: Array, offset: Array, sliding: Sliding | None, guess: Mask, load: Load
) -> _Solution:
    """Solution of the condensed system, with friction reduced to k - m forces."""
    m = len(guess)
    k = m if sliding is None else m + len(sliding.stick)
    used = np.arange(k + 1)
    if load.on_circular_spline is not None:
        used = np.append(used, k + 1)
    if load.rotation is not None:
        used = np.append(used, k + 2)
    multipliers = int(load.rotation is not None)

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
    held = np.concatenate([np.flatnonzero(active), used[m:]])
    anchor, circular_spline_turn, multiplier = z[k:]
    return _Solution(
        force=z[:k] if sliding is None else sliding.forces(z[:k]),
        active=active,
        anchor=float(anchor),
        circular_spline_turn=float(circular_spline_turn),
        multiplier=float(multiplier),
        compliance=output_compliance(matrix, held, k, load),
    )


def output_compliance(matrix: Array, held: Index, k: int, load: Load) -> float:
    """Tangent compliance of the output, per torque of the model.

    Args:
        matrix: Matrix M (k + 3, k + 3) of the k forces, the anchor, the rotation of the
            circular spline and the multiplier.
        held: Indices of the unknowns that may differ from zero, increasing.
        k: Number of force unknowns.
        load: Prescribed torque or rotation.

    Returns:
        Rotation of the output against its load per torque [rad/(N·m)].
    """
    system = matrix[np.ix_(held, held)]
    if load.on_circular_spline is not None:
        unit = (held == k + 1).astype(float)
        return -float(np.linalg.solve(system, unit)[held == k + 1][0])
    held = held[held <= k]
    reach, turn = matrix[held, k + 2], matrix[k + 2, held]
    system = matrix[np.ix_(held, held)]
    return float(matrix[k + 2, k + 2] - turn @ np.linalg.solve(system, reach))

"""One Newton step of the 2D model: the linearised problem with its contacts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swgjoint.fe.common.ring_factor import RingFactor
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.force_lines import ForceLines, Solution, solve_condensed
from swgjoint.fe.plane.linearise import Linearised
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
    gap: Array
    """Gaps of the stations of the bore after the step (N, q) [m]."""
    strip_error: float
    """Largest error of the linearised indentation law [m]; zero without indentation."""

    @cached_property
    def largest(self) -> float:
        """Largest increment of a node, or the error of the indentation law [m]."""
        increment = self.increment
        return max(float(increment.max()), -float(increment.min()), self.strip_error)


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
        factor: RingFactor | None = None,
    ) -> NewtonProblem:
        """Newton problem of a linearised ring.

        Args:
            model: The 2D model.
            state: State at which the ring was linearised.
            linear: The linearised ring.
            load: Prescribed torque or rotation.
            contacts: Candidates for tooth contact, m of them.
            factor: Factorised tangent of ``linear`` if it was kept; None factorises it.

        Raises:
            SingularCyclicError: If the tangent of the ring is singular.
        """
        if factor is None:
            factor = RingFactor(
                linear.hessian, linear.face_dofs, np.unique(contacts.sector)
            )
        return cls(
            model=model,
            load=load,
            state=state,
            linear=linear,
            lines=ForceLines.from_candidates(model, state, linear, contacts),
            factor=factor,
        )

    def exchange(self, stations: Mask) -> NewtonProblem:
        """The problem with the contact state of some bore stations inverted.

        The linearised ring and its factor are updated in place, so that the original
        problem cannot be solved afterwards.

        Args:
            stations: Whether to switch each station (N, q).

        Raises:
            SingularCyclicError: If the tangent becomes singular.
        """
        touching = self.state.touching
        self.factor.update(self.linear.exchange(stations, touching))
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
        loads = lines.loads
        loads[:, :, 0] = -linear.gradient
        loads[linear.fixed] = 0.0
        compiled = self._solve_compiled(loads, pressing)
        if compiled is not None:
            return self._step(*compiled)
        sector = lines.force.sector
        products = self.factor.condense(loads, sector, lines.rows)
        matrix, offset = self._matrix(products), self._offset(products[0])
        guess = _first_guess(self.state, lines.contacts, pressing)
        if guess is None:
            guess = offset[: len(lines.contacts)] < 0.0
        solution = solve_condensed(
            matrix, offset, lines.sliding, guess, turns=self._turns, held=self._held
        )
        # the loads of the solution together: on all sectors and on those of the teeth
        load = loads @ np.array([1.0, solution.anchor, solution.multiplier])
        np.add.at(load, sector, solution.force[:, None] * lines.rows)
        moved = self.factor.solve(load[:, :, None])[:, :, 0]
        return self._step(solution, moved)

    def _solve_compiled(
        self, loads: Array, pressing: Index | None
    ) -> tuple[Solution, Array] | None:
        """Solution and increment (N, n_dofs) [m] from compiled loops.

        Args:
            loads: Minus the gradient and both constraints (N, n_dofs, 3).
            pressing: First guess, see :meth:`solve`.

        Returns:
            None if compiled loops are not available, if there is friction, if the first
            guess is not known beforehand, or if they find no set of active contacts.
        """
        lines, n = self.lines, len(self.lines.force)
        active = _first_guess(self.state, lines.contacts, pressing)
        if active is None or lines.sliding is not None:
            return None
        z = np.empty(n + 3)
        numbers = self.linear.anchor_stiffness, *self._moment_and_rotation
        solved = self.factor.solve_contacts(
            loads,
            lines.force.sector,
            lines.rows,
            (lines.gap, lines.arm, lines.compliance, np.array(numbers)),
            turns=self._turns,
            held=self._held,
            active=active,
            result=z,
        )
        if solved is None:
            return None
        increment, compliance = solved
        anchor, turn, multiplier = z[n:]
        solution = Solution(
            force=z[:n],
            active=active,
            anchor=float(anchor),
            circular_spline_turn=float(turn),
            multiplier=float(multiplier),
            compliance=compliance,
        )
        return solution, increment

    @property
    def _turns(self) -> bool:
        """Whether the circular spline turns."""
        return self.load.on_circular_spline is not None

    @property
    def _held(self) -> bool:
        """Whether the rotation of the flexspline is prescribed."""
        return self.load.rotation is not None

    @property
    def _moment_and_rotation(self) -> tuple[float, float]:
        """Moment on the circular spline [N·m] and rotation of the flexspline.

        Both without line forces; the rotation is relative to the prescribed one [rad].
        """
        load = self.load
        moment = -(load.on_circular_spline or 0.0) / self.model.copies
        return moment, self.linear.rotation - (load.rotation or 0.0)

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
        matrix[:n, n + 1] = matrix[n + 1, :n] = -self.lines.arm
        return matrix

    def _offset(self, products: Array) -> Array:
        """Offset q (n + 3,).

        Args:
            products: Row of minus the gradient in the products of :meth:`_matrix`: the
                changes without line forces (n + 3,).
        """
        lines = self.lines
        n, offset = len(lines.force), np.zeros(len(lines.force) + 3)
        moment, rotation = self._moment_and_rotation
        offset[:n] = lines.gap + products[3:]
        # anchor and rotation of the flexspline, torque on the circular spline
        offset[[n, n + 2]] = products[1:3]
        offset[n + 1] = moment
        offset[n + 2] += rotation
        return offset

    def _step(self, solution: Solution, increment: Array) -> NewtonStep:
        """Step with the displacements, torques and bore forces of a solution.

        Args:
            solution: Unknowns of the condensed system.
            increment: Increment of the degrees of freedom (N, n_dofs) [m].
        """
        model, load, lines = self.model, self.load, self.lines
        force, strips = solution.force, lines.strips
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
            gap=self.linear.gap_after(increment),
            strip_error=0.0
            if strips is None
            else strips.error(force[: len(lines.contacts)]),
        )


def _first_guess(
    state: State, contacts: Contacts, pressing: Index | None
) -> Mask | None:
    """Whether each candidate carries force in the first guess (m,).

    The result is None if the candidates that overlap without forces are to be guessed.
    """
    if pressing is not None:
        guess = np.zeros(len(contacts), dtype=bool)
        guess[pressing] = True
        return guess
    if state.contacts is not None and len(state.contacts):
        return contacts.share_flank_with(state.contacts)
    return None

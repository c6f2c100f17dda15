"""Equilibrium of the 3D cup between wave generator and circular spline.

The corotational strips are solved by Newton's method. Contact with the wave generator
is treated by a primal-dual active-set method and condensed in every sector. In every
iteration the tooth forces and the rotation of the output solve a small complementarity
problem for the current tangent, as in the 2D model. Close to the solution the tangent
is factorised only once, see :mod:`swgjoint.fe.solid.tangent`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import Outcome
from swgjoint.fe.common.complementarity import (
    ActiveSetError,
    first_to_close,
    solve_mixed,
)
from swgjoint.fe.common.cyclic import SingularCyclicError
from swgjoint.fe.solid.condensation import Candidates, condense
from swgjoint.fe.solid.corotation import energies
from swgjoint.fe.solid.linearise import BoreContact, SolidLinearised, linearise
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.tangent import SolidTangent, keeps_tangent
from swgjoint.fe.solid.tooth_rows import ToothRows
from swgjoint.fe.solid.wave_generator.race import NODE
from swgjoint.typing import Array

RELEASES = 6
"""Number of times that a line of bore nodes may return from contact in several planes
to contact at a vertex. Without this limit some lines would alternate for ever."""
NARROW, WIDE = 0.02, 0.1
"""Largest gaps of candidates of tooth contact, in lobe heights [-]. The limit follows
the last displacement increment between these two."""


@dataclass(frozen=True, kw_only=True)
class SolidLoad:
    """Prescribed torque, rotation or both.

    If only the torque is given, the output is the bore of the diaphragm. If only the
    rotation is given, the bore of the diaphragm is held there and the circular spline
    is fixed. If both are given, the bore is held and the circular spline is the output.
    """

    torque: float | None = None
    """Torque T that the output of the whole drive exerts on its load [N·m]; None if it
    is a result."""
    rotation: float | None = None
    """Rotation at which the bore of the diaphragm is held [rad]; None if it is a
    result."""
    teeth: bool = True
    """Whether tooth contact is considered."""

    def __post_init__(self) -> None:
        if self.torque is None and self.rotation is None:
            raise ValueError("torque, rotation: expected at least one of them")


@dataclass(frozen=True, kw_only=True)
class SolidSolver:
    """Settings of Newton's method."""

    max_iterations: int = 80
    """Largest number of iterations."""
    step_tolerance: float = 1e-10
    """Largest displacement increment of a converged iteration [m]. It is a thousandth
    of the smallest effect of interest, which is 0.1 µm."""
    thorough_below: float = 1e-7
    """Largest displacement increment below which tooth contact is also searched between
    the nodes [m]."""
    keep_below: float = 1e-6
    """Largest displacement increment, and largest sum of increments at settled contact,
    below which a tangent is kept [m]. The tangent of a state so close reduces the error
    as much as that of the last state."""
    slowest: float = 0.5
    """Ratio of the displacement increments of two iterations above which the tangent
    is computed anew [-]."""
    exchanges: int = 8
    """Largest number of updates of the bore contact per linearisation. Without them
    most iterations would repeat the search for tooth contacts although only the bore
    contact changes, which recedes by a line of nodes at a time."""
    stride: float = 0.2
    """Limit of the displacement increment of an iteration, in lobe heights [-]; larger
    increments are damped because the contacts change on the way."""
    largest_step: float = 0.1
    """Displacement increment from which the iteration counts as diverged [m]."""

    def __call__(
        self,
        model: SolidSectorModel,
        start: SolidState,
        load: SolidLoad,
        tangent: SolidTangent | None = None,
    ) -> SolidState:
        """Solve for the equilibrium at the wave-generator angle of ``start``.

        Args:
            model: The 3D model.
            start: State from which the search starts.
            load: Prescribed torque and rotation.
            tangent: Tangent of a state near the solution; None for that of ``start``.

        Returns:
            The last state with the outcome of the search. If the search did not
            converge, the state is not an equilibrium.
        """
        state, history = start, list[float]()
        tried: set[bytes] = set()
        settled, stay, since = False, False, 0
        last: Array | None = None
        # a state whose teeth carry force is close to the solution
        thorough = start.held is not None and len(start.held) > 0
        reach = (NARROW if thorough else WIDE) * model.lobe_height
        released = np.zeros(start.shared.shape, int)
        try:
            for _ in range(self.max_iterations):
                keep = self.keep_below, self.slowest
                anew = not keeps_tangent(history, since, keep, settled=settled)
                anew &= tangent is None or bool(history)
                kept = released >= RELEASES
                linear = linearise(model, state, kept=kept, tangent=anew)
                if tangent is None or anew:
                    tangent, since = SolidTangent(model, linear), len(history)
                # once the search is thorough it remains so: contacts that only this
                # search finds would otherwise appear and disappear for ever
                thorough |= bool(history) and history[-1] < self.thorough_below
                search = reach, thorough, stay
                found = None
                if load.teeth:
                    found = Candidates.find(model, state, linear.frames[0], search)
                step = _solve_linear(model, state, linear, tangent, load, found)
                for _ in range(self.exchanges):
                    bad = _wrong_points(linear.bore, step) > 0.0
                    if not (step.largest < self.keep_below and bad.any()):
                        break
                    linear = linear.exchange(model, state, step.pressure, bad, kept)
                    step = _solve_linear(model, state, linear, tangent, load, found)
                history.append(step.largest)
                limits = NARROW * model.lobe_height, WIDE * model.lobe_height
                reach = min(max(step.largest, limits[0]), limits[1])
                if not step.largest < self.largest_step:
                    return replace(
                        state, outcome=Outcome.DIVERGED, history=tuple(history)
                    )
                longest = 0.5 if _takes_back(step.increment, last) else 1.0
                # minima that jump to and fro over a flat flank share their force
                stay |= longest < 1.0 and step.largest < self.thorough_below
                damping = min(longest, self.stride * model.lobe_height / step.largest)
                last = step.increment
                # a contact set that occurs again would recur for ever if all its
                # contacts changed as before: then only the worst one changes
                touching = linear.bore.active.tobytes()
                repeats = touching in tried
                tried.add(touching)
                shared = state.shared
                state, settled = _advance(
                    model, state, linear, step, damping, one_at_a_time=repeats
                )
                released += shared & ~state.shared
                small = step.largest < self.step_tolerance and damping == 1.0
                if settled and small and (thorough or not load.teeth):
                    free = load.torque is not None and load.teeth
                    free &= len(state.tooth_force) == 0
                    outcome = Outcome.SINGULAR if free else Outcome.CONVERGED
                    return _finished(model, state, outcome, history)
        except ActiveSetError as error:
            return replace(start, outcome=error.outcome, history=tuple(history))
        except SingularCyclicError:
            return replace(start, outcome=Outcome.SINGULAR, history=tuple(history))
        outcome = Outcome.MAX_ITERATIONS if settled else Outcome.ACTIVE_SET_CYCLES
        return _finished(model, state, outcome, history)


def _takes_back(increment: Array, last: Array | None) -> bool:
    """Whether an increment reverses more than half of the previous one.

    A flexspline that rocks on a crowned wave generator may otherwise alternate for ever
    between two contact sets, each of which leads to the other.
    """
    if last is None:
        return False
    return bool(np.vdot(increment, last) < -0.5 * np.vdot(last, last))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """Solution of one linearised problem."""

    found: ToothRows | None
    """Candidates of tooth contact; None without tooth contact."""
    force: Array
    """Normal forces of the candidates (n,) [N]."""
    active: NDArray[np.int64]
    """Indices of the candidates that carry force."""
    increment: Array
    """Increment of the coordinates of the sectors in the global frame (N, size) [m]."""
    turn: float
    """Rotation increment of the bore of the diaphragm [rad]."""
    circular_spline_turn: float
    """Rotation increment of the circular spline [rad]."""
    pressure: Array
    """Forces of the wave generator at the contact points (N, p) [N]."""
    after: Array
    """Gaps to the wave generator after the undamped step (N, p) [m]."""
    torque: float
    """Torque T of the output on its load, whole drive [N·m]."""
    holding_torque: float
    """External torque on the bore of the diaphragm, whole drive [N·m]."""
    compliance: float
    """Tangent compliance -d(output rotation)/dT of the whole drive [rad/(N·m)]; NaN
    without a prescribed torque."""

    @property
    def largest(self) -> float:
        """Largest displacement increment [m]."""
        return float(np.abs(self.increment).max())


def _wrong_points(bore: BoreContact, step: _Step) -> Array:
    """Violation of the contact state of each point of the bore (N, p) [m].

    Touching points under tension have to open, and open points that overlap to close.
    """
    wrong = np.where(bore.active, -step.pressure * bore.own_compliance, -step.after)
    return np.where(bore.present & (wrong > 1e-15), wrong, 0.0)


def _solve_linear(
    model: SolidSectorModel,
    state: SolidState,
    linear: SolidLinearised,
    tangent: SolidTangent,
    load: SolidLoad,
    found: Candidates | None,
) -> _Step:
    """Condense the ring to tooth forces and rotations, solve and expand the result."""
    condensed = condense(model, state, linear, tangent, found, load.rotation)
    candidates = None if found is None else found.rows
    system, offset = condensed.system, condensed.offset.copy()
    # unknowns: forces of contacts, output rotation under a torque, forces of slopes
    n, slopes = (0, 0) if candidates is None else (len(candidates), candidates.slopes)
    contacts, output = n - slopes, n if load.rotation is None else n + 1
    unsigned = np.arange(contacts, n)
    if load.torque is not None:
        offset[output] -= load.torque / model.copies
        unsigned = np.append(output, unsigned)
    used = np.append(np.arange(contacts), unsigned)
    unknown, active, compliance = np.zeros(n + 2), np.zeros(contacts, bool), np.nan
    if len(used):
        guess = offset[:contacts] < 0.0
        if state.held is not None and candidates is not None and len(state.held):
            guess = candidates.contacts.share_flank_with(state.held.contacts)[:contacts]
        elif load.torque is not None:
            guess |= first_to_close(system, offset, contacts, output)
        unknown[used], active = solve_mixed(
            system[np.ix_(used, used)], offset[used], contacts, slopes, guess
        )
        if load.torque is not None:
            acting = np.append(np.flatnonzero(active), unsigned)
            unit = np.where(acting == output, -1.0 / model.copies, 0.0)
            answer = np.linalg.solve(system[np.ix_(acting, acting)], unit)
            compliance = float(answer[acting == output][0])
    # increments of the ring, and contact forces and gaps of the bore after the step
    force, (turn, circular_spline_turn) = unknown[:n], unknown[n:]
    increment = condensed.increment(unknown)
    bore = linear.bore
    change = bore.change(increment[:, model.contact_dofs])
    by_teeth = np.zeros_like(change)
    if candidates is not None:
        for k in np.flatnonzero(force):
            by_teeth[candidates.contacts.sector[k]] += force[k] * condensed.coupling[k]
    free = bore.free_gap + change + by_teeth
    push = -(bore.inverse @ bore.among_points(free)[:, :, None])[:, :, 0]
    after = free + (push[:, None] @ bore.compliance)[:, 0]
    rotation = state.rotation if load.rotation is None else load.rotation
    holding = -model.copies * float(condensed.offset[n] + system[n] @ unknown)
    return _Step(
        found=candidates,
        force=force,
        active=np.flatnonzero(active),
        increment=increment,
        turn=rotation + float(turn) - state.rotation,
        circular_spline_turn=float(circular_spline_turn),
        pressure=bore.at_all(push),
        after=after,
        torque=-holding if output == n or load.torque is None else load.torque,
        holding_torque=holding,
        compliance=compliance,
    )


def _advance(
    model: SolidSectorModel,
    state: SolidState,
    linear: SolidLinearised,
    step: _Step,
    damping: float,
    *,
    one_at_a_time: bool,
) -> tuple[SolidState, bool]:
    """Move the ring, replace the contact forces and update the touching bore nodes.

    Returns:
        The new state, and whether the contact set of the bore remained the same.
    """
    bore, masters = linear.bore, model.strip.masters
    wrong = _wrong_points(bore, step)
    bad = wrong > 0.0
    if bad.any() and one_at_a_time:
        bad = wrong == wrong.max()
    touching = bore.active ^ bad
    # a line shares its contact if it has no vertex or also touches far from it
    nodes, lines = bore.normal.shape[1], bore.found.shape[1]
    apart = (touching & bore.present)[:, :nodes].reshape(len(touching), -1, lines)
    shared = ~bore.found | apart.any(axis=1)
    # damped motion of masters and race; contact forces are not damped
    size, last = masters.face_size, masters.size - masters.face_size
    moved = damping * step.increment
    master_dofs = model.dofs(np.arange(masters.size))
    x = model.masters(state) + moved[:, master_dofs].reshape(len(moved), -1, 3)
    race = state.race
    if race is not None:
        race = race + moved[:, model.race_dofs[:NODE]].reshape(race.shape)
    flank_force = np.zeros_like(state.flank_force)
    circular_spline_force = np.zeros_like(state.circular_spline_force)
    kept = None
    if step.found is not None:
        contacts, facing = step.found.contacts, step.found.circular_spline_weight
        for k in np.flatnonzero(step.force):
            f = step.force[k]
            flank_force[contacts.sector[k]] += f * step.found.weight[k]
            circular_spline_force[contacts.tooth[k]] += f * facing[k]
        kept = step.found.chosen(step.active)
    new = replace(
        state,
        faces=x[:, :size],
        inside=x[:, size:last],
        race=race,
        pressure=step.pressure,
        bore_force=bore.nodal_force(step.pressure),
        touching=touching,
        shared=shared,
        flank_force=flank_force,
        circular_spline_force=circular_spline_force,
        held=kept,
        tooth_force=step.force[step.active],
        rotation=state.rotation + damping * step.turn,
        circular_spline_rotation=state.circular_spline_rotation
        + damping * step.circular_spline_turn,
        torque=step.torque,
        holding_torque=step.holding_torque,
        compliance=step.compliance,
    )
    return new, not bool(bad.any() or (shared ^ state.shared).any())


def _finished(
    model: SolidSectorModel, state: SolidState, outcome: Outcome, history: list[float]
) -> SolidState:
    """The last state with its outcome, ball forces, energy and moments."""
    # energy of the segments, and of the teeth under their loads
    frames = model.frames(state)
    energy = sum(
        float(energies(segment, frame).sum())
        for segment, frame in zip(model.strip.segments, frames, strict=True)
    )
    loads = model.loads(state)
    energy += 0.5 * float(np.sum(loads * (loads @ model.strip.teeth.compliance)))
    moved = model.teeth.displace_circular_spline(state.circular_spline_force)
    energy += 0.5 * float(np.sum(state.circular_spline_force * moved))
    # moments of the bore forces and of the tooth forces about the axis
    turned = frames[0].turn.transpose(0, 2, 1)
    points = model.bore_positions(frames[0], state) @ turned
    force = state.bore_force.reshape(points.shape) @ turned
    moment = points[..., 0] * force[..., 1] - points[..., 1] * force[..., 0]
    teeth = 0.0 if state.held is None else float(state.tooth_force @ state.held.arm)
    energy, torque = model.copies * energy, model.copies * float(moment.sum())
    balls = None
    if model.race is not None and state.race is not None:
        forces = model.race.forces(state.race, state.wave_generator_angle)
        energy += forces.energy
        balls, torque = forces.balls.force, forces.balls.input_torque
    # contiguous arrays, so that a state read from a file continues bit for bit
    return replace(
        state,
        faces=np.ascontiguousarray(state.faces),
        inside=np.ascontiguousarray(state.inside),
        outcome=outcome,
        history=tuple(history),
        ball_force=balls,
        energy=energy,
        wave_generator_torque=torque,
        tooth_moment=model.copies * teeth,
    )

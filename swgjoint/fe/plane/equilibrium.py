"""Equilibrium of the flexspline between wave generator and circular spline.

The solver applies Newton's method to the ring of corotational sectors. A primal-dual
active set of bore stations describes the contact with the wave generator. The tooth
forces solve a small complementarity problem at the current tangent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.common.complementarity import ActiveSetError
from swgjoint.fe.common.cyclic import SingularCyclicError
from swgjoint.fe.common.friction import SlipHistory, dissipated_work, spring_energy
from swgjoint.fe.common.indentation import strain_energy
from swgjoint.fe.plane.contact_points import touch_twice
from swgjoint.fe.plane.corotation import elastic_energy, rotate_right_angle
from swgjoint.fe.plane.linearise import Linearised, linearise
from swgjoint.fe.plane.newton_step import (
    Load,
    NewtonProblem,
    NewtonStep,
)
from swgjoint.fe.plane.race import NODE
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.typing import Array, Index, Mask

CIRCULAR_SPLINE_RANGE = 0.2
"""Largest displacement of the circular spline for which its linear model is accepted,
in lobe heights [-]. At half of it the input torque still agrees with the derivative of
the energy to seven digits."""

FOLLOWED = 100.0
"""Reach of the search for contacts after a small step, in this step [-]. No flank moves
by as many of the next steps, which are smaller."""

MOVED = 10.0
"""Upper bound of the motion of a flank in a step, in increments of the nodes [-]. The
flank is part of a tooth whose feet are nodes, and it turns with them."""

TOUCH = 1e-15
"""Largest gap that counts as zero [m]."""


@dataclass(frozen=True, kw_only=True)
class NewtonSolver:
    """Newton solver for equilibria, with its settings."""

    max_iterations: int = 120
    """Largest number of Newton iterations."""
    step_tolerance: float = 2e-12
    """Increment of the nodes below which the iteration ends [m]. It is about 1e-5 of
    the smallest effect of interest, a tenth of a micrometre."""
    conforming_tolerance: float = np.inf
    """Upper bound of this increment if a flank touches at several points [m]. With one
    point per flank the iteration converges quadratically, and its remaining error is
    far below the last increment. On conforming flanks points replace each other, and
    the remaining error is as large as the last increment."""
    thorough_below: float = 1e-7
    """Increment below which the contact search is thorough, see
    :meth:`swgjoint.fe.plane.tooth_contact.ToothContact.search` [m]."""
    exchanges: int = 6
    """Largest number of updates of the bore contact per linearisation. Without these
    updates most iterations would repeat the search for tooth contacts although only the
    bore contact changes."""
    exchange_below: float = 1e-5
    """Increment below which a linearisation is accurate enough for such updates [m]."""
    keep_below: float = 0.0
    """Increment below which the next iteration keeps the tangent and its factor, unless
    the contact of the bore changes [m]; zero computes every tangent. The remaining
    error is the last increment times the relative change of the tangent."""
    stride: float = 0.1
    """Largest increment that is applied in one iteration, in lobe heights [-]; the
    contacts would change within a larger one."""
    largest_step: float = 0.1
    """Computed increment above which the search ends as diverged [m]."""
    circular_spline_range: float = CIRCULAR_SPLINE_RANGE
    """Largest accepted displacement of the circular spline, in lobe heights [-]."""

    def __call__(self, model: SectorModel, start: State, load: Load) -> State:
        """Equilibrium at the wave-generator angle of ``start``.

        Args:
            model: The 2D model.
            start: Start of the search.
            load: Prescribed torque or rotation.

        Returns:
            The equilibrium, or a state whose ``outcome`` tells why the search failed.
            That state is the last one or, if a linear system was singular or no active
            set of the teeth was found, ``start``.
        """
        state, history = start, list[float]()
        settled, problem = False, None
        tried: set[bytes] = set()
        near, searched_reach = np.ones((model.sectors, 2), dtype=bool), 0.0
        try:
            for iteration in range(self.max_iterations):
                keeps = settled and history[-1] < self.keep_below
                kept = problem if keeps else None
                linear = linearise(
                    model,
                    state,
                    load.on_flexspline,
                    kept=None if kept is None else kept.linear,
                )
                thorough = bool(history) and history[-1] < self.thorough_below
                # after three iterations or a small step, and at first under the torque
                # of the start, only close candidates matter
                close = thorough or iteration > 2
                close |= not history and start.torque == load.torque
                reach = (0.02 if close else 0.1) * model.lobe_height
                if thorough:
                    reach = min(reach, FOLLOWED * history[-1])
                contacts = linear.no_contacts
                if load.teeth:
                    # flanks beyond the last reach cannot have come within a smaller one
                    if history and reach + MOVED * history[-1] > searched_reach:
                        near[:] = True
                    contacts = linear.search.search(
                        linear.flank,
                        reach,
                        state.contacts,
                        thorough=thorough,
                        searched=near,
                    )
                    near[:], searched_reach = False, reach
                    near[contacts.sector, contacts.side] = True
                problem = NewtonProblem.from_candidates(
                    model,
                    state,
                    linear,
                    load,
                    contacts,
                    None if kept is None else kept.factor,
                )
                step = problem.solve()
                for _ in range(self.exchanges):
                    wrong = _stations_to_exchange(problem, step, self.exchange_below)
                    if wrong is None:
                        break
                    problem = problem.exchange(wrong)
                    step = problem.solve(step.active)
                state = problem.state
                history.append(step.largest)
                if not step.largest < self.largest_step:
                    return replace(
                        state, outcome=Outcome.DIVERGED, history=tuple(history)
                    )
                damping = min(1.0, self.stride * model.lobe_height / step.largest)
                # a contact state that returns would return forever: then
                # switch only one station at a time
                repeats = state.touching.tobytes() in tried
                tried.add(state.touching.tobytes())
                state, settled = _advance(
                    model,
                    state,
                    linear,
                    step,
                    damping,
                    one_at_a_time=repeats,
                )
                tolerance = self.step_tolerance
                if state.contacts is not None and touch_twice(state.contacts):
                    tolerance = min(tolerance, self.conforming_tolerance)
                small = step.largest < tolerance and damping == 1.0
                if settled and small and thorough:
                    # without tooth contact nothing determines the output angle
                    free = load.torque is not None and load.teeth
                    free &= len(state.tooth_force) == 0
                    outcome = Outcome.SINGULAR if free else Outcome.CONVERGED
                    return _finished(
                        model, state, outcome, history, self.circular_spline_range
                    )
        except ActiveSetError as error:
            return replace(start, outcome=error.outcome, history=tuple(history))
        except SingularCyclicError:
            return replace(start, outcome=Outcome.SINGULAR, history=tuple(history))
        outcome = Outcome.MAX_ITERATIONS if settled else Outcome.ACTIVE_SET_CYCLES
        return _finished(model, state, outcome, history, self.circular_spline_range)


LOW = 1e-4
"""Height of the lobes below which the tolerances of maps decrease in proportion [m]."""


def map_solver(lobe_height: float) -> NewtonSolver:
    """Solver of 2D maps.

    Compared with the default tolerances, its tolerances change the output error of the
    reference drive by less than 1.5e-9 rad and the input torque by about 3e-6 N·m and
    save half of the iterations.

    Args:
        lobe_height: Height of the lobes [m].
    """
    scale = min(1.0, lobe_height / LOW)
    return NewtonSolver(
        step_tolerance=1e-9 * scale,
        conforming_tolerance=1e-10 * scale,
        thorough_below=1e-6 * scale,
        keep_below=1e-7 * scale,
    )


def _stations_to_exchange(
    problem: NewtonProblem, step: NewtonStep, below: float
) -> Mask | None:
    """Stations of the bore that a step closes or opens.

    Returns:
        Whether to switch each station (N, q). None if none switches, if all contact
        would be lost, or if the step is too large.
    """
    state = problem.state
    if not step.largest < below:
        return None
    bad = _wrong_stations(state, step.gap)
    if not bad.any() or not (state.touching ^ bad).any():
        return None
    return bad


def _advance(
    model: SectorModel,
    state: State,
    linear: Linearised,
    step: NewtonStep,
    damping: float,
    *,
    one_at_a_time: bool,
) -> tuple[State, bool]:
    """State after a step: moved nodes, new tooth forces, updated bore contact.

    Returns:
        The new state, and whether the bore contact remained the same.
    """
    after = linear.gap + damping * (step.gap - linear.gap)
    bad = _wrong_stations(state, after)
    # if all stations opened, the rim would spring back: release the worst one only
    if bad.any() and (one_at_a_time or not (state.touching ^ bad).any()):
        wrong = np.where(state.touching, after, -after)
        bad = wrong == wrong.max()
    lines, force, m = step.lines, step.line_force[:, None], len(step.contacts)
    friction = step.line_force[m:] if len(lines) > m else np.zeros(m)
    # a sector stores its first face and its bore nodes; its last face is stored as the
    # first face of the next one
    size, inside = model.element.face_size, model.element.bore_size
    moved = model.skeleton(state) + damping * linear.rotate_to_global(step.increment)
    race = state.race
    if race is not None:
        shift = step.increment[:, model.race_dofs[:-NODE]]
        race = race + damping * shift.reshape(race.shape)
    push = -model.stations.stiffness * step.gap
    new = replace(
        state,
        faces=moved[:, :size],
        bores=moved[:, size : size + inside],
        race=race,
        pressure=np.where(state.touching, push, 0.0),
        touching=state.touching ^ bad,
        flank_force=_sum_by(lines.sector, force * lines.weight, model.sectors),
        circular_spline_force=_sum_by(
            lines.tooth,
            force * lines.circular_spline_weight,
            model.circular_spline_teeth,
        ),
        contacts=step.contacts.chosen(step.active),
        tooth_force=step.line_force[step.active],
        friction_force=friction[step.active],
        candidates=SlipHistory(
            contacts=step.contacts, normal=step.line_force[:m], force=friction
        ),
        rotation=linear.rotation,
        circular_spline_rotation=state.circular_spline_rotation
        + damping * step.circular_spline_turn,
        compliance=step.compliance,
        torque=step.torque,
        holding_torque=step.holding_torque,
    )
    return new, not bool(bad.any())


def _sum_by(number: Index, rows: Array, count: int) -> Array:
    """Sums (count, k) of the rows (n, k) that belong to each number (n,)."""
    # a product with a matrix of ones is faster than np.add.at
    ones = (number == np.arange(count)[:, None]).astype(float)
    return np.asarray(ones @ rows)


def _wrong_stations(state: State, gap: Array) -> Mask:
    """Stations assumed in contact that have a gap, and others that overlap (N, q).

    Args:
        state: State whose bore contact is assumed.
        gap: Gap at each station (N, q) [m].
    """
    touching = state.touching
    return np.asarray((gap > TOUCH) & touching | (gap < -TOUCH) & ~touching)


def _finished(
    model: SectorModel,
    state: State,
    outcome: Outcome,
    history: list[float],
    circular_spline_range: float,
) -> State:
    """State completed with the moments and the energy of the whole drive."""
    frames = model.frames(state)
    nodes = model.skeleton(state)[:, model.bore_nodes]
    rotation, _ = model.best_fit_rotation(nodes)
    moment = 0.0
    if state.contacts is not None:
        c = state.contacts
        moment = float(
            state.tooth_force
            @ np.einsum("ki,ki->k", rotate_right_angle(c.point), c.normal)
            + state.friction_force
            @ np.einsum("ki,ki->k", rotate_right_angle(c.point), c.tangent)
        )
    energy = float(elastic_energy(model.element, frames, state.flank_force).sum())
    moved = model.circular_spline_displacement(state)
    energy += 0.5 * float(np.sum(state.circular_spline_force * moved))
    if model.indentation is not None:
        energy += strain_energy(model.indentation, state.contacts, state.tooth_force)
    # the displacement must stay small, because the circular spline is linear
    if (
        outcome.ok
        and np.abs(moved).max(initial=0.0) > circular_spline_range * model.lobe_height
    ):
        outcome = Outcome.DIVERGED
    energy, balls = model.copies * energy, None
    if model.race is not None and state.race is not None:
        alpha = state.wave_generator_angle
        race = model.race.forces(state.race, alpha, nodes, state.touching)
        energy += race.energy
        input_torque, balls = race.balls.input_torque, race.balls.force
    else:
        pushed = state.pressure != 0.0
        points = model.bore_points(state)[pushed]
        _, normal, _ = model.wave_generator_gap(points, state.wave_generator_angle)
        arm = np.einsum("ki,ki->k", rotate_right_angle(points), normal)
        input_torque = model.copies * float(state.pressure[pushed] @ arm)
        layer = 0.5 * state.pressure**2 / model.stations.stiffness
        energy += model.copies * float(np.sum(layer))
    work, law = 0.0, model.friction
    if law is not None and state.candidates is not None:
        energy += model.copies * spring_energy(law, state.candidates)
        work = dissipated_work(law, state.slip, state.candidates)
        state = replace(state, slip=state.candidates)
    return replace(
        state,
        outcome=outcome,
        history=tuple(history),
        rotation=rotation,
        wave_generator_torque=input_torque,
        ball_force=balls,
        tooth_moment=model.copies * moment,
        energy=energy,
        friction_work=state.friction_work + model.copies * work,
        candidates=None,
    )

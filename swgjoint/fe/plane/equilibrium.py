"""Equilibrium of the flexspline between wave generator and circular spline.

Newton's method on the corotational ring. Contact with the wave generator is a
primal-dual active set of stations of the bore; tooth contact is a
small complementarity problem on the frozen tangent, in contact forces alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import Outcome
from swgjoint.fe.common.complementarity import ActiveSetError, solve_mixed
from swgjoint.fe.common.cyclic import CyclicFactor, SingularRingError
from swgjoint.fe.common.friction import (
    Sliding,
    SlipHistory,
    dissipated_work,
    spring_energy,
)
from swgjoint.fe.common.indentation import Strips, strain_energy
from swgjoint.fe.plane.corotation import elastic_energy, rotate_right_angle
from swgjoint.fe.plane.linearise import Linearised, linearise
from swgjoint.fe.plane.race import NODE
from swgjoint.fe.plane.ring import RingModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.tooth_contact import Contacts

RING_RANGE = 0.2
"""Displacement of the circular spline, in lobe heights, at which its linear model ends:
at a half of it the input torque still agrees with the energy to seven digits."""

TOUCH = 1e-15
"""Gap that counts as none [m]."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Load:
    """What is prescribed.

    The torque alone: the flexspline is the output. The rotation alone: the flexspline
    is held. Both: the flexspline is held and the circular spline is the output.
    """

    torque: float | None = None
    """T that the output exerts on its load, whole drive [N·m]."""
    rotation: float | None = None
    """Best-fit rotation of the flexspline's bore [rad]."""
    teeth: bool = True
    """Whether the teeth touch."""

    def __post_init__(self) -> None:
        if self.torque is None and self.rotation is None:
            raise ValueError("give a torque, a rotation, or both")

    @property
    def on_flexspline(self) -> float | None:
        """Torque that the flexspline exerts on a load [N·m]."""
        return self.torque if self.rotation is None else None

    @property
    def on_ring(self) -> float | None:
        """Torque that the circular spline exerts on a load [N·m]."""
        return self.torque if self.rotation is not None else None


@dataclass(frozen=True, kw_only=True)
class NewtonSolver:
    """Settings of the iteration."""

    max_iterations: int = 120
    step_tolerance: float = 2e-12
    """Displacement increment at which the iteration ends [m]; about 1e-5 of the
    smallest effect of interest, a tenth of a micrometre."""
    thorough_below: float = 1e-7
    """Increment below which contact is searched between the nodes, too [m]."""
    exchanges: int = 6
    """Exchanges of stations of the bore at one linearisation: most iterations would
    serve nothing else, and search for contact again."""
    exchange_below: float = 1e-5
    """Increment below which a linearisation is good enough for that [m]."""
    stride: float = 0.1
    """Longest move of one iteration, in lobe heights: contact changes on the way."""
    largest_step: float = 0.1
    """Displacement increment beyond which the search has left the drive [m]."""
    ring_range: float = RING_RANGE
    """Displacement of the circular spline, in lobe heights, that is taken [-]."""

    def __call__(self, model: RingModel, start: State, load: Load) -> State:
        """Equilibrium at the wave-generator angle of ``start``.

        Returns:
            The state with its outcome; states that did not converge come back too.
        """
        state, history = start, list[float]()
        settled = False
        tried: set[bytes] = set()
        try:
            for iteration in range(self.max_iterations):
                ring = linearise(model, state, load.on_flexspline)
                thorough = bool(history) and history[-1] < self.thorough_below
                # after the first steps, or a short one, only close candidates matter
                close = thorough or iteration > 2
                reach = (0.02 if close else 0.1) * model.lobe_height
                contacts = ring.no_contacts
                if load.teeth:
                    contacts = ring.search.search(
                        ring.flank, reach, state.contacts, thorough=thorough
                    )
                step = _solve_linear(model, state, ring, load, contacts)
                for _ in range(self.exchanges):
                    exchanged = _exchanged(state, ring, step, self.exchange_below)
                    if exchanged is None:
                        break
                    state, ring = exchanged
                    step = _solve_linear(
                        model, state, ring, load, contacts, step.active
                    )
                history.append(step.largest)
                if not step.largest < self.largest_step:
                    return replace(
                        state, outcome=Outcome.DIVERGED, history=tuple(history)
                    )
                damping = min(1.0, self.stride * model.lobe_height / step.largest)
                # a set that comes back would come back for ever
                repeats = state.touching.tobytes() in tried
                tried.add(state.touching.tobytes())
                state, settled = _advance(
                    model,
                    state,
                    ring,
                    step,
                    damping,
                    one_at_a_time=repeats,
                )
                small = step.largest < self.step_tolerance and damping == 1.0
                if settled and small and thorough:
                    # an output that no tooth holds stays where the search left it
                    free = load.torque is not None and load.teeth
                    free &= len(state.tooth_force) == 0
                    outcome = Outcome.SINGULAR if free else Outcome.CONVERGED
                    return _finished(model, state, outcome, history, self.ring_range)
        except ActiveSetError as error:
            return replace(start, outcome=error.outcome, history=tuple(history))
        except SingularRingError:
            return replace(start, outcome=Outcome.SINGULAR, history=tuple(history))
        outcome = Outcome.MAX_ITERATIONS if settled else Outcome.ACTIVE_SET_CYCLES
        return _finished(model, state, outcome, history, self.ring_range)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """Solution of one linearised problem."""

    lines: Contacts
    """Normals of the candidates, then, with friction, their tangents."""
    line_force: Array
    """Forces along them [N]."""
    contacts: Contacts
    """The candidates."""
    active: NDArray[np.int64]
    """Those that carry force."""
    torque: float
    holding_torque: float
    compliance: float
    ring_turn: float
    """Increment of the circular spline's rotation [rad]."""
    increment: Array
    """Of every sector (N, n) [m]."""
    shift: Array
    """Of the skeleton in the global frame (N, n_a, 2) [m]."""
    race_shift: Array
    """Of the race's nodes (N, m, 2, 2) [m]; empty without a race."""
    pressure: Array
    """Force of the wave generator at each station of the bore (N, q) [N]."""
    strip_error: float
    """Of the approach of the flanks, whose law is linearised [m]."""

    @property
    def largest(self) -> float:
        """Largest displacement increment [m]."""
        of_race = float(np.abs(self.race_shift).max(initial=0.0))
        return max(float(np.abs(self.shift).max()), of_race, self.strip_error)


def _solve_linear(
    model: RingModel,
    state: State,
    ring: Linearised,
    load: Load,
    contacts: Contacts,
    pressing: NDArray[np.int64] | None = None,
) -> _Step:
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
    compliance = _output_compliance(matrix, held, k, load)
    force = z[:k] if sliding is None else sliding.forces(z[:k])
    anchor, ring_turn, multiplier = z[k:]

    solution = np.concatenate([force, [anchor, multiplier]])
    increment = base + response @ solution
    holding = model.copies * float(multiplier)
    return _Step(
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


def _exchanged(
    state: State, ring: Linearised, step: _Step, below: float
) -> tuple[State, Linearised] | None:
    """Invert the contact state of the bore stations that a step closes or opens.

    Returns:
        None without such stations, after too large a step, or on a race, whose tangent
        depends on more than the stations.
    """
    if ring.race_rows is not None or not step.largest < below:
        return None
    bad = _wrong(state, ring.gap_after(step.increment)) > TOUCH
    if not bad.any() or not (state.touching ^ bad).any():
        return None
    return replace(state, touching=state.touching ^ bad), ring.exchange(
        bad, state.touching
    )


def _wrong(state: State, gap: Array) -> Array:
    """How far the stations are on the wrong side (N, q) [m]."""
    return np.asarray(np.where(state.touching, gap, -gap))


def _output_compliance(
    matrix: Array, held: NDArray[np.int64], k: int, load: Load
) -> float:
    """Rotation of the output against its load, per torque of the model.

    Args:
        matrix: Of k force unknowns, then anchor, ring and multiplier.
        held: Unknowns that are not zero.
        k: Force unknowns.
        load: What is prescribed.
    """
    system = matrix[np.ix_(held, held)]
    if load.on_ring is not None:
        unit = (held == k + 1).astype(float)
        return -float(np.linalg.solve(system, unit)[held == k + 1][0])
    held = held[held <= k]
    reach, turn = matrix[held, k + 2], matrix[k + 2, held]
    system = matrix[np.ix_(held, held)]
    return float(matrix[k + 2, k + 2] - turn @ np.linalg.solve(system, reach))


def _advance(
    model: RingModel,
    state: State,
    ring: Linearised,
    step: _Step,
    damping: float,
    *,
    one_at_a_time: bool,
) -> tuple[State, bool]:
    """Move, exchange tooth forces, update the wave generator's active set."""
    after = ring.gap_after(damping * step.increment)
    wrong = _wrong(state, after)
    bad = wrong > TOUCH
    # without any contact the rim springs back: let go of the worst node only
    if bad.any() and (one_at_a_time or not (state.touching ^ bad).any()):
        bad = wrong == wrong.max()
    lines, force, m = step.lines, step.line_force[:, None], len(step.contacts)
    flank_force = np.zeros_like(state.flank_force)
    np.add.at(flank_force, lines.sector, force * lines.weight)
    ring_force = np.zeros_like(state.ring_force)
    np.add.at(ring_force, lines.tooth, force * lines.ring_weight)
    friction = step.line_force[m:] if len(lines) > m else np.zeros(m)
    # faces and bores of each sector; a shared face appears once
    size, inside = model.element.face_size, model.element.bore_size
    moved = model.skeleton(state) + damping * step.shift
    new = replace(
        state,
        faces=moved[:, :size],
        bores=moved[:, size : size + inside],
        race=None if state.race is None else state.race + damping * step.race_shift,
        pressure=step.pressure,
        touching=state.touching ^ bad,
        flank_force=flank_force,
        ring_force=ring_force,
        contacts=step.contacts.chosen(step.active),
        tooth_force=step.line_force[step.active],
        friction_force=friction[step.active],
        candidates=SlipHistory(
            contacts=step.contacts, normal=step.line_force[:m], force=friction
        ),
        rotation=ring.rotation,
        ring_rotation=state.ring_rotation + damping * step.ring_turn,
        compliance=step.compliance,
        torque=step.torque,
        holding_torque=step.holding_torque,
    )
    return new, not bool(bad.any())


def _finished(
    model: RingModel,
    state: State,
    outcome: Outcome,
    history: list[float],
    ring_range: float,
) -> State:
    """Moments and energy of the whole drive at the last positions."""
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
    moved = model.ring_displacement(state)
    energy += 0.5 * float(np.sum(state.ring_force * moved))
    if model.indentation is not None:
        energy += strain_energy(model.indentation, state.contacts, state.tooth_force)
    # the circular spline is linear: it must stay near its place
    if outcome.ok and np.abs(moved).max(initial=0.0) > ring_range * model.lobe_height:
        outcome = Outcome.DIVERGED
    energy, balls = model.copies * energy, None
    if model.race is not None and state.race is not None:
        alpha = state.wave_generator_angle
        race = model.race.forces(state.race, alpha, nodes, state.touching)
        energy += race.energy
        input_torque, balls = race.balls.input_torque, race.balls.force
    else:
        normal = model.wave_generator_normal(state)
        arm = np.einsum(
            "sqi,sqi->sq", rotate_right_angle(model.bore_points(state)), normal
        )
        input_torque = model.copies * float(np.sum(state.pressure * arm))
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

"""Frictionless equilibria of the thin rings under torque, wave generator locked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import pi
from types import MappingProxyType

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.rings.equilibrium import ThinRingSolver
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import ThinRingState, initial_state
from swgjoint.typing import Array

SMALL = 0.01
"""Fraction of the rated torque that takes up the clearance of the teeth [-]."""
FREE = 1e-3
"""Torque at which the teeth count as unloaded where Newton's method without torque
fails, as a fraction of the elastic energy [1/rad]."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
"""Golden section, whose multiples spread angles over the tooth pitch [-]."""
TOUCH = 1.25
"""Rotation with which the search for a loaded equilibrium starts, as a multiple of the
one at which the first tooth touches [-]. Closer to it, so few teeth carry so little
load that Newton's method takes longer."""
NEARBY = 5e-3
"""Largest gap of teeth that a free rotation may close, as a fraction of the radius of
the rim [-]."""
TURNS = 3
"""Largest number of rotations to the teeth: the rim deforms while it turns, so that the
first one may end before them."""
SHORT_STEPS = ThinRingSolver(stride=0.02, max_iterations=400)
"""Solver where Newton's method at a prescribed rotation fails: with longer steps, which
no potential limits, the contacts of balls and bore can change forever."""
HALVINGS = 5
"""Largest number of times that failing torque steps are halved."""


def positions(model: ThinRing, count: int) -> Array:
    """Wave-generator angles spread over ball passage and tooth pitch [rad].

    Args:
        model: The rings.
        count: Number of angles.

    Returns:
        Angles (count,) [rad].
    """
    k = np.arange(count)
    passage = 2.0 * pi / model.bearing.balls / model.bearing.cage_share
    pitch = 2.0 * pi / model.teeth.circular_spline.teeth
    return np.asarray(passage * (k + 0.5) / count + pitch * np.mod(k * GOLDEN, 1.0))


def solve_unloaded(model: ThinRing, alpha: float, phase: float = 0.0) -> ThinRingState:
    """Equilibrium with the output held at its ideal angle alpha/i.

    Args:
        model: The rings.
        alpha: Wave-generator angle, any number of turns [rad].
        phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
    """
    start = initial_state(model, alpha, phase)
    solver, psi = ThinRingSolver(), start.rotation
    apart = solver(model, start, rotation=psi, teeth=False)
    if not apart.outcome.ok:
        return apart
    state = solver(model, apart, rotation=psi)
    return state if state.outcome.ok else SHORT_STEPS(model, apart, rotation=psi)


def without_torque(model: ThinRing, alpha: float) -> ThinRingState:
    """Equilibrium without torque.

    If clearance leaves the output free, the output is at its ideal angle alpha/i.

    Args:
        model: The rings.
        alpha: Wave-generator angle, any number of turns [rad].
    """
    state = solve_unloaded(model, alpha)
    if not (state.outcome.ok and state.loaded_teeth):
        return state
    found = ThinRingSolver()(model, state, torque=0.0)
    return found if found.outcome.ok else _turned_free(model, state)


def _turned_free(model: ThinRing, state: ThinRingState) -> ThinRingState:
    """Turn the output until the teeth hardly hold it.

    A drive with clearance has no stiffness between its teeth, so that Newton's method
    at a prescribed torque can jump from tooth to tooth. At a prescribed rotation it
    converges.

    Args:
        model: The rings.
        state: Equilibrium at a prescribed rotation, some of whose teeth carry load.

    Returns:
        The equilibrium, or the state of the last failed rotation.
    """
    solver = ThinRingSolver()
    for _ in range(solver.max_iterations):
        if not state.outcome.ok or abs(state.torque) < FREE * state.energy:
            return state
        turned = state.rotation + state.compliance * state.torque
        state = solver(model, state, rotation=turned)
    return replace(state, outcome=Outcome.MAX_ITERATIONS)


def solve_loaded(model: ThinRing, state: ThinRingState, torque: float) -> ThinRingState:
    """Equilibrium under a torque, reached in halved steps if the full step fails.

    If the torque changes its sign, the output is freed first and then turned across the
    clearance: Newton's method at a prescribed torque can fail there.

    Args:
        model: The rings.
        state: State from which the search starts. If no tooth carries load in it, its
            torque counts as zero, and the search converges best for a small ``torque``.
        torque: Torque T, not zero [N·m].

    Returns:
        The equilibrium, or the state of the last failed step.
    """
    solver, apart = ThinRingSolver(), state
    if state.loaded_teeth and state.torque * torque < 0.0:
        apart = solver(model, state, rotation=state.rotation, teeth=False)
    if not apart.loaded_teeth and apart.outcome.ok:
        touched = _turned_to_teeth(model, apart, torque)
        if touched is not None:
            tried = solver(model, touched, torque=torque)
            if tried.outcome.ok:
                return tried
    begin = state.torque if state.loaded_teeth else 0.0
    done, step, halved = 0.0, 1.0, 0
    while done < 1.0:
        goal = min(1.0, done + step)
        tried = solver(model, state, torque=begin + goal * (torque - begin))
        if tried.outcome.ok:
            state, done = tried, goal
            continue
        halved += 1
        step *= 0.5
        if halved > HALVINGS:
            return tried
    return state


def solve_over_torque(
    model: ThinRing,
    phase: float,
    levels: Array,
    nearby: Mapping[float, ThinRingState] | None = None,
) -> dict[float, ThinRingState]:
    """Equilibria under torques of both signs, wave generator at its initial angle.

    Equilibria of similar rings, such as those of the same drive without errors, save
    the search from undeformed rings. From one torque to the next, the rings then move
    about as far as the similar ones. If no equilibrium is found in this way, the torque
    is reached from the unloaded rings.

    Args:
        model: The rings.
        phase: Angle of ball 0 from the major axis [rad].
        levels: Magnitudes of the torques, increasing (n_levels,) [N·m].
        nearby: Equilibria of similar rings at the same angles, by torque [N·m].

    Returns:
        States by torque, that of zero torque only if it was needed; they end with the
        first one that is not an equilibrium.
    """
    found: dict[float, ThinRingState] = {}
    for sign in (1.0, -1.0):
        before = 0.0
        for torque in (sign * levels).tolist():
            state = _moved_along(model, torque, before, found, nearby or {})
            if state is None:
                if before not in found:
                    found[0.0] = solve_unloaded(model, 0.0, phase)
                if found[before].outcome.ok:
                    state = solve_loaded(model, found[before], torque)
                else:
                    return found
            found[torque] = state
            if not state.outcome.ok:
                return found
            before = torque
    return found


def recall_over_torque(
    design: str, model: ThinRing, phase: float, levels: Array
) -> Mapping[float, ThinRingState]:
    """Result of :func:`solve_over_torque`, which this process solves once.

    Drives that differ in the errors of their teeth alone share these equilibria.

    Args:
        design: Content hash of the design of the rings, without errors of the teeth.
        model: The rings.
        phase: Angle of ball 0 from the major axis [rad].
        levels: Magnitudes of the torques, increasing (n_levels,) [N·m].
    """
    elements = model.rim.elements, model.race.elements
    return _solved_once(_Rings(design, elements, phase, tuple(levels.tolist()), model))


@dataclass(frozen=True)
class _Rings:
    """Rings under torques; hash of the design and elements stand for the model."""

    design: str
    elements: tuple[int, int]
    phase: float
    levels: tuple[float, ...]
    model: ThinRing = field(compare=False)


@lru_cache(maxsize=8)
def _solved_once(rings: _Rings) -> Mapping[float, ThinRingState]:
    levels = np.array(rings.levels)
    return MappingProxyType(solve_over_torque(rings.model, rings.phase, levels))


def _moved_along(
    model: ThinRing,
    torque: float,
    before: float,
    found: Mapping[float, ThinRingState],
    nearby: Mapping[float, ThinRingState],
) -> ThinRingState | None:
    """Equilibrium whose search starts from that of similar rings; None without success.

    Args:
        model: The rings.
        torque: Torque T [N·m].
        before: Torque that was solved before [N·m].
        found: Equilibria of the rings by torque.
        nearby: Equilibria of the similar rings by torque.
    """
    start = nearby.get(torque)
    if start is None:
        return None
    if before in found and before in nearby:
        moved = start.q - nearby[before].q
        start = replace(start, q=found[before].q + moved)
    state = ThinRingSolver()(model, start, torque=torque)
    return state if state.outcome.ok else None


def _turned_to_teeth(
    model: ThinRing, state: ThinRingState, torque: float
) -> ThinRingState | None:
    """Turn a free output against a torque until teeth carry load; None without success.

    A free output has no stiffness, so that Newton's method at a prescribed torque takes
    tens of iterations to find the teeth. The gaps and their change with a rigid
    rotation of the rim tell where they are.

    Args:
        model: The rings.
        state: Equilibrium in which no tooth carries load.
        torque: Torque T that turns the output [N·m].
    """
    for _ in range(TURNS):
        free = _free_rotation(model, state, torque)
        if free is None:
            return None
        state = ThinRingSolver()(model, state, rotation=state.rotation + TOUCH * free)
        if not state.outcome.ok:
            return None
        if state.loaded_teeth:
            return state
    return None


def _free_rotation(
    model: ThinRing, state: ThinRingState, torque: float
) -> float | None:
    """Rotation of the rim at which the first tooth touches [rad]; None without any.

    Args:
        model: The rings.
        state: Equilibrium in which no tooth carries load.
        torque: Torque T that turns the output [N·m].
    """
    nodes = state.q[: model.rim.size].reshape(-1, 2, 2)[:: model.nodes_per_tooth]
    foot, slope = nodes[:, 0], nodes[:, 1]
    reach = NEARBY * model.rim.radius
    contacts, angle = model.teeth.find_contacts(foot, slope, reach=reach)
    rows, _ = model.teeth.rows(contacts, foot, slope, angle)
    turned = np.concatenate([rotate_right_angle(foot), rotate_right_angle(slope)], 1)
    # the load turns the output against the torque
    way = -np.sign(torque)
    closing = -way * np.einsum("ni,ni->n", rows, turned[contacts.sector])
    some = closing > 1e-3 * np.abs(closing).max(initial=0.0)
    if not some.any():
        return None
    return float(way * (contacts.gap[some] / closing[some]).min())

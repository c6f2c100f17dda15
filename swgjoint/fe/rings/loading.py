"""Equilibria of the thin rings under torque, wave generator locked, no friction."""

from __future__ import annotations

from math import pi

import numpy as np

from swgjoint.fe.rings.equilibrium import RingSolver
from swgjoint.fe.rings.model import ThinRing
from swgjoint.fe.rings.state import RingState, initial_state
from swgjoint.typing import Array

SMALL = 0.01
"""Part of the rated torque that takes up a clearance of the teeth."""
GOLDEN = 0.5 * (5.0**0.5 - 1.0)
HALVINGS = 5
"""How often a step of the torque that fails is halved."""


def positions(model: ThinRing, count: int) -> Array:
    """Wave-generator angles spread over ball passage and tooth pitch [rad]."""
    k = np.arange(count)
    passage = 2.0 * pi / model.bearing.balls / model.bearing.cage_share
    pitch = 2.0 * pi / model.teeth.circular_spline.teeth
    return np.asarray(passage * (k + 0.5) / count + pitch * np.mod(k * GOLDEN, 1.0))


def solve_unloaded(model: ThinRing, alpha: float, phase: float = 0.0) -> RingState:
    """The drive without torque: rings on the balls, output at the ideal ratio.

    Args:
        model: The rings.
        alpha: Wave-generator angle, of any number of turns [rad].
        phase: Angle of ball 0 from the major axis at alpha = 0 [rad].
    """
    start = initial_state(model, alpha, phase)
    solver, psi = RingSolver(), start.rotation
    state = solver(model, start, rotation=psi, teeth=False)
    return solver(model, state, rotation=psi) if state.outcome.ok else state


def without_torque(model: ThinRing, alpha: float) -> RingState:
    """The drive that nothing loads; an output that play leaves free stays as ideal.

    Args:
        model: The rings.
        alpha: Wave-generator angle, of any number of turns [rad].
    """
    state = solve_unloaded(model, alpha)
    if state.outcome.ok and state.loaded_teeth:
        state = RingSolver()(model, state, torque=0.0)
    return state


def solve_loaded(model: ThinRing, state: RingState, torque: float) -> RingState:
    """Equilibrium under a torque; on failure in halved steps.

    Args:
        model: The rings.
        state: Where to begin; one that holds no tooth counts as free of torque, and
            finds the teeth fastest under a small one.
        torque: T, not zero [N·m].
    """
    solver = RingSolver()
    begin = state.torque if state.loaded_teeth else 0.0
    done, step, halved = 0.0, 1.0, 0
    while done < 1.0:
        goal = min(1.0, done + step)
        found = solver(model, state, torque=begin + goal * (torque - begin))
        if found.outcome.ok:
            state, done = found, goal
            continue
        halved += 1
        step *= 0.5
        if halved > HALVINGS:
            return found
    return state

"""Gradual changes of a state, in increments that solves can follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from swgjoint.errors import Outcome
from swgjoint.fe.plane.state import StateFigures

HALVINGS = 5
"""Largest number of halvings of a failing increment."""

AnyState = TypeVar("AnyState", bound=StateFigures)


def follow(
    state: AnyState,
    step: Callable[[AnyState, float], AnyState],
    *,
    halvings: int = HALVINGS,
) -> AnyState:
    """State after a gradual change, whose increment is halved whenever a solve fails.

    Args:
        state: State at the start.
        step: Function that takes a nearby state and a fraction of the change, from 0 to
            1, and returns the state at that fraction.
        halvings: Largest number of halvings.

    Returns:
        State after the whole change or, if the smallest increment fails, the last
        converged state with the outcome of the failed attempt.
    """
    current, done, increment = state, 0.0, 1.0
    while done < 1.0:
        target = min(1.0, done + increment)
        reached = step(current, target)
        if reached.outcome.ok:
            current, done = reached, target
        elif increment <= 0.5**halvings:
            return replace(current, outcome=reached.outcome, history=reached.history)
        else:
            increment *= 0.5
    return replace(current, outcome=Outcome.CONVERGED)

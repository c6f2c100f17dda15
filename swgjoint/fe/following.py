"""Following an equilibrium through a change in parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from swgjoint.errors import Outcome

if TYPE_CHECKING:
    from swgjoint.fe.solid.state import SolidState
    from swgjoint.fe.state import State

HALVINGS = 5

AnyState = TypeVar("AnyState", "State", "SolidState")


def follow(state: AnyState, step: Callable[[AnyState, float], AnyState]) -> AnyState:
    """Go from part 0 to 1 of a change; a failed try halves the increment.

    Args:
        state: At the start.
        step: From a state to that at a part of the change.

    Returns:
        The state at the end; the last good one with the outcome of the next if stuck.
    """
    current, done, increment = state, 0.0, 1.0
    while done < 1.0:
        target = min(1.0, done + increment)
        tried = step(current, target)
        if tried.outcome.ok:
            current, done = tried, target
        elif increment <= 0.5**HALVINGS:
            return replace(current, outcome=tried.outcome, history=tried.history)
        else:
            increment *= 0.5
    return replace(current, outcome=Outcome.CONVERGED)

r"""Phases within a tooth pitch of the positions of a simulation of meshing.

A perfect drive repeats after :math:`2\pi/z` of the input, where z is the number of
teeth of the fixed member (of the input member if the wave generator is fixed). The
positions k t/N, k = 0 to N - 1, of t turns have the phases

.. math:: \varphi_k = k\,t z/N \bmod 1 .

If t z and N have a large common divisor, many positions share one phase: with 162 teeth
the nine positions of half a turn are nine pitches apart and therefore equivalent.
Extremes and means then describe that phase, not the passage of a tooth.
"""

from __future__ import annotations

import numpy as np

from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array

STEPS = 35
"""Positions of the thesis (section 3.4.5); the default if they spread over the pitch.
"""
ENOUGH = 5
"""Least number of phases of positions that spread over the pitch; no gap between
neighbouring phases exceeds that of this many equally spaced ones."""
LOOSE = 1.5
"""Factor by which a gap may exceed the equal spacing if there are fewer positions than
:data:`ENOUGH`."""
OVERLOAD = 10.0
"""Multiple of the rated torque from which a torque is more likely a mistake than a
load: strain wave gears ratchet below it [-]."""
_ROUND_OFF = 1e-6  # pitches


def phases_of(design: Design, steps: int, turn: float) -> Array:
    """Phases of all positions within a pitch, sorted and without duplicates [pitches].

    Args:
        design: The drive.
        steps: Wave-generator positions.
        turn: Turns of the input.
    """
    way = turn * design.periodicity / steps * np.arange(steps)
    phases = np.sort((way + 0.5 * _ROUND_OFF) % 1.0)
    return np.asarray(phases[np.diff(phases, prepend=-1.0) > _ROUND_OFF])


def spreads(design: Design, steps: int, turn: float) -> bool:
    """Whether the positions resolve the passage of a tooth, or follow a part of it.

    They resolve it if the gap between neighbouring phases never exceeds a fifth of a
    pitch; fewer than five positions may have gaps of 1.5 times their equal spacing.
    Positions at most a fifth of a pitch apart follow the motion itself.

    Args:
        design: The drive.
        steps: Wave-generator positions.
        turn: Turns of the input.
    """
    if abs(turn) * design.periodicity / steps <= 1.0 / ENOUGH:
        return True
    phases = phases_of(design, steps, turn)
    widest = float(np.diff(phases, append=phases[0] + 1.0).max())
    allowed = 1.0 / ENOUGH if steps >= ENOUGH else LOOSE / steps
    return widest <= allowed + 2.0 * _ROUND_OFF


def spreading_steps(design: Design, steps: int, turn: float) -> int:
    """Nearest number of positions that spread over the pitch; the larger if two are.

    Args:
        design: The drive.
        steps: Number of positions from which the search starts.
        turn: Turns of the input.
    """
    for apart in range(steps + int(ENOUGH * abs(turn) * design.periodicity) + 2):
        for wanted in (steps + apart, steps - apart):
            if wanted >= 1 and spreads(design, wanted, turn):
                return wanted
    raise AssertionError("positions a fifth of a pitch apart spread")


def default_steps(design: Design, turn: float) -> int:
    """35 positions, or the nearest number that spreads over the pitch.

    Args:
        design: The drive.
        turn: Turns of the input.
    """
    return spreading_steps(design, STEPS, turn)


def unspread(design: Design, steps: int, turn: float) -> str | None:
    """Number of phases that the positions hit, in words; None if they spread.

    Args:
        design: The drive.
        steps: Wave-generator positions.
        turn: Turns of the input.
    """
    if spreads(design, steps, turn):
        return None
    count = len(phases_of(design, steps, turn))
    return f"on {count} tooth phase" + "s" * (count > 1)


def alike(design: Design, steps: int, turn: float) -> str | None:
    """Warning that the positions miss the passage of a tooth; None if they spread.

    Args:
        design: The drive.
        steps: Wave-generator positions.
        turn: Turns of the input.
    """
    where = unspread(design, steps, turn)
    if where is None:
        return None
    return (
        f"{steps} positions over {turn:g} turns fall {where}, with"
        f" {design.periodicity} pitches per turn: they do not spread over the pitch, so"
        " output error and mean stresses do not describe the passage of a tooth;"
        f" accepted without warning: --steps {spreading_steps(design, steps, turn)}"
    )


def overload(design: Design, torque: float) -> str | None:
    """Torque in multiples of the rated torque, in words; None below the overload.

    Args:
        design: The drive.
        torque: Output torque, of either sign [N·m].
    """
    rated = ratings_of(design).rated_torque
    times = abs(torque) / rated
    if times < OVERLOAD:
        return None
    return f"{torque:g} N·m is {times:.4g} x the rated torque of {rated:g} N·m"

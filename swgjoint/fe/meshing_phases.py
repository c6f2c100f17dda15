r"""Where in a tooth pitch the wave-generator positions of a simulation of meshing are.

A perfect drive repeats after :math:`2\pi/z` of the input, z the teeth of the fixed
member (with the wave generator fixed those of the input member). Of the positions
k t/N, k = 0 to N - 1, of t turns the phase is

.. math:: \varphi_k = k\,t z/N \bmod 1 .

Where t z and N have a large common divisor many positions have one phase: with 162
teeth the nine positions of half a turn are nine pitches apart, all nine alike. Extremes
and means are then those of that phase, not of the passage of a tooth.
"""

from __future__ import annotations

import numpy as np

from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array

STEPS = 35
"""Positions of the thesis (section 3.4.5); the default where they spread."""
ENOUGH = 5
"""Phases that a spread has at least; no gap between them is wider than in so many
equal ones."""
LOOSE = 1.5
"""Of fewer positions than that, a gap may be wider than between equal ones by this
factor."""
OVERLOAD = 10.0
"""Of the rated torque, from which a torque is more likely a mistake than a load: strain
wave gears ratchet below [-]."""
_ROUND_OFF = 1e-6  # pitches


def phases_of(design: Design, steps: int, turn: float) -> Array:
    """Phases of all positions within a pitch, sorted, equal ones once [pitches].

    Args:
        design: The drive.
        steps: Wave-generator positions.
        turn: Turns of the input.
    """
    way = turn * design.periodicity / steps * np.arange(steps)
    found = np.sort((way + 0.5 * _ROUND_OFF) % 1.0)
    return np.asarray(found[np.diff(found, prepend=-1.0) > _ROUND_OFF])


def spreads(design: Design, steps: int, turn: float) -> bool:
    """Whether the positions show the passage of a tooth, or follow a part of it.

    They do if no two neighbouring phases are farther apart than a fifth of a pitch, of
    fewer than five positions 1.5 times what equal ones would be. Positions less than a
    fifth of a pitch apart follow the motion itself.
    """
    if abs(turn) * design.periodicity / steps <= 1.0 / ENOUGH:
        return True
    phases = phases_of(design, steps, turn)
    widest = float(np.diff(phases, append=phases[0] + 1.0).max())
    allowed = 1.0 / ENOUGH if steps >= ENOUGH else LOOSE / steps
    return widest <= allowed + 2.0 * _ROUND_OFF


def spreading_steps(design: Design, steps: int, turn: float) -> int:
    """The nearest number of positions that spreads, the larger of two."""
    for apart in range(steps + int(ENOUGH * abs(turn) * design.periodicity) + 2):
        for wanted in (steps + apart, steps - apart):
            if wanted >= 1 and spreads(design, wanted, turn):
                return wanted
    raise AssertionError("positions a fifth of a pitch apart spread")


def default_steps(design: Design, turn: float) -> int:
    """35 positions, or as many as next to it spread over the pitch."""
    return spreading_steps(design, STEPS, turn)


def unspread(design: Design, steps: int, turn: float) -> str | None:
    """On how few phases the positions fall; None where they spread."""
    if spreads(design, steps, turn):
        return None
    count = len(phases_of(design, steps, turn))
    return f"on {count} tooth phase" + "s" * (count > 1)


def alike(design: Design, steps: int, turn: float) -> str | None:
    """Line that says what the positions miss; None where they spread."""
    where = unspread(design, steps, turn)
    if where is None:
        return None
    return (
        f"{steps} positions over {turn:g} turns fall {where}, of {design.periodicity}"
        " pitches a turn: they do not spread over the pitch, error and mean stresses"
        " are not those of the passage of a tooth; accepted without this warning:"
        f" --steps {spreading_steps(design, steps, turn)}"
    )


def overload(design: Design, torque: float) -> str | None:
    """What a torque is in rated ones, if it is beyond any strain wave gear [N·m]."""
    rated = ratings_of(design).rated_torque
    times = abs(torque) / rated
    if times < OVERLOAD:
        return None
    return f"{torque:g} N·m is {times:.4g} x the rated torque of {rated:g} N·m"

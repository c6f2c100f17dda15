r"""Phases of the input positions of a meshing simulation within the tooth pitch.

A perfect drive repeats after an input rotation of :math:`2\pi/z`, where z is the number
of teeth of the fixed member (of the input member if the wave generator is fixed). If t
turns are divided into N positions, position k = 0 to N - 1 has the phase

.. math:: \varphi_k = k\,t z/N \bmod 1 .

If t z and N have a large common divisor, many positions share one phase. With 162
teeth, for example, nine positions over half a turn are nine pitches apart and therefore
equivalent. Extremes and means then describe that phase, not the passage of a tooth.
"""

from __future__ import annotations

import numpy as np

from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array

STEPS = 35
"""Number of input positions in the thesis (section 3.4.5); the default number if these
positions spread over the pitch."""
ENOUGH = 5
"""Smallest number of phases that resolves the passage of a tooth: gaps between
neighbouring phases must not exceed one pitch divided by this number."""
LOOSE = 1.5
"""Largest gap in multiples of the equal spacing if there are fewer positions than
:data:`ENOUGH` [-]."""
OVERLOAD = 10.0
"""Multiple of the rated torque at which strain wave gears have already ratcheted, so
that a larger torque is probably a mistake [-]."""
_ROUND_OFF = 1e-6  # tolerance of a phase [pitches]


def phases_of(design: Design, steps: int, turn: float) -> Array:
    """Phases of all positions within a pitch, sorted and without duplicates [pitches].

    Args:
        design: The drive.
        steps: Number of input positions.
        turn: Rotation of the input [turns].
    """
    way = turn * design.periodicity / steps * np.arange(steps)
    phases = np.sort((way + 0.5 * _ROUND_OFF) % 1.0)
    return np.asarray(phases[np.diff(phases, prepend=-1.0) > _ROUND_OFF])


def spreads(design: Design, steps: int, turn: float) -> bool:
    """Whether the positions spread over the pitch or closely follow a part of it.

    Positions spread if no gap between neighbouring phases exceeds a fifth of a pitch;
    the gaps between fewer than five positions may reach 1.5 times the equal spacing.
    Successive positions at most a fifth of a pitch apart follow the motion itself and
    are always accepted.

    Args:
        design: The drive.
        steps: Number of input positions.
        turn: Rotation of the input [turns].
    """
    if abs(turn) * design.periodicity / steps <= 1.0 / ENOUGH:
        return True
    phases = phases_of(design, steps, turn)
    widest = float(np.diff(phases, append=phases[0] + 1.0).max())
    allowed = 1.0 / ENOUGH if steps >= ENOUGH else LOOSE / steps
    return widest <= allowed + 2.0 * _ROUND_OFF


def spreading_steps(design: Design, steps: int, turn: float) -> int:
    """Nearest number of positions that spread over the pitch; the larger one in a tie.

    Args:
        design: The drive.
        steps: Number of positions from which the search starts.
        turn: Rotation of the input [turns].
    """
    for apart in range(steps + int(ENOUGH * abs(turn) * design.periodicity) + 2):
        for wanted in (steps + apart, steps - apart):
            if wanted >= 1 and spreads(design, wanted, turn):
                return wanted
    raise AssertionError("positions a fifth of a pitch apart are accepted")


def default_steps(design: Design, turn: float) -> int:
    """Default number of positions: 35 or the nearest that spreads over the pitch.

    Args:
        design: The drive.
        turn: Rotation of the input [turns].
    """
    return spreading_steps(design, STEPS, turn)


def unspread(design: Design, steps: int, turn: float) -> str | None:
    """Text that reports how few phases the positions have; None if they spread.

    Args:
        design: The drive.
        steps: Number of input positions.
        turn: Rotation of the input [turns].
    """
    if spreads(design, steps, turn):
        return None
    count = len(phases_of(design, steps, turn))
    return f"on {count} tooth phase" + "s" * (count > 1)


def alike(design: Design, steps: int, turn: float) -> str | None:
    """Warning that the positions do not resolve a tooth's passage; None if they do.

    Args:
        design: The drive.
        steps: Number of input positions.
        turn: Rotation of the input [turns].
    """
    where = unspread(design, steps, turn)
    if where is None:
        return None
    return (
        f"{steps} positions over {turn:g} turns, with {design.periodicity} pitches per"
        f" turn, fall {where}: they do not spread over the pitch, so the output error"
        " and the mean stresses do not describe the passage of a tooth; to spread them,"
        f" use --steps {spreading_steps(design, steps, turn)}"
    )


def overload(design: Design, torque: float) -> str | None:
    """Text that compares an excessive torque with the rated torque.

    Args:
        design: The drive.
        torque: Output torque, of either sign [N·m].

    Returns:
        The text; None for torques below :data:`OVERLOAD` times the rated torque.
    """
    rated = ratings_of(design).rated_torque
    times = abs(torque) / rated
    if times < OVERLOAD:
        return None
    return f"{torque:g} N·m ({times:.4g} times the rated torque of {rated:g} N·m)"

"""Passage of the balls past the lobes of the wave generator."""

from __future__ import annotations

from dataclasses import dataclass

from swgjoint.fe.plane.drive2d import can_halve
from swgjoint.fe.rings.model import ThinRing
from swgjoint.gear.design.design import Design


@dataclass(frozen=True, kw_only=True)
class BallPassage:
    """Periodicity of the positions of the balls relative to the lobes."""

    balls: int
    """Number of balls."""
    per_cage_turn: int
    """Number of periods per turn of the cage relative to the cam. It is the number of
    balls, or twice that number if it is odd, because balls then reach the two lobes
    alternately."""
    per_input_turn: float
    """Number of periods per input turn if the balls roll without slip."""
    carried_as: int
    """Number of periods per input turn that the map uses."""


def ball_passage(design: Design, model: ThinRing) -> BallPassage:
    """Ball passage of a design.

    Args:
        design: The drive.
        model: Thin-ring model of the drive.
    """
    balls = model.bearing.balls
    count = balls * (2 if balls % 2 and can_halve(design, bearing=False) else 1)
    rate = count * model.bearing.cage_share * (1.0 - 1.0 / model.ratio)
    return BallPassage(
        balls=balls,
        per_cage_turn=count,
        per_input_turn=rate,
        carried_as=max(1, round(rate)),
    )

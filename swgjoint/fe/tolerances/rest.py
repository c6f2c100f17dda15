"""The drive with perfect teeth, unloaded and linearised at positions in a pitch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from swgjoint.errors import ComputationError
from swgjoint.fe.common.following import Follower, Unloaded
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import ring_model
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_ring
from swgjoint.fe.tolerances.cycle import pitch_of
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import with_perfect_teeth

PHASES = 4
"""Positions within a pitch: what the errors add varies slowly within one."""
SMALL = 0.01
"""Part of the rated torque of either sign between whose positions an output without
torque stands where clearance leaves it free."""


def perfect_drive(design: Design, model: str = "2d") -> Follower[Any]:
    """All of the drive, its teeth and its axis perfect, without friction."""
    perfect, layout = with_perfect_teeth(design), design.drive.layout
    if model == "3d":
        ring = solid_ring(perfect)
        return SolidContinuation(ring=ring, ratio=design.ratio, layout=layout)
    plane = ring_model(perfect, friction=False, bearing=False)
    return Continuation(model=plane, ratio=design.ratio, layout=layout)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """The drive with perfect teeth at one position, linearised without load.

    Where clearance leaves the output free, that is done at both of its ends.
    """

    state: Any
    """Without load, or under the small torque that takes the clearance up."""
    at: Influence
    opposite: tuple[Any, Influence] | None = None
    """The same under the opposite torque, where the output is free."""

    @property
    def sides(self) -> tuple[tuple[Any, Influence], tuple[Any, Influence]]:
        """State and influence for torques of either sign, positive ones first."""
        first = (self.state, self.at)
        return first, self.opposite or first


def influences(
    design: Design,
    *,
    phases: int = PHASES,
    model: str = "2d",
    tick: Callable[[], None] = lambda: None,
) -> tuple[Follower[Any], list[Rest]]:
    """The drive with perfect teeth, unloaded and linearised at positions in a pitch.

    Errors of its wave generator turn with it, so that all pitches are alike.

    Args:
        design: The drive; errors of its wave generator are kept.
        phases: Positions, equally spaced.
        model: Fidelity, ``2d`` or ``3d``.
        tick: Called after every position.

    Raises:
        ComputationError: If the unloaded drive cannot be solved.
    """
    period, small = pitch_of(design), SMALL * ratings_of(design).rated_torque
    follow = perfect_drive(design, model)
    state = follow.engage(follow.deflect())
    rest = Unloaded(state=state, small=small)
    found = []
    for k in range(phases):
        if k:
            rest = follow.turn_unloaded(rest, period * k / phases)
        elif state.outcome.ok:
            rest = follow.unload(state, small)
        if not rest.state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium without torque and errors:"
                f" {rest.state.outcome.value}"
            )
        up, down = rest.sides or (rest.state, None)
        opposite = None if down is None else (down, follow.influence(down))
        found.append(Rest(state=up, at=follow.influence(up), opposite=opposite))
        tick()
    return follow, found

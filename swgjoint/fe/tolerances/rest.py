"""Drive with perfect teeth, unloaded and linearised at positions within a pitch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import isclose
from typing import Any

from swgjoint.errors import ComputationError
from swgjoint.fe.common.following import Follower, Unloaded
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.equilibrium import map_solver
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.tolerances.cycle import pitch_of
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import with_perfect_teeth
from swgjoint.typing import Array

PHASES = 4
"""Number of positions within a pitch; the effect of errors varies slowly over it."""
SMALL = 0.01
"""Fraction of the rated torque that takes up the clearance [-]. An unloaded output with
clearance is midway between its positions under this torque and its opposite."""


def perfect_drive(
    design: Design,
    model: str = "2d",
    *,
    bearing: bool = True,
    like: SolidSectorModel | None = None,
) -> Follower[Any]:
    """Solver of the whole drive with perfect teeth and axis and without friction.

    Args:
        design: The drive; errors of its wave generator are kept.
        model: Fidelity, ``2d`` or ``3d``.
        bearing: Whether a 2D model includes the bearing of the wave generator, with its
            balls at rest on the cam, in designs for which
            :func:`swgjoint.fe.plane.drive2d.carries_bearing` is true.
        like: See :func:`swgjoint.fe.solid.drive3d.solid_sector_model`.
    """
    perfect, layout = with_perfect_teeth(design), design.drive.layout
    if model == "3d":
        solid = solid_sector_model(perfect, like=like)
        return SolidContinuation(model=solid, ratio=design.ratio, layout=layout)
    plane = sector_model(perfect, friction=False, bearing=bearing, cage_held=True)
    solver = map_solver(plane.lobe_height)
    return Continuation(model=plane, ratio=design.ratio, layout=layout, solver=solver)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """Unloaded drive with perfect teeth at one position, and its linearisation.

    If clearance leaves the output free, the drive is linearised at both ends of the
    clearance.
    """

    state: Any
    """Equilibrium without load, or under the small torque that takes up the clearance.
    """
    at: Influence
    """Influence of the tooth gaps, linearised at this equilibrium."""
    opposite: tuple[Any, Influence] | None = None
    """State and influence under the opposite torque; None if the output is not free."""
    loaded: Mapping[float, tuple[Any, Influence]] = field(default_factory=dict)
    """States and influences under load, by torque [N·m]."""

    def without_load(self, small: float) -> Unloaded[Any]:
        """Equilibrium without load, from which to turn or load the drive.

        Args:
            small: Torque that takes up the clearance [N·m].
        """
        sides = None if self.opposite is None else (self.state, self.opposite[0])
        return Unloaded(state=self.state, small=small, sides=sides)

    @property
    def sides(self) -> tuple[tuple[Any, Influence], tuple[Any, Influence]]:
        """State and influence for positive torques, then those for negative torques."""
        first = (self.state, self.at)
        return first, self.opposite or first

    def near(self, torque: float) -> tuple[Any, Influence]:
        """State and influence from which to superpose errors under a torque [N·m]."""
        return self.loaded.get(torque, self.sides[0 if torque >= 0.0 else 1])

    def under_both_signs(
        self,
        follow: Follower[Any],
        levels: Array,
        tick: Callable[[int], None] = lambda parts: None,
        before: Mapping[float, Any] | None = None,
    ) -> Rest:
        """The position with linearisations under load.

        With some wave generators the contacts change so much between zero and rated
        torque that a drive linearised at zero torque has twenty times the ripple of the
        nonlinear one. If a torque cannot be solved, it and all larger ones of its sign
        are left out. The torque that takes up a clearance needs no second
        linearisation.

        Args:
            follow: Solver of the drive with perfect teeth.
            levels: Magnitudes of the torques, increasing (n,) [N·m].
            tick: Called with the number of torques that are done or left out.
            before: States under these torques [N·m], of another position or of the
                drive without errors, from which to start; None to load the state of
                this position. In 3D, turning takes an eighth of the time.
        """
        starts = self.sides[0][0], self.sides[1][0]
        states = loaded_states(follow, starts, levels, tick, before)
        loaded = dict[float, tuple[Any, Influence]]()
        for torque, state in states:
            side = self.near(torque)
            loaded[torque] = (
                side if state is side[0] else (state, follow.influence(state))
            )
        return replace(self, loaded=loaded)


def loaded_states(
    follow: Follower[Any],
    starts: tuple[Any, ...],
    levels: Array,
    tick: Callable[[int], None] = lambda parts: None,
    before: Mapping[float, Any] | None = None,
    known: Mapping[float, Any] | None = None,
) -> Iterator[tuple[float, Any]]:
    """Equilibria of one position under torques of one sign or of both.

    Args:
        follow: Solver of the drive.
        starts: Equilibria from which to load the drive by positive and, if there is a
            second one, by negative torques. They are not solved again where they have
            one of the torques.
        levels: Magnitudes of the torques, increasing (n,) [N·m].
        tick: Called with the number of torques that are done or left out.
        before: States of other positions by torque, which are turned to this one.
        known: States of this position by torque, which are not solved again.

    Yields:
        Torques [N·m] and states, up to the first failure of each sign.
    """
    angle, known = follow.input_angle(starts[0]), known or {}
    for sign, start in zip((1.0, -1.0), starts, strict=False):
        state = start
        for k, torque in enumerate((sign * levels).tolist()):
            if isclose(start.torque, torque, rel_tol=1e-9):
                state = start
            elif torque in known:
                state = known[torque]
            elif before is not None and torque in before:
                state = follow.to_angle(before[torque], angle)
            else:
                same = [s for s in known.values() if s.torque * sign > 0.0]
                near = min([state, *same], key=lambda s: abs(s.torque - torque))
                state = follow.to_torque(near, torque)
            if not state.outcome.ok:
                tick(levels.size - k)
                break
            yield torque, state
            tick(1)


def influences(
    design: Design,
    *,
    phases: int = PHASES,
    model: str = "2d",
    bearing: bool = True,
    start: Any = None,
    like: SolidSectorModel | None = None,
    tick: Callable[[], None] = lambda: None,
) -> tuple[Follower[Any], list[Rest]]:
    """Unloaded drive with perfect teeth, linearised at positions within a pitch.

    Errors of the wave generator turn with it, so that all pitches are equivalent.

    Args:
        design: The drive; errors of its wave generator are kept.
        phases: Number of positions, equally spaced over a pitch.
        model: Fidelity, ``2d`` or ``3d``.
        bearing: Whether a 2D model includes the bearing of the wave generator, see
            :func:`perfect_drive`.
        start: State close to the first position; None without any.
        like: See :func:`perfect_drive`.
        tick: Called after every position.

    Returns:
        Solver that follows the equilibria of the drive, and its linearised positions.

    Raises:
        ComputationError: If the unloaded drive cannot be solved.
    """
    follow = perfect_drive(design, model, bearing=bearing, like=like)
    positions = []
    for rest in unloaded_positions(follow, design, phases, start):
        up, down = rest.sides or (rest.state, None)
        opposite = None if down is None else (down, follow.influence(down))
        positions.append(Rest(state=up, at=follow.influence(up), opposite=opposite))
        tick()
    return follow, positions


def unloaded_positions(
    follow: Follower[Any], design: Design, phases: int, start: Any = None
) -> Iterator[Unloaded[Any]]:
    """Equilibria of a drive without load at positions within a pitch.

    Args:
        follow: Solver of the drive.
        design: The drive.
        phases: Number of positions, equally spaced over a pitch.
        start: State close to the first position; None without any.

    Raises:
        ComputationError: If the unloaded drive cannot be solved.
    """
    period, small = pitch_of(design), SMALL * ratings_of(design).rated_torque
    rest = None if start is None else follow.unload(start, small)
    if rest is None or not rest.state.outcome.ok:
        state = follow.engage(follow.deflect())
        rest = Unloaded(state=state, small=small)
        if state.outcome.ok:
            rest = follow.unload(state, small)
    for k in range(phases):
        if k:
            rest = follow.turn_unloaded(rest, period * k / phases)
        if not rest.state.outcome.ok:
            raise ComputationError(
                f"{design.drive.name}: no equilibrium without torque and with perfect"
                f" teeth: {rest.state.outcome.value}"
            )
        yield rest

"""Continuation of equilibria in torque and input angle, for 2D and 3D models."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from typing import TYPE_CHECKING, Generic, TypeVar

from swgjoint.errors import Outcome
from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.influence import Influence
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.fe.plane.state import State
    from swgjoint.fe.solid.state import SolidState


HALVINGS = 5
TAKE_UP = 150
"""Hundredths of a pitch over which contact is sought before the output is free."""

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Unloaded(Generic[AnyState]):
    """The drive without torque."""

    state: AnyState
    small: float
    """Torque that takes up the clearance [N·m]."""
    sides: tuple[AnyState, AnyState] | None = None
    """States under that torque and its opposite, where the output is free."""


class Follower(ABC, Generic[AnyState]):
    """Follows equilibria; halves a step that fails."""

    ratio: float
    """Signed i."""

    @property
    @abstractmethod
    def teeth(self) -> int:
        """Number of teeth of the flexspline."""

    @abstractmethod
    def input_angle(self, state: AnyState) -> float:
        """Theta [rad]."""

    @abstractmethod
    def input_torque(self, state: AnyState) -> float:
        """External torque on the input [N·m]."""

    @abstractmethod
    def output_angle(self, state: AnyState) -> float:
        """Psi [rad]."""

    @abstractmethod
    def deflect(self, angle: float = 0.0) -> AnyState:
        """Wave generator in place, members at the ideal ratio, no tooth contact."""

    @abstractmethod
    def load(self, start: AnyState, torque: float, angle: float) -> AnyState:
        """Equilibrium under a torque, from a start with its input at that angle."""

    @abstractmethod
    def hold_output(self, state: AnyState) -> AnyState:
        """Equilibrium with the output where it is; the torque is what that takes."""

    @abstractmethod
    def predict(self, state: AnyState, angle: float) -> AnyState:
        """Predictor: input and output turned by the ideal ratio."""

    @abstractmethod
    def rotate_output(self, state: AnyState, output: float) -> AnyState:
        """Predictor: the output turned at a fixed input."""

    def predicted_changes(
        self, state: AnyState, low: float, high: float
    ) -> ContactChanges | None:
        """Changes of contact over the torque that an equilibrium predicts, if any.

        Args:
            state: The equilibrium.
            low: Smallest torque of interest [N·m].
            high: Largest one [N·m].
        """
        return None

    @abstractmethod
    def influence(self, state: AnyState) -> Influence:
        """How the gap of every tooth acts on the output, at an equilibrium."""

    @abstractmethod
    def with_errors(
        self, flexspline: Array, circular_spline: Array, tilt: Array
    ) -> Follower[AnyState]:
        """The same drive with errors of its teeth and of its axis.

        Args:
            flexspline: Shifts of its teeth in their frames (N, 2) [m].
            circular_spline: The same of the other member (N_c, 2) [m].
            tilt: Slope of the axis of the circular spline over z (2,) [rad].
        """

    def engage(self, deflected: AnyState) -> AnyState:
        """Teeth in contact, no member rotated; the torque is what that takes."""
        return self.hold_output(deflected)

    def to_torque(self, state: AnyState, torque: float) -> AnyState:
        """Change the torque at a fixed input; the last good state if stuck.

        Where torque control fails (a load through the clearance of the teeth, or far
        from contact), the output is turned against the teeth first.
        """
        angle = self.input_angle(state)

        def loaded(start: AnyState) -> AnyState:
            def step(s: AnyState, part: float) -> AnyState:
                load = start.torque + part * (torque - start.torque)
                return self.load(s, load, angle)

            return follow(start, step)

        if torque == 0.0 or not is_free(state):
            found = loaded(state)
            if found.outcome.ok or torque == 0.0:
                return found
        against = self._taken_up(state, torque)
        return loaded(against) if against.outcome.ok else against

    def to_angle(self, state: AnyState, angle: float) -> AnyState:
        """Turn the input at constant torque.

        An output that is free in the clearance of the teeth keeps its place in it; a
        position that is out of reach is approached again from the undeformed drive.
        """
        first = self.input_angle(state)

        def step(s: AnyState, part: float) -> AnyState:
            theta = first + part * (angle - first)
            return self.load(self.predict(s, theta), state.torque, theta)

        if is_free(state):
            return self.hold_output(self.predict(state, angle))
        found = follow(state, step)
        if found.outcome.ok:
            return found
        if state.torque == 0.0 and found.outcome is Outcome.SINGULAR:
            return self.hold_output(self.predict(state, angle))
        again = self.hold_output(self.deflect(angle))
        if again.outcome.ok:
            again = self.to_torque(again, state.torque)
        return again if again.outcome.ok else found

    def unload(self, state: AnyState, small: float) -> Unloaded[AnyState]:
        """Equilibrium without torque at a fixed input.

        Where clearance leaves the output free it stands in the middle of its positions
        at the torques +-``small`` [N·m].
        """
        if not is_free(state):
            found = self.to_torque(state, 0.0)
            if found.outcome is not Outcome.SINGULAR:
                return Unloaded(state=found, small=small)
        sides = self.to_torque(state, small), self.to_torque(state, -small)
        return self._between(sides, small)

    def turn_unloaded(
        self, unloaded: Unloaded[AnyState], angle: float
    ) -> Unloaded[AnyState]:
        """Turn the input without torque."""
        small = unloaded.small
        if unloaded.sides is not None:
            up, down = unloaded.sides
            return self._between(
                (self.to_angle(up, angle), self.to_angle(down, angle)), small
            )
        found = self.to_angle(unloaded.state, angle)
        if found.outcome.ok and is_free(found):
            return self.unload(found, small)
        return Unloaded(state=found, small=small)

    def _between(
        self, sides: tuple[AnyState, AnyState], small: float
    ) -> Unloaded[AnyState]:
        for side in sides:
            if not side.outcome.ok:
                return Unloaded(state=side, small=small)
        middle = 0.5 * sum(self.output_angle(side) for side in sides)
        found = replace(
            self.hold_output(self.rotate_output(sides[0], middle)), torque=0.0
        )
        return Unloaded(state=found, small=small, sides=sides)

    def _taken_up(self, state: AnyState, torque: float) -> AnyState:
        """Turn the output until the teeth resist with a part of a torque."""
        pitch = 2.0 * pi / self.teeth
        first = self.output_angle(state)
        direction = -1.0 if torque > 0.0 else 1.0
        apart = 0.0
        found = state
        for k in range(1, TAKE_UP + 1):
            found = self.hold_output(
                self.rotate_output(found, first + direction * k * pitch / 100)
            )
            if not found.outcome.ok:
                return found
            if not is_free(found) and found.torque * torque > 0.0:
                break
            apart = k * pitch / 100
        else:
            return replace(found, outcome=Outcome.SINGULAR)
        reached = abs(self.output_angle(found) - first)
        for _ in range(HALVINGS):
            if abs(found.torque) <= abs(torque):
                break
            middle = 0.5 * (apart + reached)
            tried = self.hold_output(
                self.rotate_output(found, first + direction * middle)
            )
            held = tried.outcome.ok and not is_free(tried)
            if held and tried.torque * torque > 0.0:
                found, reached = tried, middle
            else:
                apart = middle
        return found


def is_free(state: AnyState) -> bool:
    """Whether no tooth holds the output."""
    return len(state.tooth_force) == 0

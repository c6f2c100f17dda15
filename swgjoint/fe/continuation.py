"""Following equilibria in torque and input angle, in any layout."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi

from swgjoint.errors import Outcome
from swgjoint.fe.equilibrium import Load, NewtonSolver
from swgjoint.fe.following import HALVINGS, follow
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.gear.kinematics import Layout

TAKE_UP = 150
"""Hundredths of a pitch over which contact is sought before the output is free."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Unloaded:
    """The drive without torque."""

    state: State
    small: float
    """Torque that takes up the clearance [N·m]."""
    sides: tuple[State, State] | None = None
    """States under that torque and its opposite, where the output is free."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Continuation:
    """Follows equilibria; halves a step that fails.

    With the circular spline fixed the flexspline is the output and turns freely. In the
    other layouts the circular spline is the output; the rotation of the flexspline is
    prescribed: zero, or, with the wave generator fixed, the input.
    """

    model: RingModel
    ratio: float
    layout: Layout = "circular_spline_fixed"
    solver: NewtonSolver = field(default_factory=NewtonSolver)

    @property
    def ring_is_output(self) -> bool:
        """Whether the circular spline turns."""
        return self.layout != "circular_spline_fixed"

    def input_angle(self, state: State) -> float:
        """Theta [rad]."""
        if self.layout == "wave_generator_fixed":
            return state.rotation
        return state.wave_generator_angle

    def input_torque(self, state: State) -> float:
        """External torque on the input [N·m]."""
        if self.layout == "wave_generator_fixed":
            return state.holding_torque
        return state.wave_generator_torque

    def output_angle(self, state: State) -> float:
        """Psi [rad]."""
        return state.ring_rotation if self.ring_is_output else state.rotation

    def deflected(self, angle: float = 0.0) -> State:
        """Wave generator in place, members at the ideal ratio, no tooth contact."""
        alpha, rotation, ring_rotation = self._ideal(angle)
        start = self.model.at_rest(alpha, rotation)
        load = Load(rotation=rotation, teeth=False)
        state = self.solver(self.model, start, load)
        return replace(state, ring_rotation=ring_rotation)

    def meshed(self, deflected: State) -> State:
        """Teeth in contact, no member rotated; the torque is what that takes."""
        return self._held(deflected)

    def to_torque(self, state: State, torque: float) -> State:
        """Change the torque at a fixed input; the last good state if stuck.

        Where torque control fails (a load through the clearance of the teeth, or far
        from contact), the output is turned against the teeth first.
        """
        angle = self.input_angle(state)

        def loaded(start: State) -> State:
            def step(s: State, part: float) -> State:
                load = start.torque + part * (torque - start.torque)
                return self.solver(self.model, s, self._load(load, angle))

            return follow(start, step)

        if torque == 0.0 or not _is_free(state):
            found = loaded(state)
            if found.outcome.ok or torque == 0.0:
                return found
        against = self._taken_up(state, torque)
        return loaded(against) if against.outcome.ok else against

    def to_angle(self, state: State, angle: float) -> State:
        """Turn the input at constant torque.

        An output that is free in the clearance of the teeth keeps its place in it; a
        position that is out of reach is approached again from the undeformed drive.
        """
        first = self.input_angle(state)

        def step(s: State, part: float) -> State:
            theta = first + part * (angle - first)
            guess = self._ahead(s, theta)
            return self.solver(self.model, guess, self._load(state.torque, theta))

        if _is_free(state):
            return self._held(self._ahead(state, angle))
        found = follow(state, step)
        if found.outcome.ok:
            return found
        if state.torque == 0.0 and found.outcome is Outcome.SINGULAR:
            return self._held(self._ahead(state, angle))
        again = self._held(self.deflected(angle))
        if again.outcome.ok:
            again = self.to_torque(again, state.torque)
        return again if again.outcome.ok else found

    def unloaded(self, state: State, small: float) -> Unloaded:
        """Equilibrium without torque at a fixed input.

        Where clearance leaves the output free it stands in the middle of its positions
        at the torques +-``small`` [N·m].
        """
        if not _is_free(state):
            found = self.to_torque(state, 0.0)
            if found.outcome is not Outcome.SINGULAR:
                return Unloaded(state=found, small=small)
        sides = self.to_torque(state, small), self.to_torque(state, -small)
        return self._between(sides, small)

    def unloaded_to(self, unloaded: Unloaded, angle: float) -> Unloaded:
        """Turn the input without torque."""
        small = unloaded.small
        if unloaded.sides is not None:
            up, down = unloaded.sides
            return self._between(
                (self.to_angle(up, angle), self.to_angle(down, angle)), small
            )
        found = self.to_angle(unloaded.state, angle)
        if found.outcome.ok and _is_free(found):
            return self.unloaded(found, small)
        return Unloaded(state=found, small=small)

    def _between(self, sides: tuple[State, State], small: float) -> Unloaded:
        for side in sides:
            if not side.outcome.ok:
                return Unloaded(state=side, small=small)
        middle = 0.5 * sum(self.output_angle(side) for side in sides)
        found = replace(self._held(self._turned(sides[0], middle)), torque=0.0)
        return Unloaded(state=found, small=small, sides=sides)

    def _taken_up(self, state: State, torque: float) -> State:
        """Turn the output until the teeth resist with a part of a torque."""
        pitch = 2.0 * pi / self.model.element.sectors
        first = self.output_angle(state)
        direction = -1.0 if torque > 0.0 else 1.0
        apart = 0.0
        found = state
        for k in range(1, TAKE_UP + 1):
            found = self._held(self._turned(found, first + direction * k * pitch / 100))
            if not found.outcome.ok:
                return found
            if not _is_free(found) and found.torque * torque > 0.0:
                break
            apart = k * pitch / 100
        else:
            return replace(found, outcome=Outcome.SINGULAR)
        reached = abs(self.output_angle(found) - first)
        for _ in range(HALVINGS):
            if abs(found.torque) <= abs(torque):
                break
            middle = 0.5 * (apart + reached)
            tried = self._held(self._turned(found, first + direction * middle))
            held = tried.outcome.ok and not _is_free(tried)
            if held and tried.torque * torque > 0.0:
                found, reached = tried, middle
            else:
                apart = middle
        return found

    def _held(self, state: State) -> State:
        """Equilibrium with the output where it is; the torque is what that takes."""
        found = self.solver(self.model, state, Load(rotation=state.rotation))
        if self.ring_is_output:
            return replace(found, torque=-found.tooth_moment)
        return found

    def _turned(self, state: State, output: float) -> State:
        """Predictor: the output turned at a fixed input."""
        alpha = state.wave_generator_angle
        if self.ring_is_output:
            return self.model.moved(state, alpha, state.rotation, output)
        return self.model.moved(state, alpha, output, state.ring_rotation)

    def _ideal(self, theta: float) -> tuple[float, float, float]:
        """Angles of wave generator, flexspline and circular spline."""
        output = theta / self.ratio
        if self.layout == "circular_spline_fixed":
            return theta, output, 0.0
        if self.layout == "flexspline_fixed":
            return theta, 0.0, output
        return 0.0, theta, output

    def _load(self, torque: float, theta: float) -> Load:
        if not self.ring_is_output:
            return Load(torque=torque)
        held = theta if self.layout == "wave_generator_fixed" else 0.0
        return Load(torque=torque, rotation=held)

    def _ahead(self, state: State, theta: float) -> State:
        """Predictor: input and output turned by the ideal ratio."""
        was, now = self._ideal(self.input_angle(state)), self._ideal(theta)
        alpha, rotation, ring_rotation = (y - x for x, y in zip(was, now, strict=True))
        return self.model.moved(
            state,
            state.wave_generator_angle + alpha,
            state.rotation + rotation,
            state.ring_rotation + ring_rotation,
        )


def _is_free(state: State) -> bool:
    """Whether no tooth holds the output."""
    return len(state.tooth_force) == 0

"""Following equilibria in torque and input angle, in any layout."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from swgjoint.errors import Outcome
from swgjoint.fe.equilibrium import Load, NewtonSolver
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State
from swgjoint.gear.kinematics import Layout

HALVINGS = 5

_Step = Callable[[State, float, State], State]


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

    def deflected(self) -> State:
        """Wave generator in place, no tooth contact, no rotation."""
        return self.solver(
            self.model, self.model.at_rest(), Load(rotation=0.0, teeth=False)
        )

    def meshed(self, deflected: State) -> State:
        """Teeth in contact, no member rotated; the torque is what that takes."""
        state = self.solver(self.model, deflected, Load(rotation=0.0))
        if self.ring_is_output:
            return replace(state, torque=-state.tooth_moment)
        return state

    def to_torque(self, state: State, torque: float) -> State:
        """Change the torque at a fixed input; the last good state if stuck."""
        angle = self.input_angle(state)

        def step(s: State, part: float, start: State) -> State:
            load = start.torque + part * (torque - start.torque)
            return self.solver(self.model, s, self._load(load, angle))

        return self._follow(state, step)

    def to_angle(self, state: State, angle: float) -> State:
        """Turn the input at constant torque."""
        first = self.input_angle(state)

        def step(s: State, part: float, start: State) -> State:
            theta = first + part * (angle - first)
            guess = self._ahead(s, theta)
            return self.solver(self.model, guess, self._load(start.torque, theta))

        return self._follow(state, step)

    def _load(self, torque: float, theta: float) -> Load:
        if not self.ring_is_output:
            return Load(torque=torque)
        held = theta if self.layout == "wave_generator_fixed" else 0.0
        return Load(torque=torque, rotation=held)

    def _ahead(self, state: State, theta: float) -> State:
        """Predictor: input and output turned by the ideal ratio."""
        turn = theta - self.input_angle(state)
        output = self.output_angle(state) + turn / self.ratio
        if self.layout == "circular_spline_fixed":
            return self.model.moved(state, theta, output, 0.0)
        if self.layout == "flexspline_fixed":
            return self.model.moved(state, theta, state.rotation, output)
        return self.model.moved(state, state.wave_generator_angle, theta, output)

    def _follow(self, state: State, step: _Step) -> State:
        """Go from part 0 to 1 of a change; a failed try halves the increment."""
        current, done, increment = state, 0.0, 1.0
        while done < 1.0:
            target = min(1.0, done + increment)
            tried = step(current, target, state)
            if tried.outcome.ok:
                current, done = tried, target
            elif increment <= 0.5**HALVINGS:
                return replace(current, outcome=tried.outcome, history=tried.history)
            else:
                increment *= 0.5
        return replace(current, outcome=Outcome.CONVERGED)

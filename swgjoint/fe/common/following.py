"""Continuation of equilibria over torque and input angle, for 2D and 3D models."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from math import pi
from typing import ClassVar, Generic

from swgjoint.errors import Outcome
from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.increments import HALVINGS, follow
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.common.layout_angles import AnyState, LayoutAngles
from swgjoint.typing import Array

TAKE_UP = 150
"""Largest rotation of the output in search of contact, in hundredths of a pitch [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Unloaded(Generic[AnyState]):
    """Equilibrium of the drive without torque."""

    state: AnyState
    """The equilibrium; an output that is free is midway between ``sides``."""
    small: float
    """Torque that takes up the clearance [N·m]."""
    sides: tuple[AnyState, AnyState] | None = None
    """States under that torque and its opposite; None if the output is not free."""


_FREE_OR_ALTERNATING = (
    Outcome.SINGULAR,
    Outcome.ACTIVE_SET_CYCLES,
    Outcome.MAX_ITERATIONS,
)
"""Outcomes of an unloaded drive whose output may be free in a clearance."""


class Follower(ABC, LayoutAngles[AnyState]):
    """Continuation of equilibria, with halved steps where a solve fails."""

    loads_free_output: ClassVar[bool] = False
    """Whether :meth:`load` turns a free output until its teeth resist."""

    @property
    @abstractmethod
    def teeth(self) -> int:
        """Number of teeth of the flexspline."""

    @abstractmethod
    def deflect(self, angle: float = 0.0) -> AnyState:
        """Rim deflected at the ideal member angles, without tooth contact.

        Args:
            angle: Input angle [rad].
        """

    @abstractmethod
    def load(self, start: AnyState, torque: float, angle: float) -> AnyState:
        """Equilibrium under an output torque.

        Args:
            start: State from which the search starts, with its input at ``angle``.
            torque: Output torque T [N·m].
            angle: Input angle [rad].
        """

    def load_from_afar(self, start: AnyState, torque: float, angle: float) -> AnyState:
        """Equilibrium like that of :meth:`load`, as accurate as from a near start.

        Args:
            start: State from which the search starts, with its input at ``angle``.
            torque: Output torque T [N·m].
            angle: Input angle [rad].
        """
        return self.load(start, torque, angle)

    @abstractmethod
    def hold_output(self, state: AnyState) -> AnyState:
        """Equilibrium with the output held in place; the torque is a result."""

    @abstractmethod
    def move(
        self,
        state: AnyState,
        alpha: float,
        rotation: float,
        circular_spline_rotation: float,
    ) -> AnyState:
        """State at other angles; its displacement field stays on the wave generator.

        Args:
            state: State to start from.
            alpha: New angle of the wave generator [rad].
            rotation: New rotation of the flexspline [rad].
            circular_spline_rotation: New rotation of the circular spline [rad].
        """

    def predict(self, state: AnyState, angle: float) -> AnyState:
        """Predicted state after input and output have turned by the ideal ratio.

        Args:
            state: State to start from.
            angle: New input angle [rad].
        """
        was, now = self.ideal_angles(self.input_angle(state)), self.ideal_angles(angle)
        alpha, rotation, circular_spline_rotation = (
            y - x for x, y in zip(was, now, strict=True)
        )
        return self.move(
            state,
            state.wave_generator_angle + alpha,
            state.rotation + rotation,
            state.circular_spline_rotation + circular_spline_rotation,
        )

    def extrapolate(self, state: AnyState, earlier: AnyState, angle: float) -> AnyState:
        """Start of a search at another input angle, from the trend up to a state.

        Args:
            state: Equilibrium to turn to that angle.
            earlier: Equilibrium under the same torque at an angle before it.
            angle: New input angle [rad].

        Returns:
            The state at its own angle, changed as it will change on the way; the state
            itself if the model has no use for it.
        """
        return state

    def near(self, state: AnyState) -> Follower[AnyState]:
        """Solver for equilibria close to a given one, from whose tangent they start.

        Args:
            state: The equilibrium.

        Returns:
            The solver; this one if the model has no use for such a tangent.
        """
        return self

    def rotate_output(self, state: AnyState, output: float) -> AnyState:
        """Predicted state after the output has turned at a fixed input.

        Args:
            state: State to start from.
            output: New output angle [rad].
        """
        alpha = state.wave_generator_angle
        if self.circular_spline_is_output:
            return self.move(state, alpha, state.rotation, output)
        return self.move(state, alpha, output, state.circular_spline_rotation)

    def predicted_changes(
        self, state: AnyState, low: float, high: float
    ) -> ContactChanges | None:
        """Contact changes over a torque range that an equilibrium predicts.

        Args:
            state: The equilibrium.
            low: Smallest torque of interest [N·m].
            high: Largest torque of interest [N·m].

        Returns:
            The changes; None without a prediction.
        """
        return None

    def mirror(self, state: AnyState) -> AnyState | None:
        """Mirror image of an equilibrium, at the opposite input angle and torque.

        It is an equilibrium of a drive without errors whose wave generator has mirror
        symmetry.

        Args:
            state: The equilibrium.

        Returns:
            The mirror image; None if this model does not provide it.
        """
        return None

    @abstractmethod
    def influence(self, state: AnyState) -> Influence:
        """Influence of every tooth gap on the output, linearised at an equilibrium."""

    @abstractmethod
    def with_errors(
        self, flexspline: Array, circular_spline: Array, tilt: Array
    ) -> Follower[AnyState]:
        """The same drive with manufacturing errors of its teeth and its axis.

        Args:
            flexspline: Shifts of the flexspline's N teeth in their frames (N, 2) [m].
            circular_spline: Shifts of the circular spline's N_c teeth in their frames
                (N_c, 2) [m].
            tilt: Slope of the circular spline's axis in x and y per length along z
                (2,) [rad].
        """

    def engage(self, deflected: AnyState) -> AnyState:
        """Equilibrium with tooth contact at the same angles; the torque is a result."""
        return self.hold_output(deflected)

    def to_torque(self, state: AnyState, torque: float) -> AnyState:
        """Equilibrium under another torque at the same input angle.

        If torque control fails (across the clearance of the teeth, or far from
        contact), the output is first turned until the teeth resist.

        Args:
            state: Equilibrium to start from.
            torque: New output torque [N·m].

        Returns:
            The equilibrium, or a state with the outcome of the failed attempt.
        """
        angle = self.input_angle(state)

        def loaded(start: AnyState) -> AnyState:
            def step(s: AnyState, part: float) -> AnyState:
                load = start.torque + part * (torque - start.torque)
                return self.load(s, load, angle)

            # without a change, smaller increments would repeat the failed solve
            return follow(
                start, step, halvings=HALVINGS if torque != start.torque else 0
            )

        if torque == 0.0 or self.loads_free_output or not is_free(state):
            direct = loaded(state)
            if direct.outcome.ok or torque == 0.0:
                return direct
        against = self._taken_up(state, torque)
        return loaded(against) if against.outcome.ok else against

    def to_angle(self, state: AnyState, angle: float) -> AnyState:
        """Equilibrium at another input angle under the same torque.

        An output that is free in the clearance of the teeth keeps its position within
        the clearance. If an angle cannot be reached from the given state, it is
        approached from the undeformed drive.

        Args:
            state: Equilibrium to start from.
            angle: New input angle [rad].

        Returns:
            The equilibrium, or a state with the outcome of the failed attempt.
        """
        first = self.input_angle(state)

        def step(s: AnyState, part: float) -> AnyState:
            theta = first + part * (angle - first)
            return self.load(self.predict(s, theta), state.torque, theta)

        if is_free(state):
            return self.hold_output(self.predict(state, angle))
        turned = follow(state, step)
        if turned.outcome.ok:
            return turned
        if state.torque == 0.0 and turned.outcome is Outcome.SINGULAR:
            return self.hold_output(self.predict(state, angle))
        again = self.hold_output(self.deflect(angle))
        if again.outcome.ok:
            again = self.to_torque(again, state.torque)
        return again if again.outcome.ok else turned

    def to_position(self, state: AnyState, torque: float, angle: float) -> AnyState:
        """Equilibrium under another torque at another input angle, without friction.

        Torque and angle change at once, which takes half of the solves. If that fails,
        the torque changes first.

        Args:
            state: Equilibrium to start from.
            torque: New output torque, not zero [N·m].
            angle: New input angle [rad].

        Returns:
            The equilibrium, or a state with the outcome of the failed attempt.
        """
        if not is_free(state):
            reached = self.load_from_afar(self.predict(state, angle), torque, angle)
            if reached.outcome.ok:
                return reached
        loaded = self.to_torque(state, torque)
        return self.to_angle(loaded, angle) if loaded.outcome.ok else loaded

    def unload(self, state: AnyState, small: float) -> Unloaded[AnyState]:
        """Equilibrium without torque at the same input angle.

        An output that is free in the clearance is placed midway between its positions
        under the torques +-``small``. Within a clearance that is much narrower than the
        deflection under these torques, the contacts may alternate without end, and the
        output is placed in the same way.

        Args:
            state: Equilibrium to start from.
            small: Torque that takes up the clearance [N·m].
        """
        if not is_free(state):
            unloaded = self.to_torque(state, 0.0)
            if unloaded.outcome not in _FREE_OR_ALTERNATING:
                return Unloaded(state=unloaded, small=small)
        sides = self.to_torque(state, small), self.to_torque(state, -small)
        return self._between(sides, small)

    def turn_unloaded(
        self, unloaded: Unloaded[AnyState], angle: float
    ) -> Unloaded[AnyState]:
        """Equilibrium without torque at another input angle.

        Args:
            unloaded: Equilibrium without torque to start from.
            angle: New input angle [rad].
        """
        small = unloaded.small
        if unloaded.sides is not None:
            up, down = unloaded.sides
            return self._between(
                (self.to_angle(up, angle), self.to_angle(down, angle)), small
            )
        turned = self.to_angle(unloaded.state, angle)
        if turned.outcome.ok and is_free(turned):
            return self.unload(turned, small)
        return Unloaded(state=turned, small=small)

    def _between(
        self, sides: tuple[AnyState, AnyState], small: float
    ) -> Unloaded[AnyState]:
        """Equilibrium midway between the states at both ends of the clearance."""
        for side in sides:
            if not side.outcome.ok:
                return Unloaded(state=side, small=small)
        middle = 0.5 * sum(self.output_angle(side) for side in sides)
        centred = replace(
            self.hold_output(self.rotate_output(sides[0], middle)), torque=0.0
        )
        return Unloaded(state=centred, small=small, sides=sides)

    def _taken_up(self, state: AnyState, torque: float) -> AnyState:
        """State whose output has turned until the teeth resist.

        Bisection lowers the resisting torque towards the given one from above.
        """
        pitch = 2.0 * pi / self.teeth
        first = self.output_angle(state)
        direction = -1.0 if torque > 0.0 else 1.0
        # step by hundredths of a pitch until the teeth resist
        apart = 0.0
        resisted = state
        for k in range(1, TAKE_UP + 1):
            resisted = self._turned_to(resisted, first + direction * k * pitch / 100)
            if not resisted.outcome.ok:
                return resisted
            if not is_free(resisted) and resisted.torque * torque > 0.0:
                break
            apart = k * pitch / 100
        else:
            return replace(resisted, outcome=Outcome.SINGULAR)
        # bisect until the torque is not larger than required
        reached = abs(self.output_angle(resisted) - first)
        for _ in range(HALVINGS):
            if abs(resisted.torque) <= abs(torque):
                break
            middle = 0.5 * (apart + reached)
            nearer = self._turned_to(resisted, first + direction * middle)
            held = nearer.outcome.ok and not is_free(nearer)
            if held and nearer.torque * torque > 0.0:
                resisted, reached = nearer, middle
            else:
                apart = middle
        return resisted

    def _turned_to(self, state: AnyState, output: float) -> AnyState:
        """Equilibrium with the output held at another angle, reached gradually."""
        first = self.output_angle(state)

        def step(s: AnyState, part: float) -> AnyState:
            angle = first + part * (output - first)
            return self.hold_output(self.rotate_output(s, angle))

        return follow(state, step)


def is_free(state: AnyState) -> bool:
    """Whether no tooth holds the output."""
    return len(state.tooth_force) == 0

"""Continuation of equilibria of the 2D model in all three layouts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.following import Follower
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.plane.contact_prediction import predicted_changes
from swgjoint.fe.plane.equilibrium import NewtonSolver
from swgjoint.fe.plane.newton_step import Load
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.tolerances.influence import influence
from swgjoint.gear.kinematics import Layout
from swgjoint.typing import Array

SETTLE = 10
"""Number of updates per linearisation that settle the contact of a bore. With them and
whole steps, all of 358 random designs found an equilibrium, but some take three times
as long."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Continuation(Follower[State]):
    """Continuation of equilibria of the 2D model.

    If the circular spline is fixed, the flexspline is the output and turns freely. In
    the other layouts the circular spline is the output and the rotation of the
    flexspline is prescribed: it is zero if the flexspline is fixed, and the input angle
    if the wave generator is fixed.
    """

    model: SectorModel
    """The 2D model."""
    ratio: float
    """Signed gear ratio i [-]."""
    layout: Layout = "circular_spline_fixed"
    """Which member is fixed."""
    solver: NewtonSolver = field(default_factory=NewtonSolver)
    """Solver of the equilibria."""

    @property
    def teeth(self) -> int:
        """Number of teeth of the flexspline."""
        return self.model.element.sectors

    def deflect(self, angle: float = 0.0) -> State:
        """Rim deflected at the ideal member angles, without tooth contact.

        Args:
            angle: Input angle [rad].
        """
        alpha, rotation, circular_spline_rotation = self.ideal_angles(angle)
        start = self.model.initial_guess(alpha, rotation)
        load = Load(rotation=rotation, teeth=False)
        state = self.solver(self.model, start, load)
        if not state.outcome.ok:
            # a rim that sticks where it will lift off may snap away in the next step
            settling = replace(
                self.solver, exchanges=SETTLE, exchange_below=np.inf, stride=1.0
            )
            settled = settling(self.model, start, load)
            # without teeth, a race with play rests nowhere, but is a good start
            state = settled if settled.outcome.ok else state
        return replace(state, circular_spline_rotation=circular_spline_rotation)

    def load(self, start: State, torque: float, angle: float) -> State:
        """Equilibrium under an output torque.

        Args:
            start: State from which the search starts, with its input at ``angle``.
            torque: Output torque T [N·m].
            angle: Input angle [rad].
        """
        if not self.circular_spline_is_output:
            return self.solver(self.model, start, Load(torque=torque))
        held = angle if self.layout == "wave_generator_fixed" else 0.0
        return self.solver(self.model, start, Load(torque=torque, rotation=held))

    def load_from_afar(self, start: State, torque: float, angle: float) -> State:
        """Equilibrium like that of :meth:`load`, as accurate as from a near start.

        The tolerances of maps suit near starts, whose last increment is far smaller.

        Args:
            start: State from which the search starts, with its input at ``angle``.
            torque: Output torque T [N·m].
            angle: Input angle [rad].
        """
        solver = self.solver
        closest = min(solver.step_tolerance, solver.conforming_tolerance)
        careful = replace(solver, step_tolerance=closest)
        return replace(self, solver=careful).load(start, torque, angle)

    def hold_output(self, state: State) -> State:
        """Equilibrium with the output held in place; the torque is a result."""
        held = self.solver(self.model, state, Load(rotation=state.rotation))
        if self.circular_spline_is_output:
            return replace(held, torque=-held.tooth_moment)
        return held

    def move(
        self,
        state: State,
        alpha: float,
        rotation: float,
        circular_spline_rotation: float,
    ) -> State:
        """State at other angles; its displacement field stays on the wave generator.

        Args:
            state: State to start from.
            alpha: New angle of the wave generator [rad].
            rotation: New rotation of the flexspline [rad].
            circular_spline_rotation: New rotation of the circular spline [rad].
        """
        return self.model.predict_field(
            state, alpha, rotation, circular_spline_rotation
        )

    def predicted_changes(
        self, state: State, low: float, high: float
    ) -> ContactChanges | None:
        """Contact changes over a torque range, predicted from one equilibrium.

        The result is None where no prediction is possible, see
        :func:`swgjoint.fe.plane.contact_prediction.predicted_changes`.

        Args:
            state: The equilibrium.
            low: Smallest torque of interest [N·m].
            high: Largest torque of interest [N·m].
        """
        return predicted_changes(
            self.model,
            state,
            circular_spline_is_output=self.circular_spline_is_output,
            low=low,
            high=high,
        )

    def influence(self, state: State) -> Influence:
        """Influence of every tooth gap on the output, linearised at an equilibrium.

        The model must be that of the whole drive, without friction and without tooth
        errors. Balls of a bearing keep their state: pressed or free.
        """
        return influence(
            self.model, state, circular_spline_is_output=self.circular_spline_is_output
        )

    def with_errors(
        self, flexspline: Array, circular_spline: Array, tilt: Array
    ) -> Continuation:
        """The same continuation for a drive with manufacturing errors of its teeth.

        Args:
            flexspline: Shifts of its teeth in their frames (N, 2) [m].
            circular_spline: Shifts of its teeth in their frames (N_c, 2) [m].
            tilt: Slope of the axis of the circular spline (2,) [rad]; it must be zero,
                because a 2D model cannot tilt its axes.
        """
        assert not tilt.any()
        model = replace(
            self.model,
            tooth_shift=flexspline,
            circular_spline_tooth_shift=circular_spline,
        )
        return replace(self, model=model)

"""Continuation of equilibria of the 3D model."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi
from typing import ClassVar

import numpy as np

from swgjoint.fe.common.cyclic import SingularCyclicError, shift_rows
from swgjoint.fe.common.following import Follower, is_free
from swgjoint.fe.common.influence import Influence
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.equilibrium import SolidLoad, SolidSolver
from swgjoint.fe.solid.linearise import linearise
from swgjoint.fe.solid.mirror import mirror_state
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.tangent import SolidTangent
from swgjoint.fe.solid.tolerance_influence import influence
from swgjoint.gear.kinematics import Layout
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidContinuation(Follower[SolidState]):
    """Follows equilibria of the 3D model over torque and input angle.

    It is the 3D counterpart of :class:`swgjoint.fe.plane.continuation.Continuation`.
    The rotation of the flexspline is that of the bore of its diaphragm.
    """

    model: SolidSectorModel
    ratio: float
    """Signed gear ratio i [-]."""
    layout: Layout = "circular_spline_fixed"
    """Which of the three members is fixed."""
    solver: SolidSolver = field(default_factory=SolidSolver)
    tangent: SolidTangent | None = None
    """Factorised tangent from which searches under a torque start; None for that of
    their own start."""
    loads_free_output: ClassVar[bool] = True

    @property
    def teeth(self) -> int:
        """Number of teeth of the flexspline."""
        return self.model.strip.sectors

    def deflect(self, angle: float = 0.0) -> SolidState:
        """Equilibrium of the flexspline on the wave generator, without tooth contact.

        Args:
            angle: Input angle [rad]; all members are at the angles of the ideal ratio.
        """
        alpha, rotation, circular_spline_rotation = self.ideal_angles(angle)
        start = self.model.initial_guess(alpha, rotation)
        load = SolidLoad(rotation=rotation, teeth=False)
        state = self.solver(self.model, start, load)
        return replace(state, circular_spline_rotation=circular_spline_rotation)

    def load(self, start: SolidState, torque: float, angle: float) -> SolidState:
        """Equilibrium under a torque at an input angle.

        Args:
            start: State from which the search starts, with its input at ``angle``.
            torque: Torque T of the output on its load [N·m].
            angle: Input angle [rad].
        """
        held = None
        if self.circular_spline_is_output:
            held = angle if self.layout == "wave_generator_fixed" else 0.0
        load = SolidLoad(torque=torque, rotation=held)
        return self.solver(self.model, start, load, self.tangent)

    def hold_output(self, state: SolidState) -> SolidState:
        """Equilibrium with the output fixed at its angle; the torque is a result."""
        fixed = self.solver(self.model, state, SolidLoad(rotation=state.rotation))
        if self.circular_spline_is_output:
            return replace(fixed, torque=-fixed.tooth_moment)
        return fixed

    def near(self, state: SolidState) -> SolidContinuation:
        """Solver for equilibria close to a given one, from whose tangent they start."""
        linear = linearise(self.model, state)
        try:
            return replace(self, tangent=SolidTangent(self.model, linear))
        except SingularCyclicError:
            return self

    def extrapolate(
        self, state: SolidState, earlier: SolidState, angle: float
    ) -> SolidState:
        """Start of a search at another input angle, from the trend up to a state.

        The displacement field on the wave generator changes linearly with the angle.

        Args:
            state: Equilibrium to turn to that angle.
            earlier: Equilibrium under the same torque at an angle before it.
            angle: New input angle [rad].
        """
        if is_free(state) or is_free(earlier):
            return state
        here = self.input_angle(state)
        part = (angle - here) / (here - self.input_angle(earlier))
        return state.extrapolate(self.predict(earlier, here), part)

    def mirror(self, state: SolidState) -> SolidState | None:
        """Mirror image of an equilibrium; None with a race."""
        return None if self.model.race else mirror_state(self.model, state)

    def influence(self, state: SolidState) -> Influence:
        """Influence of every tooth gap on the output, linearised at an equilibrium."""
        return influence(
            self.model, state, circular_spline_is_output=self.circular_spline_is_output
        )

    def with_errors(
        self, flexspline: Array, circular_spline: Array, tilt: Array
    ) -> SolidContinuation:
        """The same drive with manufacturing errors of its teeth and a tilted axis.

        Args:
            flexspline: Shifts of the flexspline's teeth in their frames (N, 2) [m].
            circular_spline: Shifts of the circular spline's teeth in their frames
                (N_c, 2) [m].
            tilt: Slope of the circular spline's axis in x and y (2,) [rad].
        """
        teeth = replace(
            self.model.teeth,
            shift=flexspline,
            circular_spline_shift=circular_spline,
            tilt=tilt,
        )
        return replace(self, model=replace(self.model, teeth=teeth))

    def move(
        self,
        state: SolidState,
        alpha: float,
        rotation: float,
        circular_spline_rotation: float,
    ) -> SolidState:
        """State at other angles; its displacement field stays on the wave generator.

        Args:
            state: State to start from.
            alpha: New angle of the wave generator [rad].
            rotation: New rotation of the flexspline [rad].
            circular_spline_rotation: New rotation of the circular spline [rad].
        """
        # motion of the wave generator relative to the flexspline, in sectors
        model, strip = self.model, self.model.strip
        d_alpha = alpha - state.wave_generator_angle
        shift = (d_alpha - (rotation - state.rotation)) / (2.0 * pi / strip.sectors)
        teeth = model.teeth.circular_spline.profile.teeth
        size = strip.masters.face_size
        last = strip.masters.size - size
        # shift the displacements in the frames of the teeth around the ring
        still = strip.masters.position[:last]
        there = about_z(np.array(state.rotation)) @ model.place
        local = np.concatenate([state.faces, state.inside], axis=1)
        local = np.einsum("sji,saj->sai", there, local) - still
        moved = shift_rows(local, shift) + still
        now = about_z(np.array(rotation)) @ model.place
        x = np.einsum("sij,saj->sai", now, moved)
        race = state.race
        if model.race is not None and race is not None:
            moved = shift_rows(model.race.displacements(race, state.rotation), shift)
            race = model.race.coordinates(moved, rotation)
        return replace(
            state,
            faces=x[:, :size],
            inside=x[:, size:],
            race=race,
            pressure=np.clip(shift_rows(state.pressure, shift), 0.0, None),
            touching=np.roll(state.touching, round(shift), axis=0),
            shared=np.roll(state.shared, round(shift), axis=0),
            bore_force=shift_rows(state.bore_force, shift),
            flank_force=shift_rows(state.flank_force, shift),
            circular_spline_force=shift_rows(
                state.circular_spline_force,
                (d_alpha - (circular_spline_rotation - state.circular_spline_rotation))
                / (2.0 * pi / teeth),
            ),
            wave_generator_angle=alpha,
            rotation=rotation,
            circular_spline_rotation=circular_spline_rotation,
        )

"""Following equilibria in space."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.following import Follower
from swgjoint.fe.ring import travelled
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.equilibrium import SolidLoad, SolidSolver
from swgjoint.fe.solid.ring import SolidRing
from swgjoint.fe.solid.state import SolidState

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidContinuation(Follower[SolidState]):
    """Follows equilibria of the 3D model. Circular spline fixed, input the wave."""

    ring: SolidRing
    ratio: float
    solver: SolidSolver = field(default_factory=SolidSolver)

    @property
    def teeth(self) -> int:
        """Of the flexspline."""
        return self.ring.strip.sectors

    def input_angle(self, state: SolidState) -> float:
        """Theta [rad]."""
        return state.wave_generator_angle

    def input_torque(self, state: SolidState) -> float:
        """External torque on the input [N·m]."""
        return state.wave_generator_torque

    def output_angle(self, state: SolidState) -> float:
        """Psi [rad]."""
        return state.rotation

    def deflected(self, angle: float = 0.0) -> SolidState:
        """Wave generator in place, output at the ideal ratio, no tooth contact."""
        rotation = angle / self.ratio
        start = self.ring.at_rest(angle, rotation)
        return self.solver(self.ring, start, SolidLoad(rotation=rotation, teeth=False))

    def loaded(self, start: SolidState, torque: float, angle: float) -> SolidState:
        """Equilibrium under a torque, from a start with its input at that angle."""
        return self.solver(self.ring, start, SolidLoad(torque=torque))

    def held(self, state: SolidState) -> SolidState:
        """Equilibrium with the output where it is; the torque is what that takes."""
        return self.solver(self.ring, state, SolidLoad(rotation=state.rotation))

    def turned(self, state: SolidState, output: float) -> SolidState:
        """Predictor: the flexspline turned within a field that stays."""
        return self._moved(state, state.wave_generator_angle, output)

    def ahead(self, state: SolidState, angle: float) -> SolidState:
        """Predictor: the field travels with the wave generator, the output turns."""
        d_psi = (angle - state.wave_generator_angle) / self.ratio
        return self._moved(state, angle, state.rotation + d_psi)

    def _moved(self, state: SolidState, angle: float, output: float) -> SolidState:
        ring, strip = self.ring, self.ring.strip
        d_alpha = angle - state.wave_generator_angle
        d_psi = output - state.rotation
        shift = (d_alpha - d_psi) / (2.0 * pi / strip.sectors)
        teeth = ring.teeth.circular_spline.profile.teeth
        size = strip.masters.face_size
        last = strip.masters.size - size
        still = strip.masters.position[:last]
        there = about_z(np.array(state.rotation)) @ ring.place
        local = np.concatenate([state.faces, state.inside], axis=1)
        local = np.einsum("sji,saj->sai", there, local) - still
        moved = travelled(local, shift) + still
        now = about_z(np.array(output)) @ ring.place
        x = np.einsum("sij,saj->sai", now, moved)
        return replace(
            state,
            faces=x[:, :size],
            inside=x[:, size:],
            pressure=np.clip(travelled(state.pressure, shift), 0.0, None),
            touching=np.roll(state.touching, round(shift), axis=0),
            bore_force=travelled(state.bore_force, shift),
            flank_force=travelled(state.flank_force, shift),
            ring_force=travelled(state.ring_force, d_alpha / (2.0 * pi / teeth)),
            wave_generator_angle=angle,
            rotation=output,
        )

"""Following equilibria in space, in torque and input angle."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.following import follow
from swgjoint.fe.ring import travelled
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.equilibrium import SolidLoad, SolidSolver
from swgjoint.fe.solid.ring import SolidRing
from swgjoint.fe.solid.state import SolidState

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidContinuation:
    """Follows equilibria; halves a step that fails. Circular spline fixed."""

    ring: SolidRing
    ratio: float
    solver: SolidSolver = field(default_factory=SolidSolver)

    def deflected(self, angle: float = 0.0) -> SolidState:
        """Wave generator in place, output at the ideal ratio, no tooth contact."""
        rotation = angle / self.ratio
        start = self.ring.at_rest(angle, rotation)
        return self.solver(self.ring, start, SolidLoad(rotation=rotation, teeth=False))

    def meshed(self, state: SolidState) -> SolidState:
        """Teeth in contact, the output held; the torque is what that takes."""
        return self.solver(self.ring, state, SolidLoad(rotation=state.rotation))

    def to_torque(self, state: SolidState, torque: float) -> SolidState:
        """Change the torque at a fixed input."""

        def step(s: SolidState, part: float) -> SolidState:
            load = state.torque + part * (torque - state.torque)
            return self.solver(self.ring, s, SolidLoad(torque=load))

        return follow(state, step)

    def to_angle(self, state: SolidState, angle: float) -> SolidState:
        """Turn the input at constant torque."""
        first = state.wave_generator_angle

        def step(s: SolidState, part: float) -> SolidState:
            guess = self.ahead(s, first + part * (angle - first))
            return self.solver(self.ring, guess, SolidLoad(torque=state.torque))

        return follow(state, step)

    def ahead(self, state: SolidState, angle: float) -> SolidState:
        """Predictor: the field travels with the wave generator, the output turns."""
        ring, strip = self.ring, self.ring.strip
        d_alpha = angle - state.wave_generator_angle
        d_psi = d_alpha / self.ratio
        shift = (d_alpha - d_psi) / (2.0 * pi / strip.sectors)
        teeth = ring.teeth.circular_spline.profile.teeth
        size = strip.masters.face_size
        last = strip.masters.size - size
        still = strip.masters.position[:last]
        there = about_z(np.array(state.rotation)) @ ring.place
        local = np.concatenate([state.faces, state.inside], axis=1)
        local = np.einsum("sji,saj->sai", there, local) - still
        moved = travelled(local, shift) + still
        now = about_z(np.array(state.rotation + d_psi)) @ ring.place
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
            rotation=state.rotation + d_psi,
        )

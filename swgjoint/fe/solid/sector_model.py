"""The ring of strips on the wave generator: geometry, frames, contact points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, about_z, segment_frames
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.strip.strip import Strip
from swgjoint.fe.solid.teeth import SolidTeeth
from swgjoint.fe.solid.wave_generator.race import NODE, SIGN, SolidRace
from swgjoint.fe.solid.wave_generator.surface import WaveGeneratorSurface
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidSectorModel:
    """Flexspline strips around the wave generator."""

    strip: Strip
    wave_generator: WaveGeneratorSurface
    teeth: SolidTeeth
    lobe_height: float
    """Radial deflection at the lobes [m]."""
    half: bool = False
    """Whether the model is half of the ring, closed by a rotation of 180 deg."""
    nonlinear: bool = True
    """Whether segments rotate by large angles; if not, they rotate only with the
    output."""
    race: SolidRace | None = None
    """Outer race on balls that replaces the rigid wave generator."""

    def dofs(self, masters: Index) -> Index:
        """Degrees of freedom of masters in a sector.

        Those of the race's nodes follow the masters of the first face and of the last
        face.
        """
        first = 3 * masters
        if self.race is not None:
            first = first + NODE * (masters >= self.strip.masters.face_size)
        return np.asarray((first[:, None] + np.arange(3)).ravel())

    @cached_property
    def race_dofs(self) -> Index:
        """Degrees of freedom of the race's nodes at both faces; empty without one."""
        if self.race is None:
            return np.zeros(0, dtype=np.int64)
        ends = 3 * self.strip.masters.face_size, self.size - NODE
        return np.concatenate([end + np.arange(NODE) for end in ends])

    @cached_property
    def bore_places(self) -> Array:
        """Parameters of the bore nodes along the undeformed elements, 0 to 1 (b,)."""
        x, y, _ = self.strip.bore.T
        return np.asarray(0.5 + np.arctan2(-x, y) * self.strip.sectors / (2.0 * pi))

    @cached_property
    def contact_dofs(self) -> Index:
        """Degrees of freedom that move the bore's gap, those of the teeth first."""
        return np.concatenate([self.dofs(self.strip.teeth.masters), self.race_dofs])

    @property
    def size(self) -> int:
        """Number of degrees of freedom of a sector, including both faces."""
        return 3 * self.strip.masters.size + (0 if self.race is None else 2 * NODE)

    @property
    def face_closure(self) -> Array:
        """Factors of the degrees of freedom of a face that close the ring."""
        of_masters = np.tile(self.closure, self.strip.masters.face_size)
        if self.race is None:
            return of_masters
        return np.concatenate([of_masters, SIGN if self.half else np.ones(NODE)])

    @property
    def copies(self) -> int:
        """Number of copies of the model in the drive."""
        return 2 if self.half else 1

    @property
    def sectors(self) -> int:
        """Number of sectors in the model."""
        return self.strip.sectors // self.copies

    @cached_property
    def closure(self) -> Array:
        """Factors of x, y, z that close the ring."""
        sign = -1.0 if self.half else 1.0
        return np.array([sign, sign, 1.0])

    @cached_property
    def place(self) -> Array:
        """Rotations of the sectors in the undeformed ring (N, 3, 3)."""
        return about_z(
            2.0 * pi / self.strip.sectors * np.arange(self.sectors, dtype=float)
        )

    @cached_property
    def reference(self) -> Array:
        """Undeformed masters in the global frame (N, n, 3) [m]."""
        position = self.strip.masters.position
        return np.asarray(np.einsum("sij,aj->sai", self.place, position))

    def masters(self, state: SolidState) -> Array:
        """Positions of all masters per sector (N, n, 3) [m]."""
        last = np.roll(state.faces, -1, axis=0)
        last[-1] *= self.closure
        return np.concatenate([state.faces, state.inside, last], axis=1)

    def loads(self, state: SolidState) -> Array:
        """Forces at the loaded degrees of freedom of the teeth (N, n_b) [N]."""
        return np.concatenate([state.flank_force, state.bore_force], axis=1)

    def frames(self, state: SolidState) -> tuple[SolidFrames, ...]:
        """Frames of all segments."""
        x, place = self.masters(state), self.place
        if not self.nonlinear:
            place = about_z(np.array(state.rotation)) @ place
        return tuple(
            segment_frames(segment, x[:, segment.masters], place, fitted=self.nonlinear)
            for segment in self.strip.segments
        )

    def bore_positions(self, frames: SolidFrames, state: SolidState) -> Array:
        """Positions of the bore nodes in the frames of the teeth (N, n_bore, 3) [m].

        Args:
            frames: Frames of the toothed segments.
            state: The state.
        """
        teeth, first = self.strip.teeth, self.strip.flank_dofs
        moved = frames.displacement @ teeth.loaded_from_masters[first:].T
        moved += self.loads(state) @ teeth.compliance[:, first:]
        return self.strip.bore + moved.reshape(len(moved), -1, 3)

    def initial_guess(self, alpha: float = 0.0, rotation: float = 0.0) -> SolidState:
        """Start of a search: a cup whose wall remains straight and does not stretch.

        The displacement is w0 s cos 2 phi radially and -w0 s/2 sin 2 phi tangentially,
        where s decreases from the teeth to the closed end; the axial displacement
        follows from zero shear in the wall.

        Args:
            alpha: Wave-generator angle [rad].
            rotation: Rotation of the flexspline [rad].
        """
        x = self.reference
        strip, w0 = self.strip, self.lobe_height
        bore = float(np.hypot(strip.bore[:, 0], strip.bore[:, 1]).min())
        closed = float(strip.masters.position[:, 2].max())
        held = strip.masters.position[strip.masters.held]
        boss = float(np.hypot(held[:, 0], held[:, 1]).mean())
        radius = np.hypot(x[..., 0], x[..., 1])
        phi = np.arctan2(-x[..., 0], x[..., 1]) - (alpha - rotation)
        has_cup = len(strip.segments) > 1
        s, ds, disc = np.ones_like(phi), 0.0, np.ones_like(phi)
        if has_cup:
            ds = -1.0 / closed
            s = np.clip(1.0 - x[..., 2] / closed, 0.0, None)
            disc = np.clip((radius - boss) / (bore - boss), 0.0, 1.0)
        off = radius - bore
        turn = 1.5 * w0 * s * np.sin(2.0 * phi) / bore
        radial = w0 * s * np.cos(2.0 * phi)
        around = -0.5 * w0 * s * np.sin(2.0 * phi) + off * turn
        axial = -(0.25 * bore * disc + off * (disc == 1.0)) * w0 * ds * np.cos(2 * phi)
        out = np.stack([x[..., 0], x[..., 1], 0.0 * radius], -1) / radius[..., None]
        side = np.stack([-out[..., 1], out[..., 0], 0.0 * radius], axis=-1)
        moved = x + (radial * disc)[..., None] * out + (around * disc)[..., None] * side
        moved[..., 2] += axial
        moved = np.einsum("ij,saj->sai", about_z(np.array(rotation)), moved)
        size, n_bore = strip.masters.face_size, len(strip.bore)
        points = n_bore + 2 * (n_bore // strip.planes)
        last = strip.masters.size - size
        race, touching = None, np.zeros((self.sectors, points), bool)
        if self.race is not None:
            race = self.race.initial_guess(alpha, rotation, closed)
            # only the rim presses the race on its balls
            along = np.arange(self.sectors) * 2.0 * pi / strip.sectors
            at_lobe = np.cos(2.0 * (along + rotation - alpha)) > 0.9
            touching[:, :n_bore] = at_lobe[:, None] & self.race.covers(strip.bore[:, 2])
        return SolidState(
            faces=moved[:, :size],
            inside=moved[:, size:last],
            race=race,
            pressure=np.zeros((self.sectors, points)),
            touching=touching,
            shared=np.zeros((self.sectors, n_bore // strip.planes), bool),
            bore_force=np.zeros((self.sectors, 3 * n_bore)),
            flank_force=np.zeros((self.sectors, strip.flank_dofs)),
            circular_spline_force=np.zeros(
                (self.teeth.circular_spline_teeth, self.teeth.circular_spline_dofs)
            ),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

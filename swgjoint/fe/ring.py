"""The ring of sectors between wave generator and circular spline: its geometry.

Everything in the frame of the circular spline, which is rigid and fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.corotation import Frames, rotate, sector_frames, turned
from swgjoint.fe.state import State
from swgjoint.fe.superelement import Superelement
from swgjoint.gear.profile import ToothProfile
from swgjoint.gear.wave_generator import WaveGenerator

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class RingModel:
    """Flexspline ring, wave generator and rigid circular spline."""

    element: Superelement
    wave_generator: WaveGenerator
    circular_spline: ToothProfile
    lobe_height: float
    """Radial deflection at the lobes [m]."""
    half: bool = False
    """Half of the ring, closed by a rotation of 180 deg."""
    nonlinear: bool = True

    @property
    def sectors(self) -> int:
        """Sectors in the model."""
        return self.element.sectors // (2 if self.half else 1)

    @property
    def copies(self) -> int:
        """How many times the model repeats in the drive."""
        return 2 if self.half else 1

    @property
    def closure(self) -> float:
        """Sign that closes the ring: the half model continues as its opposite."""
        return -1.0 if self.half else 1.0

    @cached_property
    def place(self) -> Array:
        """Angles of the sectors in the undeformed ring [rad]."""
        return np.asarray(
            2.0 * pi / self.element.sectors * np.arange(self.sectors), float
        )

    @cached_property
    def reference(self) -> Array:
        """Undeformed skeleton nodes in the global frame (N, n_a, 2) [m]."""
        skeleton = np.broadcast_to(
            self.element.skeleton, (self.sectors, *self.element.skeleton.shape)
        )
        return rotate(skeleton, self.place[:, None])

    @cached_property
    def bore_nodes(self) -> NDArray[np.int64]:
        """Skeleton nodes of a sector that face the wave generator, one corner."""
        size = self.element.face_size
        return np.arange(size - 1, size + self.element.bore_size)

    def skeleton(self, state: State) -> Array:
        """Positions of all skeleton nodes per sector (N, n_a, 2) [m]."""
        last = np.roll(state.faces, -1, axis=0)
        last[-1] *= self.closure
        return np.concatenate([state.faces, state.bores, last], axis=1)

    def frames(self, state: State) -> Frames:
        """Sector frames; at the linear level they turn with the flexspline only."""
        fixed = None
        if not self.nonlinear:
            fixed = np.full(self.sectors, state.rotation)
        return sector_frames(
            self.element, self.skeleton(state), self.place, fixed=fixed
        )

    def at_rest(self, alpha: float = 0.0, rotation: float = 0.0) -> State:
        """Start of a search: the inextensional two-lobe shape of a thin ring.

        Radial w0 cos 2 phi, tangential -w0/2 sin 2 phi, cross-sections turned by
        3 w0 sin 2 phi/(2 r); phi from the major axis.
        """
        element = self.element
        x = self.reference
        radius = np.hypot(x[..., 0], x[..., 1])
        bore = float(radius.min())
        phi = np.arctan2(-x[..., 0], x[..., 1]) - (alpha - rotation)
        w0 = self.lobe_height
        turn = 1.5 * w0 * np.sin(2 * phi) / bore
        radial = w0 * np.cos(2 * phi)
        tangential = -0.5 * w0 * np.sin(2 * phi) + (radius - bore) * turn
        unit = x / radius[..., None]
        moved = x + radial[..., None] * unit + tangential[..., None] * turned(unit)
        moved = rotate(moved, rotation)
        size, inside = element.face_size, element.bore_size
        nodes = moved[:, self.bore_nodes]
        gap, _, _ = self.wave_generator_gap(nodes, alpha)
        return State(
            faces=moved[:, :size],
            bores=moved[:, size : size + inside],
            pressure=np.zeros(gap.shape),
            touching=gap < 0.01 * w0,
            flank_force=np.zeros((self.sectors, 4 * element.flank_size)),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

    def wave_generator_gap(
        self, nodes: Array, alpha: float
    ) -> tuple[Array, Array, Array]:
        """Gap, outward normal and curvature of parallel curves at the bore nodes.

        Args:
            nodes: Positions (..., 2) [m].
            alpha: Wave-generator angle [rad].
        """
        flat = rotate(nodes.reshape(-1, 2), -alpha)
        gap, normal, curvature = self.wave_generator.signed_distance(flat)
        return (
            gap.reshape(nodes.shape[:-1]),
            rotate(normal, alpha).reshape(nodes.shape),
            (curvature / (1.0 + curvature * gap)).reshape(nodes.shape[:-1]),
        )

    def best_fit_rotation(self, nodes: Array) -> tuple[float, Array]:
        """Best-fit rotation of the bore nodes and its gradient (N, n_bore + 1, 2)."""
        x0 = self.reference[:, self.bore_nodes]
        sine = float(np.einsum("sni,sni->", turned(x0), nodes))
        cosine = float(np.einsum("sni,sni->", x0, nodes))
        gradient = (cosine * turned(x0) - sine * x0) / (sine**2 + cosine**2)
        return float(np.arctan2(sine, cosine)), gradient

    def moved(self, state: State, alpha: float, rotation: float) -> State:
        """Predictor: the field turned with the wave generator and the flexspline.

        Displacements in polar components travel with the wave generator through the
        teeth, interpolated between sectors; the flexspline turns rigidly.
        """
        n = self.sectors
        pitch = 2.0 * pi / self.element.sectors
        d_rotation = rotation - state.rotation
        shift = (alpha - state.wave_generator_angle - d_rotation) / pitch
        whole = int(np.floor(shift))
        part = shift - whole
        size, inside = self.element.face_size, self.element.bore_size

        def travel(values: Array, sign: float) -> Array:
            def at(k: int) -> Array:
                out = np.roll(values, k, axis=0).copy()
                turns = (np.arange(n) - k) // n
                out[turns % 2 != 0] *= sign
                return out

            # cubic Lagrange between four neighbouring sectors
            t = part
            return (
                t * (t + 1) * (t - 1) / 6 * at(whole + 2)
                - t * (t - 2) * (t + 1) / 2 * at(whole + 1)
                + (t - 1) * (t - 2) * (t + 1) / 2 * at(whole)
                - t * (t - 1) * (t - 2) / 6 * at(whole - 1)
            )

        local = rotate(
            np.concatenate([state.faces, state.bores], axis=1),
            -(self.place + state.rotation)[:, None],
        )
        # displacements in sector frames repeat after half a turn
        local = (
            travel(local - self.element.skeleton[: size + inside], 1.0)
            + self.element.skeleton[: size + inside]
        )
        x = rotate(local, (self.place + rotation)[:, None])
        nearest = int(np.round(shift))
        return replace(
            state,
            faces=x[:, :size],
            bores=x[:, size:],
            pressure=travel(state.pressure, 1.0),
            touching=np.roll(state.touching, nearest, axis=0),
            flank_force=travel(state.flank_force, 1.0),
            wave_generator_angle=alpha,
            rotation=rotation,
        )

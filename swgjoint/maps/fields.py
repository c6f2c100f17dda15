r"""Shape, stress and contact forces of the flexspline, to be shown at any angle.

Without errors of the teeth every tooth goes through the same states as the wave
generator passes: what it is subject to depends on its place

.. math:: u_k = 2\pi k/z_F + \varphi_F - \varphi_{WG}

counter-clockwise from the first lobe, and on the torque. So equilibria at a few
positions within one pitch, all teeth together, sample these functions densely.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from swgjoint.arrays import frozen_array
from swgjoint.typing import Array

Table = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlexsplineShape:
    """The flexspline at one position or several (...), in the frame of the drive."""

    points: Table
    """Points of the surface by tooth (..., N, n_nodes, 3) [m]."""
    von_mises: Table
    """There (..., N, n_nodes) [Pa]."""
    tooth_force: Table
    """On each tooth by the circular spline (..., N, 3) [N]."""
    wave_generator_force: Table
    """On the bore below each tooth by the wave generator (..., N, 3) [N]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveFields:
    """What happens to a tooth sector of the flexspline by torque and place.

    In the frame of the tooth, which points along +y where it stands undeformed and
    turned with its member; z along the axis, away from the open end.
    """

    torque: Array
    """T, increasing [N·m]. Shape (n_torques,)."""
    period: float
    """Period of the place: a turn, or half of one where both lobes are alike [rad]."""
    first_place: Array
    """Of the stored places by torque: the torsion shifts them (n_torques,) [rad]."""
    points: Array
    """Undeformed nodes of the surface (n_nodes, 3) [m]."""
    triangles: NDArray[np.int64]
    """Triangles of the surface between them (n_triangles, 3)."""
    displacement: Table
    """At equally spaced places over a period (n_torques, n_places, n_nodes, 3) [m]."""
    von_mises: Table
    """(n_torques, n_places, n_nodes) [Pa]."""
    tooth_force: Table
    """On the tooth by the circular spline (n_torques, n_places, 3) [N]."""
    wave_generator_force: Table
    """On the bore by the wave generator (n_torques, n_places, 3) [N]."""
    wave_generator: Array
    """Outline, its first lobe on +y (n_wave_generator, 2) [m]."""
    circular_spline: Array
    """Outline of a tooth on +y, root to root (n_circular_spline, 2) [m]."""

    SHAPES: ClassVar[dict[str, tuple[str | int, ...]]] = {
        "torque": ("torques",),
        "first_place": ("torques",),
        "points": ("nodes", 3),
        "triangles": ("triangles", 3),
        "displacement": ("torques", "places", "nodes", 3),
        "von_mises": ("torques", "places", "nodes"),
        "tooth_force": ("torques", "places", 3),
        "wave_generator_force": ("torques", "places", 3),
        "wave_generator": ("wave generator", 2),
        "circular_spline": ("circular spline", 2),
    }
    """Axes of the arrays by name, or their length."""

    def __post_init__(self) -> None:
        if not 0.0 < self.period <= 2.0 * pi * (1.0 + 1e-12):
            raise ValueError(f"period {self.period} rad; accepted: above 0, to a turn")
        sizes: dict[str, int] = {}
        for key, axes in self.SHAPES.items():
            values = frozen_array(getattr(self, key), f"fields: {key}", ndim=len(axes))
            for axis, size in zip(axes, values.shape, strict=True):
                wanted = sizes.setdefault(axis, size) if isinstance(axis, str) else axis
                if size != wanted or not size:
                    raise ValueError(
                        f"fields: {key} has shape {values.shape}, needs {wanted} {axis}"
                    )
            if axes[:2] == ("torques", "places"):
                # to be looked at: seven digits are enough
                values = values.astype(np.float32)
                values.setflags(write=False)
            if key == "triangles":
                values = values.astype(np.int64)
                if values.min() < 0 or values.max() >= sizes["nodes"]:
                    raise ValueError("fields: triangles name nodes that are not there")
                values.setflags(write=False)
            object.__setattr__(self, key, values)
        if (np.diff(self.torque) <= 0.0).any():
            raise ValueError("fields: torque [N·m] must increase")

    def evaluate_at(
        self, place: Array, torque: float | Array
    ) -> tuple[Table, Table, Table, Table]:
        """Displacement, von Mises stress, tooth and wave-generator force at places.

        Linear between the stored ones; beyond the largest torques theirs.

        Args:
            place: Of teeth (...) [rad].
            torque: T, of a shape that broadcasts to these [N·m].

        Returns:
            Shapes (..., n_nodes, 3), (..., n_nodes), (..., 3), (..., 3), in the frames
            of the teeth.
        """
        t = np.broadcast_to(np.asarray(torque, dtype=float), np.shape(place))
        j = np.clip(
            np.searchsorted(self.torque, t) - 1, 0, max(len(self.torque) - 2, 0)
        )
        k = np.minimum(j + 1, len(self.torque) - 1)
        step = self.torque[k] - self.torque[j]
        share = np.clip((t - self.torque[j]) / np.where(k > j, step, 1.0), 0.0, 1.0)
        count = self.displacement.shape[1]
        corners: list[tuple[NDArray[np.int64], Table]] = []
        for row, weight in ((j, 1.0 - share), (k, share)):
            x = (np.asarray(place) - self.first_place[row]) / self.period * count
            low = np.floor(x)
            part, low = x - low, low.astype(np.int64) % count
            for at, w in ((low, 1.0 - part), ((low + 1) % count, part)):
                corners.append((row * count + at, (weight * w).astype(np.float32)))

        def between(table: Table) -> Table:
            samples = table.reshape(len(self.torque) * count, -1)
            # fresh memory costs more than the sums: one more array for all corners
            found = np.zeros((*t.shape, samples.shape[1]), dtype=np.float32)
            one = np.empty_like(found)
            for at, w in corners:
                np.take(samples, at, axis=0, out=one, mode="clip")
                one *= w[..., None]
                found += one
            return found.reshape(*t.shape, *table.shape[2:])

        return (
            between(self.displacement),
            between(self.von_mises),
            between(self.tooth_force),
            between(self.wave_generator_force),
        )

    def repeats(self, teeth: int) -> int:
        """Equal parts of a turn in which a flexspline of so many teeth looks alike."""
        parts = round(2.0 * pi / self.period)
        whole = abs(parts * self.period - 2.0 * pi) < 1e-9
        return parts if whole and teeth % parts == 0 else 1

    def flexspline(
        self,
        teeth: int,
        rotation: float | Array,
        wave_generator_angle: float | Array,
        torque: float | Array,
        *,
        parts: int = 1,
    ) -> FlexsplineShape:
        """The flexspline at one position or several, of any shape (...).

        Args:
            teeth: Of the flexspline.
            rotation: Of the flexspline (...) [rad].
            wave_generator_angle: (...) [rad].
            torque: T (...) [N·m].
            parts: Only the first of so many equal parts, see :meth:`repeats`.
        """
        turn, passed, load = (
            np.asarray(value, dtype=float)[..., None]
            for value in (rotation, wave_generator_angle, torque)
        )
        angle = 2.0 * pi / teeth * np.arange(teeth // parts, dtype=float) + turn
        u, stress, tooth, bore = self.evaluate_at(
            angle - passed, np.broadcast_to(load, angle.shape)
        )
        u += self.points.astype(np.float32)
        return FlexsplineShape(
            points=_turned(u, angle[..., None]),
            von_mises=stress,
            tooth_force=_turned(tooth, angle),
            wave_generator_force=_turned(bore, angle),
        )


def _turned(vectors: Table, angle: Array) -> Table:
    """Vectors (..., 3) turned about z by angles (...) [rad]."""
    c, s = (f(angle).astype(np.float32) for f in (np.cos, np.sin))
    x, y = vectors[..., 0], vectors[..., 1]
    turned = np.empty_like(vectors)
    turned[..., 0] = c * x - s * y
    turned[..., 1] = s * x + c * y
    turned[..., 2] = vectors[..., 2]
    return turned

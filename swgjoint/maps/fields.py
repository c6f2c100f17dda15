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

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class FlexsplineShape:
    """The flexspline at one position; everything in the frame of the drive."""

    points: Array
    """Of the surface by tooth (N, n_nodes, 3) [m]."""
    von_mises: Array
    """There (N, n_nodes) [Pa]."""
    tooth_force: Array
    """On each tooth by the circular spline (N, 3) [N]."""
    wave_generator_force: Array
    """On the bore below each tooth by the wave generator (N, 3) [N]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveFields:
    """What happens to a tooth sector of the flexspline by torque and place.

    In the frame of the tooth, which points along +y where it stands undeformed and
    turned with its member; z along the axis, away from the open end.
    """

    torque: Array
    """T, increasing [N·m]. Shape (n_torques,)."""
    period: float
    """Of the place: a turn, or half of one where both lobes are alike [rad]."""
    first_place: Array
    """Of the stored places by torque: the torsion shifts them (n_torques,) [rad]."""
    points: Array
    """Undeformed nodes of the surface (n_nodes, 3) [m]."""
    triangles: NDArray[np.int64]
    """Of the surface between them (n_triangles, 3)."""
    displacement: Array
    """At equally spaced places over a period (n_torques, n_places, n_nodes, 3) [m]."""
    von_mises: Array
    """(n_torques, n_places, n_nodes) [Pa]."""
    tooth_force: Array
    """On the tooth by the circular spline (n_torques, n_places, 3) [N]."""
    wave_generator_force: Array
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
            if key == "triangles":
                values = values.astype(np.int64)
                if values.min() < 0 or values.max() >= sizes["nodes"]:
                    raise ValueError("fields: triangles name nodes that are not there")
                values.setflags(write=False)
            object.__setattr__(self, key, values)
        if (np.diff(self.torque) <= 0.0).any():
            raise ValueError("fields: torque [N·m] must increase")

    def at(self, place: Array, torque: float) -> tuple[Array, Array, Array, Array]:
        """Displacement, von Mises stress, tooth and wave-generator force at places.

        Linear between the stored ones; beyond the largest torques theirs.

        Args:
            place: Of n teeth [rad].
            torque: T [N·m].

        Returns:
            Shapes (n, n_nodes, 3), (n, n_nodes), (n, 3), (n, 3), in the frames of the
            teeth.
        """
        t = self.torque
        j = int(np.clip(np.searchsorted(t, torque) - 1, 0, max(len(t) - 2, 0)))
        k = min(j + 1, len(t) - 1)
        share = float(np.clip((torque - t[j]) / (t[k] - t[j]), 0, 1)) if k > j else 0.0
        below = self._row(j, np.asarray(place))
        if share == 0.0:
            return below
        above = self._row(k, np.asarray(place))
        one, two, three, four = (
            a + share * (b - a) for a, b in zip(below, above, strict=True)
        )
        return one, two, three, four

    def _row(self, j: int, place: Array) -> tuple[Array, Array, Array, Array]:
        """The same at a stored torque."""
        count = self.displacement.shape[1]
        x = (place - self.first_place[j]) / self.period * count
        low = np.floor(x)
        part, low = x - low, low.astype(np.int64) % count

        def between(table: Array) -> Array:
            w = part.reshape(-1, *[1] * (table.ndim - 2))
            return np.asarray(
                (1.0 - w) * table[j, low] + w * table[j, (low + 1) % count]
            )

        return (
            between(self.displacement),
            between(self.von_mises),
            between(self.tooth_force),
            between(self.wave_generator_force),
        )

    def flexspline(
        self, teeth: int, rotation: float, wave_generator_angle: float, torque: float
    ) -> FlexsplineShape:
        """The whole flexspline.

        Args:
            teeth: Of the flexspline.
            rotation: Of the flexspline [rad].
            wave_generator_angle: [rad].
            torque: T [N·m].
        """
        angle: Array = 2.0 * pi / teeth * np.arange(teeth, dtype=float) + rotation
        u, stress, tooth, bore = self.at(angle - wave_generator_angle, torque)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.zeros((teeth, 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = c
        turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -s, s, 1.0
        return FlexsplineShape(
            points=np.einsum("kij,knj->kni", turn, self.points + u),
            von_mises=stress,
            tooth_force=np.einsum("kij,kj->ki", turn, tooth),
            wave_generator_force=np.einsum("kij,kj->ki", turn, bore),
        )

r"""Shape, stress and contact forces of the flexspline at any angle, for display.

Without tooth errors, every tooth goes through the same states while the wave generator
passes it. The state of tooth k depends only on the torque and on its place

.. math:: u_k = 2\pi k/z_F + \varphi_F - \varphi_{WG},

the angle of the tooth relative to the first lobe, positive counter-clockwise. Each
equilibrium contains all teeth and thus :math:`z_F` places, so a few equilibria within
one pitch sample the state densely.
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
    """N teeth of the flexspline at one or more positions (...), in the drive frame."""

    points: Table
    """Surface points of each tooth sector (..., N, n_nodes, 3) [m]."""
    von_mises: Table
    """Von Mises stress at the points (..., N, n_nodes) [Pa]."""
    tooth_force: Table
    """Force of the circular spline on each tooth (..., N, 3) [N]."""
    wave_generator_force: Table
    """Force of the wave generator on the bore below each tooth (..., N, 3) [N]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveFields:
    """State of a tooth sector of the flexspline as a function of torque and place.

    Vectors are in the frame of the tooth, which rotates with the flexspline: +y points
    radially outwards along the undeformed tooth, +z along the axis away from the open
    end.
    """

    torque: Array
    """Output torques T, increasing [N·m]. Shape (n_torques,)."""
    period: float
    """Period of the place [rad]: a turn, or the lobe spacing if the lobes are equal."""
    first_place: Array
    """First stored place at each torque, shifted by the torsion (n_torques,) [rad]."""
    points: Array
    """Undeformed surface nodes (n_nodes, 3) [m]."""
    triangles: NDArray[np.int64]
    """Surface triangles as node indices (n_triangles, 3)."""
    displacement: Table
    """Displacement at equally spaced places (n_torques, n_places, n_nodes, 3) [m]."""
    von_mises: Table
    """Von Mises stress (n_torques, n_places, n_nodes) [Pa]."""
    tooth_force: Table
    """Force of the circular spline on the tooth (n_torques, n_places, 3) [N]."""
    wave_generator_force: Table
    """Force of the wave generator on the bore (n_torques, n_places, 3) [N]."""
    wave_generator: Array
    """Outline of the wave generator, first lobe on +y (n_wave_generator, 2) [m]."""
    circular_spline: Array
    """Outline of one tooth on +y, from root to root (n_circular_spline, 2) [m]."""

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
    """Axes of each array: the name of a variable length, or a fixed length."""

    def __post_init__(self) -> None:
        if not 0.0 < self.period <= 2.0 * pi * (1.0 + 1e-12):
            raise ValueError(
                f"period {self.period} rad; accepted: above 0, up to a turn"
            )
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
                # single precision suffices for display
                values = values.astype(np.float32)
                values.setflags(write=False)
            if key == "triangles":
                values = values.astype(np.int64)
                if values.min() < 0 or values.max() >= sizes["nodes"]:
                    raise ValueError(
                        "fields: triangles refer to nodes that do not exist"
                    )
                values.setflags(write=False)
            object.__setattr__(self, key, values)
        if (np.diff(self.torque) <= 0.0).any():
            raise ValueError("fields: torque [N·m] must increase")

    def evaluate_at(
        self, place: Array, torque: float | Array
    ) -> tuple[Table, Table, Table, Table]:
        """Displacement, stress and both forces of teeth at given places.

        Values are interpolated linearly in place and torque. Beyond the stored torques,
        the values at the outermost torque are returned.

        Args:
            place: Places of teeth (...) [rad].
            torque: Output torque T, of a shape that broadcasts to the places [N·m].

        Returns:
            Displacement (..., n_nodes, 3) [m], von Mises stress (..., n_nodes) [Pa],
            force of the circular spline and force of the wave generator (..., 3) [N],
            in the frames of the teeth.
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
            """Bilinear interpolation of a table at the places and torques."""
            samples = table.reshape(len(self.torque) * count, -1)
            # allocation costs more than addition, so all corners share one work array
            total = np.zeros((*t.shape, samples.shape[1]), dtype=np.float32)
            one = np.empty_like(total)
            for at, w in corners:
                np.take(samples, at, axis=0, out=one, mode="clip")
                one *= w[..., None]
                total += one
            return total.reshape(*t.shape, *table.shape[2:])

        return (
            between(self.displacement),
            between(self.von_mises),
            between(self.tooth_force),
            between(self.wave_generator_force),
        )

    def repeats(self, teeth: int) -> int:
        """Number of equal parts of a turn in which the flexspline has the same shape.

        It is 1 unless the places repeat within a turn and each part contains the same
        number of teeth.

        Args:
            teeth: Number of teeth of the flexspline.
        """
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
        """The flexspline at one or more positions of any shape (...).

        Args:
            teeth: Number of teeth of the flexspline.
            rotation: Rotation of the flexspline (...) [rad].
            wave_generator_angle: Angle of the wave generator (...) [rad].
            torque: Output torque T (...) [N·m].
            parts: Number of equal parts of the turn, of which only the first is
                returned; see :meth:`repeats`.
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

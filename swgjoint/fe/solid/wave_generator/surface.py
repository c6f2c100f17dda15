r"""Surface of the wave generator over the face width: crowning and slope.

Crowning lowers the surface towards both edges by :math:`c (2 z/b)^2` (parabolic) or by
a circular arc with the same depth c at the edges. A slope s raises the surface by
:math:`-s\,(2 z/b) \cos 2\varphi`: by s at the major axis of the open end (z < 0), and
by -s at its minor axis. With positive s the surface follows the coning of the deflected
cup (thesis figure 7.27; the description of figure 7.33 in the thesis has the opposite
sign). The surface supports the bore only over the face width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.plane.corotation import rotate
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import flawed_wave_generator, wave_generator_offset
from swgjoint.gear.wave_generators.wave_generator import WaveGenerator
from swgjoint.typing import Array
from swgjoint.units import mm, um


@dataclass(frozen=True, kw_only=True, eq=False)
class WaveGeneratorSurface:
    """Outline and micro-geometry of a rigid wave generator."""

    outline: WaveGenerator
    width: float
    """Face width b [m]."""
    crowning: float = 0.0
    """Crowning c [m]."""
    slope: float = 0.0
    """Slope s [m]."""
    circular: bool = False
    """Whether the crown is a circular arc instead of a parabola."""
    offset: Array | None = None
    """Centre of the outline in the frame of the wave generator (2,) [m]; None for the
    axis."""

    @classmethod
    def from_design(cls, design: Design) -> WaveGeneratorSurface:
        """Surface of a design's wave generator."""
        shape = design.micro_geometry
        return cls(
            outline=flawed_wave_generator(design),
            width=design.drive.face_width_mm * mm,
            crowning=shape.wave_generator_crowning_um * um,
            slope=shape.wave_generator_slope_um * um,
            circular=shape.crowning_kind == "circular",
            offset=wave_generator_offset(design),
        )

    def gap(self, points: Array, alpha: float) -> tuple[Array, Array, Array]:
        """Gap of points to the surface, its gradient and its curvature.

        Args:
            points: Positions in the global frame (n, 3) [m].
            alpha: Angle of the wave generator [rad].

        Returns:
            Gap (n,) [m], its gradient in the global frame (n, 3) [-], and curvature of
            the curve parallel to the outline through each point (n,) [1/m].
        """
        flat = rotate(points[:, :2], -alpha)
        if self.offset is not None:
            flat = flat - self.offset
        gap, normal, curvature = self.outline.signed_distance(flat)
        lowered, by_z = crown(
            points[:, 2], self.crowning, self.width, circular=self.circular
        )
        # angle from the major axis, which is the y axis
        radius = np.hypot(flat[:, 0], flat[:, 1])
        double = 2.0 * np.arctan2(-flat[:, 0], flat[:, 1])
        z = 2.0 * points[:, 2] / self.width
        lowered = lowered + self.slope * z * np.cos(double)
        by_z = by_z + self.slope * 2.0 / self.width * np.cos(double)
        by_angle = -2.0 * self.slope * z * np.sin(double) / radius
        around = np.stack([-flat[:, 1], flat[:, 0]], axis=-1) / radius[:, None]
        plane = rotate(normal + by_angle[:, None] * around, alpha)
        return (
            gap + lowered,
            np.concatenate([plane, by_z[:, None]], axis=1),
            curvature / (1.0 + curvature * gap),
        )


def crown(
    z: Array, height: float, width: float, *, circular: bool
) -> tuple[Array, Array]:
    """Depth of a crowned surface below a straight one (n,) [m] and its derivative by z.

    Args:
        z: Positions from the middle of the face width (n,) [m].
        height: Depth at the edges [m].
        width: Face width [m].
        circular: Whether the crown is a circular arc instead of a parabola with the
            same depth at the edges.
    """
    if not height:
        return np.zeros_like(z), np.zeros_like(z)
    half = 0.5 * width
    if circular:
        radius = 0.5 * (half**2 + height**2) / height
        depth = np.sqrt(radius**2 - np.minimum(np.abs(z), 0.999 * radius) ** 2)
        return radius - depth, z / depth
    return height * (z / half) ** 2, 2.0 * height * z / half**2

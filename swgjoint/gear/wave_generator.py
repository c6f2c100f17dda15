"""Outlines of wave generators and the signed distance of points to them.

The major axis lies along +y at wave-generator angle zero; everything is in the frame of
the wave generator, in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import DesignError
from swgjoint.gear.design import Design
from swgjoint.units import mm

Array = NDArray[np.float64]


class WaveGenerator(Protocol):
    """What contact needs to know of a wave generator."""

    @property
    def major(self) -> float:
        """Largest radius [m]."""
        ...

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Distance, outward unit normal and outline curvature.

        Args:
            points: Shape (n, 2) [m].

        Returns:
            Distances (n,) [m], positive outside; normals (n, 2); curvatures of the
            outline at the foot (n,) [1/m], positive for a convex outline.
        """
        ...

    def outline(self, count: int) -> Array:
        """Closed outline, counter-clockwise from +y. Shape (count, 2) [m]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Elliptical:
    """Ellipse with major semi-axis a along y (thesis eqs 3.3 and 3.4)."""

    major: float
    minor: float

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Foot of the perpendicular by Newton's method on the eccentric angle."""
        a, b = self.major, self.minor
        # one quadrant, mirrored back at the end; x = b sin t, y = a cos t
        x, y = np.abs(points[:, 0]), np.abs(points[:, 1])
        t = np.arctan2(a * x, b * y)
        for _ in range(12):
            sin, cos = np.sin(t), np.cos(t)
            dx, dy = x - b * sin, y - a * cos
            # zero of the projection on the tangent (b cos t, -a sin t)
            f = dx * b * cos - dy * a * sin
            slope = -((b * cos) ** 2) - (a * sin) ** 2 - dx * b * sin - dy * a * cos
            step = f / slope
            t = np.clip(t - step, 0.0, 0.5 * np.pi)
            if np.max(np.abs(step), initial=0.0) < 1e-15:
                break
        sin, cos = np.sin(t), np.cos(t)
        size = np.hypot(a * sin, b * cos)
        normal = np.stack([a * sin / size, b * cos / size], axis=-1)
        distance = (x - b * sin) * normal[:, 0] + (y - a * cos) * normal[:, 1]
        signs = np.where(points < 0.0, -1.0, 1.0)
        return distance, normal * signs, a * b / size**3

    def outline(self, count: int) -> Array:
        """Points at equal steps of the eccentric angle."""
        t = np.linspace(0.0, 2.0 * np.pi, count)
        return np.stack([-self.minor * np.sin(t), self.major * np.cos(t)], axis=-1)


@dataclass(frozen=True, kw_only=True)
class Simplified:
    """Two semicircles joined by straight lines (thesis eqs 3.2 and 3.3)."""

    major: float
    pin_radius: float

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Distance to the segment that joins the two centres, less the radius."""
        half = self.major - self.pin_radius
        foot = np.clip(points[:, 1], -half, half)
        rel = np.stack([points[:, 0], points[:, 1] - foot], axis=-1)
        r = np.hypot(rel[:, 0], rel[:, 1])
        normal = rel / np.maximum(r, 1e-300)[:, None]
        round_part = np.abs(points[:, 1]) > half
        return (
            r - self.pin_radius,
            normal,
            np.where(round_part, 1.0 / self.pin_radius, 0.0),
        )

    def outline(self, count: int) -> Array:
        """Points at equal steps of the arc length."""
        r, half = self.pin_radius, self.major - self.pin_radius
        quarter, straight = 0.5 * np.pi * r, 2.0 * half
        s = np.linspace(0.0, 4.0 * quarter + 2.0 * straight, count)
        # the second half of the outline is the first one turned by pi
        turned = s > 2.0 * quarter + straight
        s = np.where(turned, s - 2.0 * quarter - straight, s)
        down = np.clip(s - quarter, 0.0, straight)
        angle = (s - down) / r
        points = np.stack([-r * np.sin(angle), r * np.cos(angle) + half - down], -1)
        return np.where(turned[:, None], -points, points)


def lobe_height(design: Design) -> float:
    """Radial deflection at the lobe, half of m (z_cs - z_fs) [m]."""
    drive = design.drive
    difference = drive.teeth_circular_spline - drive.teeth_flexspline
    return 0.5 * drive.module_mm * difference * mm


def wave_generator(design: Design) -> WaveGenerator:
    """Wave generator of a design.

    Raises:
        DesignError: If the kind is not available or does not fit.
    """
    spec = design.wave_generator
    r, w0 = design.flexspline_inner_radius, lobe_height(design)  # (3.1)
    if spec.kind not in ("elliptical", "simplified"):
        raise DesignError(
            f"{design.drive.name}: wave_generator.kind = {spec.kind!r} cannot be built "
            "yet; available: 'elliptical', 'simplified'"
        )
    minor = spec.minor_axis_coefficient * (r - w0)
    if spec.kind == "elliptical":
        return Elliptical(major=r + w0, minor=minor)
    return Simplified(major=r + w0, pin_radius=minor)

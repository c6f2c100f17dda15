"""The simplified wave generator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.wave_generators.curve import ClosedCurve, Kind
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class Simplified(ClosedCurve):
    """Two semicircles joined by straight lines (thesis eqs 3.2 and 3.3)."""

    major: float
    """Semi-major axis a [m]."""
    pin_radius: float
    """Radius of the semicircles [m]."""

    @property
    def perimeter(self) -> float:
        """Length of two semicircles and two straight lines [m]."""
        straight = 2.0 * (self.major - self.pin_radius)
        return 2.0 * (np.pi * self.pin_radius + straight)

    @cached_property
    def rows(self) -> Array:
        """Description for compiled loops; see :attr:`ClosedCurve.rows`."""
        return np.array(
            [[Kind.SIMPLIFIED, self.major, self.pin_radius, 0.0, 0.0, 0.0, 0.0]]
        )

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`ClosedCurve.evaluate`.

        From +y, the outline consists of a quarter circle, a line, a semicircle, a line
        and a quarter circle.
        """
        r, half = self.pin_radius, self.major - self.pin_radius
        quarter, straight = 0.5 * np.pi * r, 2.0 * half
        along = self._within(s)
        # the second half of the outline is the first half rotated by pi
        turned = along > 0.5 * self.perimeter
        along = np.where(turned, along - 0.5 * self.perimeter, along)
        down = np.clip(along - quarter, 0.0, straight)
        angle = (along - down) / r
        normals = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        points = r * normals
        points[..., 1] += half - down
        sign = np.where(turned, -1.0, 1.0)[..., None]
        line = (along > quarter) & (along < quarter + straight)
        return sign * points, sign * normals, np.where(line, 0.0, 1.0 / r)

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance, normal and curvature; see :class:`ClosedCurve`.

        The distance is that to the line between the two centres, minus the radius.
        """
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

"""The four-roller wave generator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.wave_generators.chain import Chain
from swgjoint.gear.wave_generators.curve import ClosedCurve
from swgjoint.gear.wave_generators.pieces import Arc, Line, OutlinePiece
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class FourRoller(ClosedCurve):
    """Two opposite pairs of rollers that touch the circle of radius a (thesis 3.2.4).

    Contact occurs at the nearest roller. The arc length, however, is measured along a
    taut band around the rollers, whose straight parts do not touch a roller.
    """

    major: float
    """Radius a of the circle that encloses the rollers [m]."""
    aperture: float
    """Angle beta of the roller axes from the major axis [rad]."""
    roller_radius: float
    """Radius of a roller [m]."""

    @property
    def centre(self) -> tuple[float, float]:
        """Position of the roller axis in the first quadrant [m]."""
        reach = self.major - self.roller_radius
        return reach * sin(self.aperture), reach * cos(self.aperture)

    @cached_property
    def band(self) -> Chain:
        """Taut band around the four rollers."""
        (x, y), r = self.centre, self.roller_radius
        # counter-clockwise from +y: half of the top line, two rollers with the side
        # line between them, half of the bottom line, and the same on the right side
        half: list[OutlinePiece] = [
            Line(start=(0.0, y + r), end=(-x, y + r)),
            Arc(centre=(-x, y), radius=r, start=0.5 * pi, end=pi),
            Line(start=(-x - r, y), end=(-x - r, -y)),
            Arc(centre=(-x, -y), radius=r, start=pi, end=1.5 * pi),
            Line(start=(-x, -y - r), end=(0.0, -y - r)),
            Line(start=(0.0, -y - r), end=(x, -y - r)),
            Arc(centre=(x, -y), radius=r, start=1.5 * pi, end=2.0 * pi),
            Line(start=(x + r, -y), end=(x + r, y)),
            Arc(centre=(x, y), radius=r, start=0.0, end=0.5 * pi),
            Line(start=(x, y + r), end=(0.0, y + r)),
        ]
        return Chain(pieces=tuple(half))

    @property
    def perimeter(self) -> float:
        """Length of the taut band [m]."""
        return self.band.perimeter

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures of the taut band at arc lengths s."""
        return self.band.evaluate(s)

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance to the nearest roller, with normal and curvature of it.

        The points are mirrored into the first quadrant, which contains one roller.
        """
        rel = np.abs(points) - np.asarray(self.centre)
        r = np.hypot(rel[:, 0], rel[:, 1])
        normals = rel / np.maximum(r, 1e-300)[:, None]
        normals *= np.where(points < 0.0, -1.0, 1.0)
        return (
            r - self.roller_radius,
            normals,
            np.full(len(points), 1.0 / self.roller_radius),
        )

    def outlines(self, count: int) -> list[Array]:
        """Outlines of the four rollers, counter-clockwise from the first quadrant."""
        angle = np.linspace(0.0, 2.0 * np.pi, count)
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        x, y = self.centre
        centres = ((x, y), (-x, y), (-x, -y), (x, -y))
        return [self.roller_radius * circle + np.asarray(c) for c in centres]

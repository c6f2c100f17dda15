"""The elliptical wave generator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.wave_generators.curve import ClosedCurve, Kind
from swgjoint.kernels import kernels
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class Elliptical(ClosedCurve):
    """Ellipse with the semi-major axis a along y (thesis eqs 3.3 and 3.4).

    The eccentric angle t is counted from +y, counter-clockwise: the point of the
    ellipse at t is (-b sin t, a cos t).
    """

    major: float
    """Semi-major axis a [m]."""
    minor: float
    """Semi-minor axis b [m]."""

    @cached_property
    def perimeter(self) -> float:
        """Length of the outline by a complete elliptic integral [m]."""
        from scipy.special import ellipe

        return float(4.0 * self.minor * ellipe(self._parameter))

    @property
    def _parameter(self) -> float:
        """Parameter m of the elliptic integral, ds = b sqrt(1 - m sin^2 t) dt [-]."""
        return 1.0 - (self.major / self.minor) ** 2

    @cached_property
    def rows(self) -> Array:
        """Description for compiled loops; see :attr:`ClosedCurve.rows`."""
        return np.array([[Kind.ELLIPSE, self.major, self.minor, 0.0, 0.0, 0.0, 0.0]])

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`ClosedCurve.evaluate`.

        Newton's method inverts the elliptic integral of the arc length.
        """
        from scipy.special import ellipeinc

        a, b = self.major, self.minor
        wanted = self._within(s)
        t = 2.0 * np.pi * wanted / self.perimeter
        for _ in range(20):
            speed = np.hypot(b * np.cos(t), a * np.sin(t))
            step = (b * ellipeinc(t, self._parameter) - wanted) / speed
            t = t - step
            if np.max(np.abs(step), initial=0.0) < 1e-15:
                break
        sin, cos = np.sin(t), np.cos(t)
        size = np.hypot(a * sin, b * cos)
        points = np.stack([-b * sin, a * cos], axis=-1)
        normals = np.stack([-a * sin / size, b * cos / size], axis=-1)
        return points, normals, a * b / size**3

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance, normal and curvature; see :class:`ClosedCurve`.

        Newton's method solves for the eccentric angle of the foot. Points are mirrored
        into one quadrant, and the result is mirrored back. A step that leaves the
        bracket is replaced by bisection.
        """
        a, b = self.major, self.minor
        if (native := kernels()) is not None:
            found = np.empty((len(points), 4))
            native.outline_distance(np.ascontiguousarray(points), self.rows, found)
            return found[:, 0], found[:, 1:3], found[:, 3]
        x, y = np.abs(points[:, 0]), np.abs(points[:, 1])  # x = b sin t, y = a cos t
        t = np.arctan2(a * x, b * y)
        low, high = np.zeros_like(t), np.full_like(t, 0.5 * np.pi)
        for _ in range(60):
            sin, cos = np.sin(t), np.cos(t)
            dx, dy = x - b * sin, y - a * cos
            # zero of the projection on the tangent (b cos t, -a sin t)
            f = dx * b * cos - dy * a * sin
            slope = -((b * cos) ** 2) - (a * sin) ** 2 - dx * b * sin - dy * a * cos
            low, high = np.where(f >= 0.0, t, low), np.where(f <= 0.0, t, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                new = t - f / slope
            inside = (new >= low) & (new <= high)
            new = np.where(inside, new, 0.5 * (low + high))
            change = np.max(np.abs(new - t), initial=0.0)
            t = new
            if change < 1e-15:
                break
        sin, cos = np.sin(t), np.cos(t)
        size = np.hypot(a * sin, b * cos)
        normal = np.stack([a * sin / size, b * cos / size], axis=-1)
        distance = (x - b * sin) * normal[:, 0] + (y - a * cos) * normal[:, 1]
        signs = np.where(points < 0.0, -1.0, 1.0)
        return distance, normal * signs, a * b / size**3

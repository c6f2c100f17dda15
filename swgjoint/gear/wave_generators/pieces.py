"""Arcs, straight lines and parabolas from which outlines are composed.

Every piece is traversed counter-clockwise around the axis of rotation and is convex or
straight. Its parameter is the arc length from its start.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import asinh, cos, hypot, sin, sqrt
from typing import Protocol

import numpy as np

from swgjoint.gear.wave_generators.curve import Kind
from swgjoint.typing import Array

Point = tuple[float, float]


class OutlinePiece(Protocol):
    """One smooth part of an outline."""

    @property
    def length(self) -> float:
        """Arc length [m]."""
        ...

    @property
    def row(self) -> tuple[float, ...]:
        """Row of seven values, see :attr:`ClosedCurve.rows`."""
        ...

    def evaluate_at(self, s: Array) -> tuple[Array, Array, Array]:
        """Points (n, 2) [m], outward normals (n, 2) and curvatures (n,) [1/m].

        Args:
            s: Arc lengths from the start of the piece (n,) [m].
        """
        ...

    def foot(self, points: Array) -> Array:
        """Arc length of the point of the piece nearest to each given point (n,) [m].

        Args:
            points: Points (n, 2) [m], outside the outline, or inside by less than the
                radius of curvature of the piece.
        """
        ...

    def largest_radius(self) -> float:
        """Largest distance of the piece from the axis [m]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Arc:
    """Circular arc from the normal direction ``start`` to ``end`` > ``start``."""

    centre: Point
    """Centre [m]."""
    radius: float
    """Radius [m]."""
    start: float
    """Direction of the normal at the start [rad]."""
    end: float
    """Direction of the normal at the end [rad]."""

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return self.radius * (self.end - self.start)

    @property
    def row(self) -> tuple[float, ...]:
        """Row of seven values; see :attr:`OutlinePiece.row`."""
        return Kind.ARC, *self.centre, self.radius, self.start, self.end, 0.0

    def evaluate_at(self, s: Array) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`OutlinePiece.evaluate_at`."""
        angle = self.start + s / self.radius
        normals = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        points = np.asarray(self.centre) + self.radius * normals
        return points, normals, np.full(np.shape(s), 1.0 / self.radius)

    def foot(self, points: Array) -> Array:
        """Arc length of the nearest point (n,) [m]; see :meth:`OutlinePiece.foot`."""
        middle, half = 0.5 * (self.start + self.end), 0.5 * (self.end - self.start)
        rel = points - np.asarray(self.centre)
        c, d = cos(middle), sin(middle)  # angle from the middle, away from branch cuts
        angle = np.arctan2(rel[:, 1] * c - rel[:, 0] * d, rel[:, 0] * c + rel[:, 1] * d)
        return np.asarray(self.radius * (np.clip(angle, -half, half) + half))

    def largest_radius(self) -> float:
        """Largest distance of the piece from the axis [m]."""
        ends, normals, _ = self.evaluate_at(np.array([0.0, self.length]))
        # the point of the circle farthest from the axis is on the ray through its
        # centre; it counts if it is on the arc
        ox, oy = self.centre
        side = normals[:, 0] * oy - normals[:, 1] * ox
        if side[0] >= 0.0 >= side[1]:
            return hypot(ox, oy) + self.radius
        return float(np.hypot(*ends.T).max())


@dataclass(frozen=True, kw_only=True)
class Line:
    """Straight line between two points."""

    start: Point
    """First point [m]."""
    end: Point
    """Last point [m]."""

    @cached_property
    def length(self) -> float:
        """Arc length [m]."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def row(self) -> tuple[float, ...]:
        """Row of seven values; see :attr:`OutlinePiece.row`."""
        return Kind.LINE, *self.start, *self.end, 0.0, 0.0

    @cached_property
    def _direction(self) -> Array:
        return np.subtract(self.end, self.start) / self.length

    def evaluate_at(self, s: Array) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`OutlinePiece.evaluate_at`."""
        s = np.asarray(s, dtype=float)
        direction = self._direction
        points = np.asarray(self.start) + s[:, None] * direction
        normals = np.broadcast_to([direction[1], -direction[0]], points.shape)
        return points, normals, np.zeros(s.shape)

    def foot(self, points: Array) -> Array:
        """Arc length of the nearest point (n,) [m]; see :meth:`OutlinePiece.foot`."""
        along = (points - np.asarray(self.start)) @ self._direction
        return np.asarray(np.clip(along, 0.0, self.length))

    def largest_radius(self) -> float:
        """Largest distance of the piece from the axis [m]."""
        return max(hypot(*self.start), hypot(*self.end))


@dataclass(frozen=True, kw_only=True)
class Parabola:
    r"""Part of the parabola apex + R(turn) (x, -a_p x^2) from x = start down to end.

    R is the matrix of a rotation. The arc length from the apex to x is
    :math:`(u\sqrt{1 + u^2} + \sinh^{-1} u)/(4 a_p)` with u = 2 a_p x.
    """

    apex: Point
    """Apex [m]."""
    coefficient: float
    """Coefficient a_p [1/m]."""
    start: float
    """Local coordinate x of the first point [m]."""
    end: float
    """Local coordinate x of the last point [m], smaller than ``start``."""
    turn: float = 0.0
    """Rotation about the apex, counter-clockwise [rad]."""

    def _from_apex(self, x: float) -> float:
        """Arc length from the apex to the local coordinate x, with its sign [m]."""
        u = 2.0 * self.coefficient * x
        return (u * sqrt(1.0 + u * u) + asinh(u)) / (4.0 * self.coefficient)

    @cached_property
    def length(self) -> float:
        """Arc length [m]."""
        return self._from_apex(self.start) - self._from_apex(self.end)

    @property
    def row(self) -> tuple[float, ...]:
        """Row of seven values; see :attr:`OutlinePiece.row`."""
        limits = self.start, self.end
        return Kind.PARABOLA, *self.apex, self.coefficient, *limits, self.turn

    @cached_property
    def _rotation(self) -> Array:
        """Matrix whose rows are the directions of the local axes."""
        c, d = cos(self.turn), sin(self.turn)
        return np.array([[c, d], [-d, c]])

    def evaluate_at(self, s: Array) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`OutlinePiece.evaluate_at`.

        Newton's method inverts the arc length.
        """
        a = self.coefficient
        wanted = self._from_apex(self.start) - np.asarray(s, dtype=float)
        u = 2.0 * a * wanted
        for _ in range(30):
            speed = np.sqrt(1.0 + u * u)
            step = (0.5 * (u * speed + np.arcsinh(u)) - 2.0 * a * wanted) / speed
            u = u - step
            if np.max(np.abs(step), initial=0.0) < 1e-15:
                break
        x = u / (2.0 * a)
        size = np.sqrt(1.0 + u * u)
        local = np.stack([x, -0.5 * u * x], axis=-1)
        normals = np.stack([u / size, 1.0 / size], axis=-1)  # thesis eq. (3.7)
        points = np.asarray(self.apex) + local @ self._rotation
        return points, normals @ self._rotation, 2.0 * a / size**3

    def foot(self, points: Array) -> Array:
        """Arc length of the nearest point (n,) [m]; see :meth:`OutlinePiece.foot`.

        The perpendicular to the parabola through the local point (p, q) meets it at the
        largest root of x^3 + c x = h with c = (1 + 2 a q)/(2 a^2) and
        h = |p|/(2 a^2). Newton's method starts above this root, where the cubic is
        convex, and converges to it monotonically.
        """
        a = self.coefficient
        p, q = ((points - np.asarray(self.apex)) @ self._rotation.T).T
        c, h = (1.0 + 2.0 * a * q) / (2.0 * a * a), np.abs(p) / (2.0 * a * a)
        x = np.cbrt(h) + np.sqrt(np.maximum(-c, 0.0))
        x = np.where(c > 0.0, np.minimum(x, h / np.where(c > 0.0, c, 1.0)), x)
        for _ in range(60):
            slope = np.maximum(3.0 * x * x + c, 1e-300)
            step = (x * (x * x + c) - h) / slope
            x = x - step
            if np.all(np.abs(step) <= 1e-15 * np.abs(x)):
                break
        x = np.copysign(x, p)
        u = 2.0 * a * np.clip(x, self.end, self.start)
        along = (u * np.sqrt(1.0 + u * u) + np.arcsinh(u)) / (4.0 * a)
        return np.asarray(self._from_apex(self.start) - along)

    def largest_radius(self) -> float:
        """Largest distance of the piece from the axis [m]."""
        a = self.coefficient
        ox, oy = -self._rotation @ np.asarray(self.apex)
        roots = np.roots([2.0 * a * a, 0.0, 1.0 + 2.0 * a * oy, -ox])
        real = roots.real[np.abs(roots.imag) < 1e-9 * np.abs(roots).max()]
        x = np.clip(np.append(real, [self.start, self.end]), self.end, self.start)
        return float(np.hypot(x - ox, a * x * x + oy).max())

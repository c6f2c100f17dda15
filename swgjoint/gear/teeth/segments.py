"""Pieces of a flank: circular arcs and straight lines, traversed from tip to root."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, sin
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array

Bools = NDArray[np.bool_]
Point = tuple[float, float]


class Piece(Protocol):
    """Interface of the segments of a flank.

    ``side`` is +1 for an external tooth and -1 for an internal tooth. On the way from
    tip to root along the right flank, the steel is on the right-hand side of the path
    for an external tooth and on the left-hand side for an internal tooth.
    """

    @property
    def name(self) -> str:
        """Name within the chain, e.g. ``addendum``."""
        ...

    @property
    def start(self) -> Point:
        """First point [m]."""
        ...

    @property
    def end(self) -> Point:
        """Last point [m]."""
        ...

    @property
    def length(self) -> float:
        """Arc length [m]."""
        ...

    @property
    def radius(self) -> float:
        """Radius of an arc; zero for other segments [m]."""
        ...

    @property
    def edge(self) -> bool:
        """Whether the segment starts at an edge instead of a tangent junction."""
        ...

    def evaluate_at(self, s: Array, side: float) -> tuple[Array, Array, Array]:
        """Points (n, 2) [m], outward unit normals (n, 2) and curvatures (n,) [1/m].

        Curvatures are positive where the steel is convex.

        Args:
            s: Arc lengths from the start of the segment (n,) [m].
            side: +1 for an external tooth, -1 for an internal tooth.
        """
        ...

    def project(
        self, points: Array, side: float
    ) -> tuple[Array, Array, Array | float, Bools]:
        """Distances of points from the segment along its normal.

        Args:
            points: Points of shape (n, 2) [m].
            side: +1 for an external tooth, -1 for an internal tooth.

        Returns:
            Distances (n,) [m], positive outside the steel; outward normals (n, 2) and
            curvatures [1/m] at the feet of the perpendiculars, one value for arcs and
            lines; whether the feet are on the segment (n,).
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One circular arc or straight line of a flank, traversed from tip to root."""

    name: str
    """Name within the chain, e.g. ``addendum``."""
    start: Point
    """First point [m]."""
    end: Point
    """Last point [m]."""
    length: float
    """Arc length [m]."""
    centre: Point = (0.0, 0.0)
    """Centre of an arc [m]."""
    radius: float = 0.0
    """Radius of an arc; zero for a straight line [m]."""
    convex: bool = True
    """Whether the centre of the arc is on the side of the steel."""
    angle_start: float = 0.0
    """Direction of the first point from the centre [rad]."""
    angle_end: float = 0.0
    """Direction of the last point from the centre [rad]."""
    edge: bool = False
    """Whether the segment starts at an edge instead of a tangent junction."""

    @property
    def curvature(self) -> float:
        """Signed curvature, positive where the steel is convex [1/m]."""
        if self.radius == 0.0:
            return 0.0
        return (1.0 if self.convex else -1.0) / self.radius

    def _normal_of_line(self, side: float) -> tuple[Array, Array]:
        start, end = np.array(self.start), np.array(self.end)
        direction = (end - start) / self.length
        return direction, side * np.array([-direction[1], direction[0]])

    def evaluate_at(self, s: Array, side: float) -> tuple[Array, Array, Array]:
        """Points, outward normals and curvatures; see :class:`Piece`.

        Args:
            s: Arc lengths from the start of the segment (n,) [m].
            side: +1 for an external tooth, -1 for an internal tooth.
        """
        t = s / self.length
        if self.radius == 0.0:
            start, end = np.array(self.start), np.array(self.end)
            _, normal = self._normal_of_line(side)
            points = start + t[:, None] * (end - start)
            normals = np.broadcast_to(normal, points.shape)
        else:
            angle = self.angle_start + t * (self.angle_end - self.angle_start)
            radial = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
            points = np.array(self.centre) + self.radius * radial
            normals = radial if self.convex else -radial
        return points, normals, np.full(t.shape, self.curvature)

    def project(self, points: Array, side: float) -> tuple[Array, Array, float, Bools]:
        """Distances of points from the line or arc; see :meth:`Piece.project`.

        Args:
            points: Points of shape (n, 2) [m].
            side: +1 for an external tooth, -1 for an internal tooth.
        """
        if self.radius == 0.0:
            direction, normal = self._normal_of_line(side)
            rel = points - np.array(self.start)
            along = rel @ direction
            inside = (along >= 0.0) & (along <= self.length)
            return rel @ normal, np.broadcast_to(normal, rel.shape), 0.0, inside
        rel = points - np.array(self.centre)
        r = np.hypot(rel[:, 0], rel[:, 1])
        middle = 0.5 * (self.angle_start + self.angle_end)
        half = 0.5 * abs(self.angle_end - self.angle_start)
        # angle from the middle of the arc, away from branch cuts
        c, d = cos(middle), sin(middle)
        angle = np.arctan2(rel[:, 1] * c - rel[:, 0] * d, rel[:, 0] * c + rel[:, 1] * d)
        inside = np.abs(angle) <= half * (1.0 + 1e-9)
        sign = 1.0 if self.convex else -1.0
        normal = sign * rel / np.maximum(r, 1e-300)[:, None]
        return sign * (r - self.radius), normal, self.curvature, inside


def arc(
    name: str,
    centre: Point,
    radius: float,
    start: float,
    end: float,
    convex: bool,
    *,
    edge: bool = False,
) -> Segment:
    """Arc between two directions from its centre.

    Args:
        name: Name within the chain.
        centre: Centre [m].
        radius: Radius [m].
        start: Direction of the first point from the centre [rad].
        end: Direction of the last point from the centre [rad].
        convex: Whether the centre is on the side of the steel.
        edge: Whether the arc starts at an edge instead of a tangent junction.
    """

    def at(angle: float) -> Point:
        return centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)

    return Segment(
        name=name,
        start=at(start),
        end=at(end),
        length=radius * abs(end - start),
        centre=centre,
        radius=radius,
        convex=convex,
        angle_start=start,
        angle_end=end,
        edge=edge,
    )


def line(name: str, start: Point, end: Point) -> Segment:
    """Straight line between two points.

    Args:
        name: Name within the chain.
        start: First point [m].
        end: Last point [m].
    """
    length = hypot(end[0] - start[0], end[1] - start[1])
    return Segment(name=name, start=start, end=end, length=length)

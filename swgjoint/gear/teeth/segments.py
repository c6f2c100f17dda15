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
    """What a flank needs to know of a segment.

    ``side`` is +1 for an external tooth and -1 for an internal one: from tip to root
    along the right flank the steel of an external tooth lies on the right hand.
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
        """Radius of an arc, zero for anything else [m]."""
        ...

    @property
    def edge(self) -> bool:
        """Whether the segment starts at an edge, not tangent to the one before."""
        ...

    def evaluate_at(self, s: Array, side: float) -> tuple[Array, Array, Array]:
        """Points (n, 2) [m], outward normals (n, 2), curvatures (n,) [1/m]."""
        ...

    def project(
        self, points: Array, side: float
    ) -> tuple[Array, Array, Array | float, Bools]:
        """Signed distance, normal and curvature at the foot, whether there is one."""
        ...


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One circular arc or straight line of a flank, traversed from tip to root."""

    name: str
    start: Point
    end: Point
    length: float
    centre: Point = (0.0, 0.0)
    radius: float = 0.0
    """Zero for a straight line [m]."""
    convex: bool = True
    """Whether the centre of the arc lies on the side of the steel."""
    angle_start: float = 0.0
    angle_end: float = 0.0
    """Directions of the end points from the centre [rad]."""
    edge: bool = False
    """Whether it starts at an edge of the steel, not tangent to the one before."""

    @property
    def curvature(self) -> float:
        """Signed curvature, positive where the steel bulges out [1/m]."""
        if self.radius == 0.0:
            return 0.0
        return (1.0 if self.convex else -1.0) / self.radius

    def _normal_of_line(self, side: float) -> tuple[Array, Array]:
        start, end = np.array(self.start), np.array(self.end)
        direction = (end - start) / self.length
        return direction, side * np.array([-direction[1], direction[0]])

    def evaluate_at(self, s: Array, side: float) -> tuple[Array, Array, Array]:
        """Points, outward normals and curvatures at arc length s from the start."""
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
        """Foot of the perpendicular on the line or the arc."""
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
        # angle from the middle of the arc, free of branch cuts
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
    """Arc between two directions from its centre [rad]."""

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
    """Straight line between two points."""
    length = hypot(end[0] - start[0], end[1] - start[1])
    return Segment(name=name, start=start, end=end, length=length)

"""Tooth flanks as chains of circular arcs, straight lines and smooth curves.

A flank is described in the frame of its tooth, which is centred on the +y axis with the
gear axis at the origin. The chain represents the right flank (x > 0) and runs from the
middle of the top land to the middle of the root land. Normals point out of the steel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swgjoint.gear.teeth.segments import Piece, Segment
from swgjoint.gear.teeth.smooth_curve import SmoothCurve
from swgjoint.typing import Array, Index

TANGENCY_RAD = 1e-10
"""Largest corner angle at a tangent junction of two segments [rad]."""


@dataclass(frozen=True, kw_only=True)
class Junction:
    """Junction of two segments, evaluated on both sides."""

    gap: float
    """Distance between the end of a segment and the start of the next [m]."""
    corner: float
    """Angle between the normals of both segments [rad]."""
    edge: bool
    """Whether the profile has an edge there by definition, such as an involute tip."""


@dataclass(frozen=True, kw_only=True)
class ToothProfile:
    """Right half of one tooth, from the middle of its top land to that of the root."""

    member: str
    """``flexspline`` or ``circular_spline``."""
    teeth: int
    """Number of teeth."""
    internal: bool
    """Whether the teeth are internal."""
    pitch_radius: float
    """Pitch radius [m]."""
    addendum_radius: float
    """Radius of the tip circle [m]."""
    dedendum_radius: float
    """Radius of the root circle [m]."""
    segments: tuple[Piece, ...]
    """Segments from tip to root."""
    straight_length: float
    """Length of the straight segment [m]; zero if there is none."""

    @property
    def half_pitch(self) -> float:
        """Half the angular pitch pi/N [rad]."""
        return pi / self.teeth

    @property
    def side(self) -> float:
        """+1 for external teeth, -1 for internal teeth."""
        return -1.0 if self.internal else 1.0

    @cached_property
    def stations(self) -> Array:
        """Arc length at the ends of the segments (n_segments + 1,) [m]."""
        stations = np.concatenate([[0.0], np.cumsum([p.length for p in self.segments])])
        stations.setflags(write=False)
        return stations

    @property
    def contact_range(self) -> tuple[float, float]:
        """Arc lengths at the end of the top land and at the start of the root land [m].

        The part of the profile between them can touch the mating tooth.
        """
        s = self.stations
        low = s[1] if self.segments[0].name == "top_land" else s[0]
        high = s[-2] if self.segments[-1].name == "root_land" else s[-1]
        return float(low), float(high)

    def range_of(self, first: str, last: str) -> tuple[float, float]:
        """Arc length at the start of one segment and at the end of another [m].

        Args:
            first: Name of the first segment.
            last: Name of the last segment.

        Raises:
            ValueError: If the profile has no segment of one of these names.
        """
        names = [p.name for p in self.segments]
        s = self.stations
        return float(s[names.index(first)]), float(s[names.index(last) + 1])

    def junctions(self) -> tuple[Junction, ...]:
        """Gap and corner angle at the junctions of consecutive segments."""
        junctions = []
        for left, right in pairwise(self.segments):
            (end,), (before,), _ = left.evaluate_at(np.array([left.length]), self.side)
            (start,), (after,), _ = right.evaluate_at(np.array([0.0]), self.side)
            cross = before[0] * after[1] - before[1] * after[0]
            corner = abs(float(np.arctan2(cross, before @ after)))
            gap = float(np.hypot(*(end - start)))
            junctions.append(Junction(gap=gap, corner=corner, edge=right.edge))
        return tuple(junctions)

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, outward normals and signed curvatures at given arc lengths.

        Args:
            s: Arc lengths from the middle of the top land (n,) [m].

        Returns:
            Points (n, 2) [m]; outward unit normals (n, 2); curvatures (n,) [1/m],
            positive where the steel is convex.
        """
        s = np.asarray(s, dtype=float)
        stations = self.stations
        index = np.clip(
            np.searchsorted(stations, s, side="right") - 1, 0, len(self.segments) - 1
        )
        if self._arcs is not None:
            return self._at_once(s - stations[index], index)
        points = np.empty((*s.shape, 2))
        normals = np.empty((*s.shape, 2))
        curvature = np.empty(s.shape)
        for k, part in enumerate(self.segments):
            here = index == k
            if not here.any():
                continue
            points[here], normals[here], curvature[here] = part.evaluate_at(
                s[here] - stations[k], self.side
            )
        return points, normals, curvature

    @cached_property
    def _arcs(self) -> Array | None:
        """Parameters of arcs and lines; None if there is a piece of another kind.

        With the angle a = first + rate s, the point is base + s way + radius (cos a,
        sin a) and the normal is sign (cos a, sin a); ``radius`` and ``rate`` are zero
        for a line. The rows contain base x, base y, way x, way y, radius, first, rate,
        sign and curvature (9, n_segments).
        """
        columns = []
        for part in self.segments:
            if not isinstance(part, Segment):
                return None
            if part.radius == 0.0:
                way = (np.array(part.end) - np.array(part.start)) / part.length
                turn = float(np.arctan2(self.side * way[0], -self.side * way[1]))
                columns.append([*part.start, *way, 0.0, turn, 0.0, 1.0, 0.0])
                continue
            rate = (part.angle_end - part.angle_start) / part.length
            sign = 1.0 if part.convex else -1.0
            arc = [*part.centre, 0.0, 0.0, part.radius, part.angle_start, rate]
            columns.append([*arc, sign, part.curvature])
        return np.array(columns).T

    @cached_property
    def pieces(self) -> Array:
        """Arcs, lines and smooth curves from tip to root.

        Columns: start x, y, end x, y, length, centre x, y, radius (zero except for an
        arc), sign (-1 for a concave arc), angle of the start and of the end from the
        centre (n_segments, 11) [m, rad]. The last six are zero for a smooth curve.
        """
        rows = []
        for part in self.segments:
            row = [*part.start, *part.end, part.length, part.radius]
            of_arc = [0.0] * 5
            if isinstance(part, Segment):
                sign = 1.0 if part.convex else -1.0
                of_arc = [*part.centre, sign, part.angle_start, part.angle_end]
            rows.append([*row[:5], *of_arc[:2], row[5], *of_arc[2:]])
        return np.array(rows)

    @cached_property
    def curves(self) -> tuple[Index, Array, Array]:
        """Smooth curves among the pieces, one after the other.

        Returns:
            Number of intervals of every piece, zero for an arc or a line (n_segments,);
            arc lengths of the nodes of the curves [m]; and their coefficients
            (n_intervals, 6, 2) [m], see :class:`.smooth_curve.SmoothCurve`.
        """
        smooth = [part for part in self.segments if isinstance(part, SmoothCurve)]
        intervals = [
            len(part.coefficients) if isinstance(part, SmoothCurve) else 0
            for part in self.segments
        ]
        return (
            np.array(intervals, dtype=np.int64),
            np.concatenate([np.zeros(0), *(part.stations for part in smooth)]),
            np.concatenate([np.zeros((0, 6, 2)), *(p.coefficients for p in smooth)]),
        )

    @cached_property
    def edges(self) -> Array:
        """Edges of the chain: vertex [m], directions before and after it (n, 6)."""
        rows = [np.concatenate(edge) for edge in self._edges]
        return np.array(rows).reshape(len(rows), 6)

    def _at_once(
        self, along: Array, index: NDArray[np.int64]
    ) -> tuple[Array, Array, Array]:
        """Result of :meth:`evaluate` without a loop over the segments.

        ``index`` is the segment of each point and ``along`` the arc length from its
        start [m].
        """
        assert self._arcs is not None
        x, y, way_x, way_y, radius, first, rate, sign, bend = self._arcs[:, index]
        angle = first + rate * along
        cos, sin = np.cos(angle), np.sin(angle)
        points = np.empty((*along.shape, 2))
        normals = np.empty((*along.shape, 2))
        points[..., 0] = x + along * way_x + radius * cos
        points[..., 1] = y + along * way_y + radius * sin
        normals[..., 0], normals[..., 1] = sign * cos, sign * sin
        return points, normals, bend

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance of points from the flank, with normal and curvature.

        The result refers to the closest foot on any segment or edge. The distance is
        infinite for points beyond the ends of the chain, which have no foot on it.

        Args:
            points: Points of shape (n, 2) [m].

        Returns:
            Distances (n,) [m], positive outside the steel; outward normals (n, 2) and
            curvatures (n,) [1/m] at the foot.
        """
        n = len(points)
        best = np.full(n, np.inf)
        normals = np.zeros((n, 2))
        curvature = np.zeros(n)
        for part in self.segments:
            distance, normal, bend, inside = part.project(points, self.side)
            take = inside & (np.abs(distance) < np.abs(best))
            best[take] = distance[take]
            normals[take] = normal[take]
            curvature[take] = bend if isinstance(bend, float) else bend[take]
        for vertex, before, after in self._edges:
            # between the two normals at an edge, the edge itself is the closest point
            rel = points - vertex
            r = np.hypot(rel[:, 0], rel[:, 1])
            wedge = (rel @ before >= 0.0) & (rel @ after <= 0.0)
            take = wedge & (r < np.abs(best)) & (r > 0.0)
            best[take] = r[take]
            normals[take] = rel[take] / r[take, None]
            curvature[take] = 1.0 / np.maximum(r[take], 1e-9)
        return best, normals, curvature

    @cached_property
    def _edges(self) -> tuple[tuple[Array, Array, Array], ...]:
        """Edge points [m] with the directions of the chain before and after them."""
        edges = []
        for left, right in pairwise(self.segments):
            if right.edge:
                (vertex,), (after,), _ = right.evaluate_at(np.array([0.0]), self.side)
                _, (before,), _ = left.evaluate_at(np.array([left.length]), self.side)
                travel = [self.side * np.array([n[1], -n[0]]) for n in (before, after)]
                edges.append((vertex, travel[0], travel[1]))
        return tuple(edges)

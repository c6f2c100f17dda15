r"""Master nodes: few points whose displacements carry those of faces and sections.

The displacement of a cut face is a polynomial along the meridian of each segment and
through the wall; that of a section between segments is a polynomial around the sector
and through the wall. Both contain every linear field and add up to one, so that master
nodes turn like points of a body: the corotational model needs no more than their
positions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

from swgjoint.fe.solid.strip_mesh import SegmentMesh, StripMesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Orders:
    """Degrees of the polynomials; no higher than the nodes of a mesh can tell apart."""

    teeth: int = 6
    """Along the face width."""
    cup: int = 3
    """Along each segment of the cup."""
    at_teeth: int = 4
    """Around the sector where the cup meets the teeth: the rim bends between teeth."""
    around: int = 2
    """Around the sector at the other sections."""
    rim: int = 2
    """Through the rim between two teeth. It gets thinner where bending stretches it;
    straight lines would forbid that, and raise the largest tensile stress of the teeth
    by up to a sixth. A cubic brings single nodes closer, too, for 1.4 times the time.
    """
    wall: int = 1
    """Through the wall of the cup, whose largest stress straight lines raise by a
    tenth; a parabola takes 2.5 times the time of an iteration."""


@cache
def lobatto(order: int) -> Array:
    """Points from 0 to 1, ends included, between which polynomials stay tame."""
    inner = np.asarray(Legendre.basis(order).deriv().roots(), dtype=np.float64)
    return np.concatenate([[0.0], 0.5 * (1.0 + np.sort(inner)), [1.0]])


def lagrange(points: Array, x: Array) -> Array:
    """Values of the Lagrange polynomials of the points (n_x, n_points)."""
    weights = np.empty((len(x), len(points)))
    for k, point in enumerate(points):
        others = np.delete(points, k)
        weights[:, k] = np.prod((x[:, None] - others) / (point - others), axis=1)
    return weights


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentMasters:
    """How the boundary of one segment follows the masters of the strip."""

    boundary: Index
    """Node numbers of faces and sections (n_boundary,)."""
    masters: Index
    """Of the strip, those that this segment hangs on (n_m,)."""
    weight: Array
    """Displacement of the boundary by that of these masters (n_boundary, n_m)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Masters:
    """Master nodes of a strip: first face, sections, last face."""

    position: Array
    """In the frame of the tooth (n, 3) [m]."""
    face_size: int
    segments: tuple[SegmentMasters, ...]
    held: Index
    """Masters of the strip at the bore of the diaphragm; all of its end section."""

    @property
    def size(self) -> int:
        """How many."""
        return len(self.position)


def strip_masters(strip: StripMesh, orders: Orders | None = None) -> Masters:
    """Masters of a strip and how its segments follow them."""
    orders = orders or Orders()
    segments = strip.segments
    wanted = [orders.teeth] + [orders.cup] * (len(segments) - 1)
    degree = [
        min(order, len(np.unique(np.round(segment.position, 9))) - 1)
        for order, segment in zip(wanted, segments, strict=True)
    ]
    wanted = [orders.at_teeth] + [orders.around] * (len(segments) - 1)
    around = [
        order if segment.end is None else min(order, len(segment.end) - 1)
        for order, segment in zip(wanted, segments, strict=True)
    ]
    # degree through the wall at every station of a face, first master of each
    walls = np.full(1 + sum(degree), orders.wall)
    walls[: degree[0] + (len(segments) == 1)] = orders.rim
    starts = np.cumsum([0, *(walls + 1)])
    rows, face_size = orders.wall + 1, int(starts[-1])
    count = face_size
    inside = []  # first master inside the end section of every segment
    for segment, order in zip(segments, around, strict=True):
        inside.append(count)
        count += rows * (order - 1) if segment.end is not None else 0
    size = count + face_size
    position = np.full((size, 3), np.nan)

    found, station = [], 0
    for k, segment in enumerate(segments):
        follow = _Follow(
            size=size,
            face_size=face_size,
            wall=orders.wall,
            walls=walls[station : station + degree[k] + 1],
            starts=starts[station : station + degree[k] + 1],
            begin=(around[k - 1], inside[k - 1]) if k else None,
            end=(around[k], inside[k]),
            narrow=strip.narrow if k == 1 else 0.0,
        )
        masters = follow.of(segment)
        _place(segment, masters, position)
        found.append(masters)
        station += degree[k]
    ends = np.arange(starts[-2], face_size)
    held = np.concatenate([ends, np.arange(inside[-1], count), size - face_size + ends])
    return Masters(
        position=position, face_size=face_size, segments=tuple(found), held=held
    )


def _place(segment: SegmentMesh, follow: SegmentMasters, position: Array) -> None:
    """Where new masters lie: the boundary follows them at rest, too.

    The faces first: their masters must stay in them, where the next sector meets.
    """
    points = np.asarray(segment.mesh.p).T[follow.boundary]
    faces = np.isin(follow.boundary, np.concatenate([segment.first, segment.last]))
    for part in (faces, ~faces):
        weight = follow.weight[part]
        known = np.isfinite(position[follow.masters, 0])
        new = ~known & (np.abs(weight).max(axis=0, initial=0.0) > 0.0)
        rest = points[part] - weight[:, known] @ position[follow.masters[known]]
        found = np.linalg.lstsq(weight[:, new], rest, rcond=None)[0]
        position[follow.masters[new]] = found


@dataclass(frozen=True, kw_only=True)
class _Follow:
    """Numbers of the masters around one segment."""

    size: int
    face_size: int
    wall: int
    """Degree through the wall on a section."""
    walls: Index
    """The same at the stations of the segment on a face (degree + 1,)."""
    starts: Index
    """First master of these stations."""
    begin: tuple[int, int] | None
    """Degree around the section towards the teeth, first master inside it."""
    end: tuple[int, int]
    narrow: float
    """How deep below the outside of the teeth the segment's own outside begins."""

    def of(self, segment: SegmentMesh) -> SegmentMasters:
        """Weights of the masters in the displacements of faces and sections."""
        rows: dict[int, Array] = {}
        for nodes, offset in ((segment.first, 0), (segment.last, self.last)):
            for node, row in zip(nodes, self._face(segment, offset), strict=True):
                rows[int(node)] = row
        for section, place in ((segment.begin, self.begin), (segment.end, self.end)):
            if section is not None and place is not None:
                self._section(section, *place, rows)
        boundary = np.array(sorted(rows), dtype=np.int64)
        weight = np.array([rows[node] for node in boundary])
        used = np.flatnonzero(np.abs(weight).max(axis=0) > 0.0)
        weight = np.ascontiguousarray(weight[:, used])
        return SegmentMasters(boundary=boundary, masters=used, weight=weight)

    @property
    def last(self) -> int:
        """First master of the last face."""
        return self.size - self.face_size

    def _face(self, segment: SegmentMesh, offset: int) -> Array:
        """Rows of face nodes: polynomials along and through (n, size)."""
        along = lagrange(lobatto(len(self.walls) - 1), segment.position)
        # at the teeth the outside of the wall lies between the masters
        depth = self.narrow + (1.0 - self.narrow) * segment.depth
        rows = np.zeros((len(along), self.size))
        for k, (order, start) in enumerate(zip(self.walls, self.starts, strict=True)):
            through = lagrange(lobatto(int(order)), depth if k == 0 else segment.depth)
            here = slice(offset + start, offset + start + order + 1)
            rows[:, here] = along[:, k : k + 1] * through
        return rows

    def _section(
        self, section: Index, order: int, start: int, rows: dict[int, Array]
    ) -> None:
        """Rows of the nodes between the faces: polynomials around and through."""
        n_phi, n_wall = section.shape
        around = lagrange(lobatto(order), np.linspace(0.0, 1.0, n_phi))
        wall = lagrange(lobatto(self.wall), np.linspace(0.0, 1.0, n_wall))
        for t, through in enumerate(wall):
            ends = rows[int(section[0, t])], rows[int(section[-1, t])]
            for k in range(1, n_phi - 1):
                row = around[k, 0] * ends[0] + around[k, -1] * ends[1]
                inner = around[k, 1:-1, None] * through
                row[start : start + inner.size] += inner.ravel()
                rows[int(section[k, t])] = row


def face_lines(strip: StripMesh, masters: Masters, x: Array) -> Array:
    """Outside and bore side of the first face, from the open end to the bore.

    Args:
        strip: The mesh.
        masters: Its masters.
        x: Positions of all masters (n, 3) [m].

    Returns:
        Shape (2, n_points, 3) [m].
    """
    sides: list[list[Array]] = [[], []]
    for segment, follow in zip(strip.segments, masters.segments, strict=True):
        place = np.searchsorted(follow.boundary, segment.first)
        points = follow.weight[place] @ x[follow.masters]
        for side in (0, 1):
            stations = np.unique(np.round(segment.position, 9))
            for station in stations[0 if not sides[side] else 1 :]:
                here = np.flatnonzero(np.abs(segment.position - station) < 1e-8)
                depth = segment.depth[here]
                k = here[depth.argmin() if side == 0 else depth.argmax()]
                sides[side].append(points[k])
    return np.array(sides)

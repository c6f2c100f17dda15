r"""Master nodes: a few points whose displacements define those of faces and sections.

Through the wall the displacement of a face is the sum of a linear part, a parabola and
polynomials of higher degree. Their coefficients are polynomials along the meridian of
each segment. On a section between segments the coefficients are polynomials around the
sector. The parabola describes a plate in bending, which contracts through its thickness
on the side in tension and expands on the other side. It follows the bending moment,
which varies less along the wall than the displacement. The coefficients of the parabola
and of higher degrees through the wall are therefore of a lower degree along it. Without
the parabola the cup was 0.5 % too stiff; its low degree causes an error of 0.01 %.

These displacements include every linear field, and the weights of the masters add up to
one, so that masters rotate like points of a rigid body. The corotational model
therefore needs only their positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.solid.strip.mesh import SegmentMesh, StripMesh
from swgjoint.fe.solid.strip.polynomials import THROUGH, Patch
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True)
class Orders:
    """Degrees of the polynomials; a mesh with few nodes limits them further.

    With the default degrees (176 masters) the compliance of an improved reference cup
    under given forces is within 0.02 % of that with all nodes of faces and sections as
    masters (465).
    """

    teeth: int = 10
    """Degree along the toothed segment of the part that is linear through the rim; with
    8 the largest tensile stress, at the back edge of the teeth, is 3 % higher."""
    cup: int = 4
    """Degree along each segment of the cup of the part that is linear through the wall.
    """
    at_teeth: int = 4
    """Degree around the sector of the linear part on the section where the cup joins
    the toothed segment, whose rim bends between the teeth."""
    around: int = 2
    """Degree around the sector of the linear part on all other sections."""
    rim: int = 3
    """Degree through the rim on the faces, which are midway between two teeth."""
    wall: int = 2
    """Degree through the wall of the cup; at most ``rim``."""
    rim_bending: int = 3
    """Degree along the toothed segment of the parts that are not linear through the
    rim."""
    wall_bending: int = 1
    """Degree along each segment of the cup, and around each section, of the parts that
    are not linear through the wall."""

    def __post_init__(self) -> None:
        most = len(THROUGH) - 1
        if not 1 <= self.wall <= self.rim <= most:
            raise ValueError(f"expected degrees 1 <= wall <= rim <= {most}")


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentMasters:
    """Faces and sections of one segment in terms of the masters of the strip."""

    boundary: Index
    """Numbers of the nodes on faces and sections (n_boundary,)."""
    masters: Index
    """Numbers of the masters of the strip that move these nodes (n_m,)."""
    weight: Array
    """Weights of these masters in the displacements of the nodes (n_boundary, n_m) [-].
    """


@dataclass(frozen=True, kw_only=True, eq=False)
class Masters:
    """Master nodes of a strip in the order first face, sections, last face."""

    position: Array
    """Positions in the frame of the tooth (n, 3) [m]."""
    face_size: int
    """Number of masters on a face."""
    segments: tuple[SegmentMasters, ...]
    """Faces and sections of the segments, the toothed one first."""
    held: Index
    """Numbers of the masters at the bore of the diaphragm, the last section of the
    strip."""

    @property
    def size(self) -> int:
        """Number of masters."""
        return len(self.position)


def strip_masters(strip: StripMesh, orders: Orders | None = None) -> Masters:
    """Place the masters of a strip and compute their weights in every segment.

    Args:
        strip: Mesh of the strip.
        orders: Degrees of the polynomials; None for the default degrees.
    """
    # masters on a face, segment after segment; neighbouring segments share the masters
    # of their common edge
    orders = orders or Orders()
    segments = strip.segments
    degrees = [_degrees(strip, k, orders) for k in range(len(segments))]
    faces, ends, count = list[Patch](), list[Index](), 0
    for k, along in enumerate(degrees):
        # at the section to the cup the degree through the rim is that of the wall
        kept = min(len(part) for part in degrees[k : k + 2])
        points, numbers = [], []
        for level, degree in enumerate(along):
            for station in range(degree + 1 if level < kept else degree):
                points.append((level, station))
                old = k > 0 and station == 0
                numbers.append(int(ends[-1][level]) if old else count)
                count += not old
        masters = np.array(numbers)
        at_end = [station == along[level] for level, station in points]
        narrow = strip.narrow if k == 1 else 0.0
        faces.append(
            Patch(degrees=along, points=tuple(points), masters=masters, narrow=narrow)
        )
        ends.append(masters[at_end])
    face_size = count

    # masters on the sections, between those that the sections share with both faces
    sections = list[Patch | None]()
    inside = count
    for k, segment in enumerate(segments):
        sections.append(None)
        if segment.end is None:
            continue
        inside, line = count, orders.around if k else orders.at_teeth
        bent = [orders.wall_bending] * (len(ends[k]) - 2)
        around = tuple(min(part, len(segment.end) - 1) for part in (line, line, *bent))
        points, numbers = [], []
        for level, degree in enumerate(around):
            on_first = int(ends[k][level])
            points += [(level, station) for station in range(degree + 1)]
            on_last = on_first - face_size  # negative: counted from the last master
            numbers += [on_first, *range(count, count + degree - 1), on_last]
            count += degree - 1
        sections[k] = Patch(
            degrees=around, points=tuple(points), masters=np.array(numbers)
        )
    size = count + face_size

    # weights of the masters at the nodes of every segment, and positions of the masters
    position, segment_masters = np.full((size, 3), np.nan), []
    for k, segment in enumerate(segments):
        rows: dict[int, Array] = {}
        for nodes, first in ((segment.first, 0), (segment.last, size - face_size)):
            face = faces[k].rows(segment.position, segment.depth, size, first)
            rows |= zip(nodes.tolist(), face, strict=True)
        for section, number in ((segment.begin, k - 1), (segment.end, k)):
            patch = sections[number] if section is not None else None
            if section is not None and patch is not None:
                narrow = 0.0 if number else strip.narrow
                rows |= _inside(section, patch, narrow, size)
        boundary = np.array(sorted(rows), dtype=np.int64)
        weight = np.array([rows[node] for node in boundary])
        used = np.flatnonzero(np.abs(weight).max(axis=0) > 0.0)
        follow = SegmentMasters(
            boundary=boundary,
            masters=used,
            weight=np.ascontiguousarray(weight[:, used]),
        )
        _place(segment, follow, position)
        segment_masters.append(follow)
    held = [ends[-1], np.arange(inside, count), size - face_size + ends[-1]]
    return Masters(
        position=position,
        face_size=face_size,
        segments=tuple(segment_masters),
        held=np.concatenate(held),
    )


def _degrees(strip: StripMesh, number: int, orders: Orders) -> tuple[int, ...]:
    """Degrees along a segment, one per master through its wall."""
    segment = strip.segments[number]
    line, bent, most = orders.cup, orders.wall_bending, orders.wall
    if number == 0:
        line, bent, most = orders.teeth, orders.rim_bending, orders.rim
    stations = len(np.unique(np.round(segment.position, 9)))
    levels = min(most, int(np.sum(segment.position < 1e-9)) - 1)
    degrees = (line, line, *[bent] * (levels - 1))
    return tuple(min(degree, stations - 1) for degree in degrees)


def _inside(section: Index, patch: Patch, narrow: float, size: int) -> dict[int, Array]:
    """Weights of the masters at the nodes of a section that are not on a face."""
    n_phi, n_wall = section.shape
    around = np.linspace(0.0, 1.0, n_phi)[1:-1]
    depth = narrow + (1.0 - narrow) * np.linspace(0.0, 1.0, n_wall)
    rows = patch.rows(np.repeat(around, n_wall), np.tile(depth, n_phi - 2), size)
    return dict(zip(section[1:-1].ravel().tolist(), rows, strict=True))


def _place(segment: SegmentMesh, follow: SegmentMasters, position: Array) -> None:
    """Place new masters so that they interpolate the undeformed boundary.

    Masters on the faces are placed first: they must lie in the faces, because the
    neighbouring sectors share them.
    """
    points = np.asarray(segment.mesh.p).T[follow.boundary]
    faces = np.isin(follow.boundary, np.concatenate([segment.first, segment.last]))
    for part in (faces, ~faces):
        weight = follow.weight[part]
        known = np.isfinite(position[follow.masters, 0])
        new = ~known & (np.abs(weight).max(axis=0, initial=0.0) > 0.0)
        rest = points[part] - weight[:, known] @ position[follow.masters[known]]
        fitted = np.linalg.lstsq(weight[:, new], rest, rcond=None)[0]
        position[follow.masters[new]] = fitted

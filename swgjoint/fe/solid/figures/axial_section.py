"""Axial sections of the deflected flexspline and the coning of its teeth.

A cup held at its boss cannot follow the wave generator with both ends of its teeth
alike: the open edge moves farther than the closed one. Sections run through the axes of
the teeth that stand nearest to the major and the minor axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from swgjoint.fe.solid.ring import SolidRing
from swgjoint.fe.solid.state import SolidState
from swgjoint.typing import Array, Index
from swgjoint.units import mm

ON_AXIS = 1e-9
"""Distance from the plane of the section below which a node lies in it [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AxialSection:
    """One segment cut through the axis of a tooth."""

    cells: Index
    """Quadrilaterals of the section by its points (n_cells, 4)."""
    rest: Array
    """z and radius of the points at rest (n, 2) [m]."""
    moved: Array
    """The same, deflected (n, 2) [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Coning:
    """Radial displacement of the bore under the teeth along the face width."""

    z: Array
    """From the open edge to the closed one (n_planes,) [m]."""
    major: Array
    """At the tooth nearest to the major axis, outward (n_planes,) [m]."""
    minor: Array
    """The same at the minor axis (n_planes,) [m]."""

    def to_json(self) -> dict[str, dict[str, float]]:
        """Both edges of both axes in mm."""
        return {
            axis: {"open_edge": float(u[0]) / mm, "closed_edge": float(u[-1]) / mm}
            for axis, u in (("major", self.major), ("minor", self.minor))
        }


def axis_sectors(ring: SolidRing, state: SolidState) -> tuple[int, int]:
    """Sectors whose teeth stand nearest to the major and the minor axis."""
    place = 2.0 * pi / ring.strip.sectors * np.arange(ring.sectors, dtype=float)
    angle = place + state.rotation - state.wave_generator_angle
    from_major = np.abs((angle + 0.5 * pi) % pi - 0.5 * pi)
    return int(from_major.argmin()), int(from_major.argmax())


def sector_points(ring: SolidRing, state: SolidState, sector: int) -> list[Array]:
    """Nodes of a sector's segments in the global frame, each (n_nodes, 3) [m]."""
    force, found = ring.loads(state)[sector, None], []
    for number, (segment, frame) in enumerate(
        zip(ring.strip.segments, ring.frames(state), strict=True)
    ):
        d = frame.displacement[sector, None]
        u = segment.displacement(d, None if number else force)[0]
        rest = np.asarray(segment.mesh.mesh.p).T
        found.append((rest + u) @ frame.turn[sector].T)
    return found


def axial_sections(
    ring: SolidRing, state: SolidState, sector: int
) -> tuple[AxialSection, ...]:
    """Every segment of a sector, cut through the axis of its tooth."""
    sections = []
    points = sector_points(ring, state, sector)
    for segment, moved in zip(ring.strip.segments, points, strict=True):
        mesh = segment.mesh.mesh
        rest, facets = np.asarray(mesh.p).T, np.asarray(mesh.facets)
        inside = np.abs(rest[:, 0]) < ON_AXIS
        cut = facets[:, inside[facets].all(axis=0)]
        nodes, cells = np.unique(cut, return_inverse=True)
        sections.append(
            AxialSection(
                cells=np.asarray(cells.reshape(cut.shape).T, dtype=np.int64),
                rest=_meridian(rest[nodes]),
                moved=_meridian(moved[nodes]),
            )
        )
    return tuple(sections)


def coning(ring: SolidRing, state: SolidState) -> Coning:
    """Radial displacement of the bore along the face width at both axes."""
    teeth = ring.strip.mesh.teeth
    line = teeth.nodes[:, teeth.plane.bore[len(teeth.plane.bore) // 2]]
    rest = _meridian(np.asarray(teeth.segment.mesh.p).T[line])[:, 1]
    major, minor = (
        _meridian(sector_points(ring, state, sector)[0][line])[:, 1] - rest
        for sector in axis_sectors(ring, state)
    )
    return Coning(z=teeth.z, major=major, minor=minor)


def _meridian(points: Array) -> Array:
    """Coordinate z and radius of points in space (n, 2) [m]."""
    return np.stack([points[:, 2], np.hypot(points[:, 0], points[:, 1])], axis=-1)

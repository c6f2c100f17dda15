"""Axial sections of the deflected flexspline and the coning of its teeth.

Since the cup is held at its boss, its teeth do not follow the wave generator equally at
both edges of the face width: the open edge moves farther than the closed edge. This is
called coning. The sections pass through the axes of the teeth closest to the major and
the minor axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.typing import Array, Index
from swgjoint.units import mm

ON_AXIS = 1e-9
"""Distance from the section plane up to which a node counts as in it [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AxialSection:
    """Axial section of one segment through the axis of its tooth."""

    cells: Index
    """Quadrilaterals of the section as indices of its points (n_cells, 4)."""
    rest: Array
    """Coordinate z and radius of the undeformed points (n, 2) [m]."""
    moved: Array
    """Coordinate z and radius of the displaced points (n, 2) [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Coning:
    """Radial displacement of the bore under the teeth along the face width."""

    z: Array
    """Coordinates z of the planes from the open to the closed edge (n_planes,) [m]."""
    major: Array
    """Outward displacement at the tooth closest to the major axis (n_planes,) [m]."""
    minor: Array
    """Outward displacement at the tooth closest to the minor axis (n_planes,) [m]."""

    def to_json(self) -> dict[str, dict[str, float]]:
        """Displacements of both edges at the major and the minor axis [mm]."""
        return {
            axis: {"open_edge": float(u[0]) / mm, "closed_edge": float(u[-1]) / mm}
            for axis, u in (("major", self.major), ("minor", self.minor))
        }


def axis_sectors(model: SolidSectorModel, state: SolidState) -> tuple[int, int]:
    """Numbers of the sectors closest to the major axis and to the minor axis.

    Args:
        model: The 3D model.
        state: The equilibrium.
    """
    place = 2.0 * pi / model.strip.sectors * np.arange(model.sectors, dtype=float)
    angle = place + state.rotation - state.wave_generator_angle
    from_major = np.abs((angle + 0.5 * pi) % pi - 0.5 * pi)
    return int(from_major.argmin()), int(from_major.argmax())


def sector_points(
    model: SolidSectorModel, state: SolidState, sector: int
) -> list[Array]:
    """Displaced nodes of a sector by segment, each in the global frame (n, 3) [m].

    Args:
        model: The 3D model.
        state: The equilibrium.
        sector: Number of the sector.
    """
    force, points = model.loads(state)[sector, None], []
    for number, (segment, frame) in enumerate(
        zip(model.strip.segments, model.frames(state), strict=True)
    ):
        d = frame.displacement[sector, None]
        u = segment.displacement(d, None if number else force)[0]
        rest = np.asarray(segment.mesh.mesh.p).T
        points.append((rest + u) @ frame.turn[sector].T)
    return points


def axial_sections(
    model: SolidSectorModel, state: SolidState, sector: int
) -> tuple[AxialSection, ...]:
    """Axial sections of all segments of a sector through the axis of its tooth.

    Args:
        model: The 3D model.
        state: The equilibrium.
        sector: Number of the sector.
    """
    sections = []
    points = sector_points(model, state, sector)
    for segment, moved in zip(model.strip.segments, points, strict=True):
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


def coning(model: SolidSectorModel, state: SolidState) -> Coning:
    """Evaluate the coning at the major and the minor axis.

    Args:
        model: The 3D model.
        state: The equilibrium.
    """
    teeth = model.strip.mesh.teeth
    line = teeth.nodes[:, teeth.plane.bore[len(teeth.plane.bore) // 2]]
    rest = _meridian(np.asarray(teeth.segment.mesh.p).T[line])[:, 1]
    major, minor = (
        _meridian(sector_points(model, state, sector)[0][line])[:, 1] - rest
        for sector in axis_sectors(model, state)
    )
    return Coning(z=teeth.z, major=major, minor=minor)


def _meridian(points: Array) -> Array:
    """Coordinate z and radius of 3D points (n, 2) [m]."""
    return np.stack([points[:, 2], np.hypot(points[:, 0], points[:, 1])], axis=-1)

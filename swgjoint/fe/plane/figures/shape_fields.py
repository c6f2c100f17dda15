"""Fields of equilibria that a map stores for display: shape, stress, contact forces.

They are functions of the place of a tooth relative to the wave generator. The displayed
surface connects rows of nodes that run across a sector, from its clockwise to its
counter-clockwise face.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import gcd, pi

import numpy as np

from swgjoint.fe.common.layout_angles import AnyState
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.sector_mesh import SectorMesh
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.stress import flexspline_stress
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import wave_generator
from swgjoint.maps.fields import DriveFields
from swgjoint.typing import Array, Index

PHASES = 4
"""Largest number of input positions within a pitch that are stored."""
EVERY = 2
"""Stride of the displayed nodes along outline and bore: every second node."""
OUTLINE = 200
"""Number of points of the wave generator's outline."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SectorFields:
    """Fields of one equilibrium by sector.

    Vectors are in the frames of the teeth on the undeformed flexspline after its
    rotation.
    """

    displacement: Array
    """Displacement of the surface nodes (N, n_nodes, 3) [m]."""
    von_mises: Array
    """Von Mises stress at the surface nodes (N, n_nodes) [Pa]."""
    tooth_force: Array
    """Force of the circular spline on each tooth (N, 3) [N]."""
    wave_generator_force: Array
    """Force of the wave generator on each sector (N, 3) [N]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeSurface:
    """Displayed surface of a sector."""

    nodes: Index
    """Mesh nodes of the surface (n,)."""
    points: Array
    """Undeformed positions of these nodes (n, 3) [m]."""
    triangles: Index
    """Triangles as indices into ``nodes`` (n_triangles, 3)."""

    @property
    def mirrored(self) -> Index:
        """Index of the node at the mirror image of each node (n,)."""
        image = self.points * np.array([-1.0, 1.0, 1.0])
        apart = np.linalg.norm(self.points[:, None] - image, axis=2)
        return np.asarray(apart.argmin(axis=0), dtype=np.int64)


def surface_of(points: Array, rows: Sequence[Index]) -> ShapeSurface:
    """Triangulated surface through rows of nodes.

    Args:
        points: Positions of the mesh nodes (n_nodes, 3) [m].
        rows: Rows of nodes, each from the clockwise to the counter-clockwise face; at
            least two, of any lengths.
    """
    triangles = np.concatenate([_between(a, b) for a, b in pairwise(rows)])
    nodes, number = np.unique(triangles, return_inverse=True)
    return ShapeSurface(
        nodes=nodes,
        points=points[nodes],
        triangles=np.asarray(number.reshape(triangles.shape), dtype=np.int64),
    )


def _between(one: Index, other: Index) -> Index:
    """Triangles (n, 3) between two rows of nodes, which may differ in length."""
    n = max(len(one), len(other))
    a, b = (
        row[np.linspace(0, len(row) - 1, n).round().astype(int)] for row in (one, other)
    )
    quads = np.stack([a[:-1], a[1:], b[1:], b[:-1]])
    both = np.concatenate([quads[[0, 1, 2]].T, quads[[0, 2, 3]].T])
    a, b, c = both.T
    return np.asarray(both[(a != b) & (b != c) & (a != c)], dtype=np.int64)


def outline_rows(plane: SectorMesh) -> tuple[Index, Index]:
    """Displayed node rows of a 2D section from its clockwise face: bore, outline."""
    right = plane.flank_right[::-1]
    half = np.unique(np.r_[0 : len(right) : EVERY, len(right) - 1])
    left = plane.flank_left[::-1][half][::-1]
    return plane.bore[::EVERY], np.concatenate([right[half], left])


def plane_surface(model: SectorModel) -> ShapeSurface:
    """Displayed surface of a sector of the 2D flexspline."""
    mesh = model.element.mesh
    flat = np.asarray(mesh.mesh.p).T
    points = np.concatenate([flat, np.zeros((len(flat), 1))], axis=1)
    return surface_of(points, outline_rows(mesh))


def plane_fields(
    model: SectorModel, state: State, surface: ShapeSurface
) -> SectorFields:
    """Fields of an equilibrium of the 2D model.

    Args:
        model: The 2D model.
        state: The equilibrium.
        surface: Displayed surface of a sector.
    """
    element, frames = model.element, model.frames(state)
    size = len(element.displacement_from_skeleton)
    u = frames.displacement @ element.displacement_from_skeleton.reshape(2 * size, -1).T
    u += state.flank_force @ element.displacement_from_flank.reshape(2 * size, -1).T
    rest = np.asarray(element.mesh.mesh.p).T[surface.nodes]
    u = u.reshape(len(u), size, 2)[:, surface.nodes]
    # from the sector frames to those of the undeformed teeth after the rotation
    back = frames.angle - model.place - state.rotation
    points = rotate(rest + u, back[:, None])
    pressed = np.einsum(
        "sn,sni->si",
        np.where(state.touching, state.pressure, 0.0),
        model.wave_generator_normal(state),
    )
    teeth = state.flank_force.reshape(len(u), -1, 2).sum(axis=1)
    return SectorFields(
        displacement=_flat(points - rest),
        von_mises=stress_maxima(flexspline_stress(model, state)[:, surface.nodes])[2],
        tooth_force=_flat(rotate(teeth, back)),
        wave_generator_force=_flat(rotate(pressed, -model.place - state.rotation)),
    )


def _flat(values: Array) -> Array:
    """2D vectors as 3D vectors with z = 0."""
    return np.concatenate([values, np.zeros((*values.shape[:-1], 1))], axis=-1)


def drive_fields(
    design: Design,
    states: Mapping[float, Sequence[AnyState]],
    fields: Callable[[AnyState], SectorFields],
    surface: ShapeSurface,
    *,
    symmetric: bool,
) -> DriveFields:
    """Fields of equilibria at equally spaced positions over one pitch.

    Args:
        design: The drive.
        states: Equilibria at equally spaced input positions over one pitch, by torque
            [N·m].
        fields: Function that returns the fields of an equilibrium.
        surface: Displayed surface of a sector.
        symmetric: Whether to add the fields under the opposite torques, as mirror
            images of those given.
    """
    teeth = design.drive.teeth_flexspline
    tables: dict[float, SectorFields] = {}
    place: dict[float, float] = {}
    for torque, row in states.items():
        phases = gcd(len(row), PHASES)
        used_states = row[:: len(row) // phases]
        kept = [fields(state) for state in used_states]
        # from one input position to the next, the place of each tooth relative to the
        # wave generator decreases by pitch / phases
        fallen = 2.0 * pi / teeth * np.arange(phases) / phases
        at = [state.rotation - state.wave_generator_angle for state in used_states]
        place[torque] = float(np.mean(at + fallen))
        tables[torque] = SectorFields(
            **{key: _by_place([getattr(one, key) for one in kept]) for key in _KEYS}
        )
    if symmetric:
        tables |= {-t: _mirrored(one, surface) for t, one in tables.items() if t}
        place |= {-t: -one for t, one in place.items() if t}
    used = np.array(sorted(tables))
    places = tables[used[0]].tooth_force.shape[0]
    profile = tooth_profile(design, "circular_spline")
    right, _, _ = profile.evaluate(np.linspace(0.0, profile.stations[-1], 12))
    return DriveFields(
        torque=used,
        first_place=np.array([place[t] for t in used]),
        period=2.0 * pi * places / (phases * teeth),
        points=surface.points,
        triangles=surface.triangles,
        wave_generator=wave_generator(design).outline(OUTLINE),
        circular_spline=np.concatenate(
            [right[::-1], right[1:] * np.array([-1.0, 1.0])]
        ),
        **{key: np.stack([getattr(tables[t], key) for t in used]) for key in _KEYS},
    )


_KEYS = ("displacement", "von_mises", "tooth_force", "wave_generator_force")


def _by_place(phases: list[Array]) -> Array:
    """Values of all sectors at all input positions, interleaved in order of place."""
    n, count = len(phases), len(phases[0])
    table = np.empty((count * n, *phases[0].shape[1:]))
    for k, values in enumerate(phases):
        table[(np.arange(count) * n - k) % (count * n)] = values
    return table


def _mirrored(fields: SectorFields, surface: ShapeSurface) -> SectorFields:
    """Fields under the opposite torque: the mirror image of the given ones."""
    flip = np.array([-1.0, 1.0, 1.0])

    def back(values: Array) -> Array:
        return np.roll(values[::-1], 1, axis=0)

    nodes = surface.mirrored
    return SectorFields(
        displacement=back(fields.displacement)[:, nodes] * flip,
        von_mises=back(fields.von_mises)[:, nodes],
        tooth_force=back(fields.tooth_force) * flip,
        wave_generator_force=back(fields.wave_generator_force) * flip,
    )

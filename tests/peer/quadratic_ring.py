"""A flexspline of eight-node quadrilaterals with the middles on the true curves."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.sector_mesh import SectorMesh, sector_mesh
from swgjoint.gear.teeth.profile import ToothProfile

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MIRROR = np.array([-1.0, 1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """Sides of elements along one curve of every sector.

    A curve parameter places any point of the curve on its side, so that forces and
    displacements pass between meshes by the shape functions of the side.
    """

    parameter: Array
    """Of the corner nodes, increasing (k + 1,)."""
    nodes: Index
    """First corner, last corner and middle of every side (N, k, 3); -1 where the part
    does not contain the side."""

    def at(self, parameter: Array) -> tuple[Index, Array]:
        """Nodes (N, n, 3) and their weights (n, 3) for points on the curve.

        A point between two sides belongs to the one that the part contains.
        """
        size = len(self.parameter) - 1
        guess = np.searchsorted(self.parameter, parameter, side="right") - 1
        side = np.clip(guess, 0, size - 1)
        low, high = self.parameter[side], self.parameter[side + 1]
        x = (parameter - low) / (high - low)
        at_corner = np.isclose(x, 0.0, atol=1e-9) & (side > 0)
        nodes = self.nodes[:, side].copy()
        before = self.nodes[:, side - 1]
        # the corner itself, seen from the side before it
        lost = at_corner & (nodes[..., 0] < 0)
        nodes[lost] = before[lost][:, [1, 0, 2]]
        weights = [(1 - x) * (1 - 2 * x), x * (2 * x - 1), 4 * x * (1 - x)]
        return nodes, np.stack(weights, axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class QuadraticRing:
    """Sectors of the flexspline, SI."""

    points: Array
    """Corner nodes, then mid-side nodes (n, 2) [m]."""
    elements: Index
    """Corners counter-clockwise, then the middles of the sides (n_elements, 8)."""
    bore: Chain
    """By the angle from the axis of the tooth, counter-clockwise [rad]."""
    flanks: tuple[Chain, Chain]
    """Right and left flank by arc length on the profile [m]."""
    first_face: Index
    """Nodes of the first face of the first sector, middles too."""
    last_face: Index
    """Nodes of the last face of the last sector in the same order, -1 where the first
    and the last face are one."""


def quadratic_ring(
    profile: ToothProfile,
    rim: float,
    refinement: float,
    *,
    sectors: int,
    quarter: bool = False,
) -> QuadraticRing:
    """Mesh sectors with the topology of :func:`sector_mesh`.

    Args:
        profile: Flank of the flexspline.
        rim: Thickness of the rim [m].
        refinement: Multiplies the elements per direction.
        sectors: Sectors from the +y axis counter-clockwise; the ring closes if these
            are all.
        quarter: Keep what lies between the +y and the -x axis.
    """
    mesh = sector_mesh(profile, rim, refinement)
    local, quads = mesh.mesh.p.T, mesh.mesh.t.T
    sides, which, place_of = _sides(mesh, profile)
    # corners and middles of one sector; faces in order, middles between their corners
    points = np.concatenate([local, place_of])
    quads = np.concatenate([quads, len(local) + which], axis=1)
    number = {tuple(pair): len(local) + i for i, pair in enumerate(sides)}

    def middles(chain: Index) -> Index:
        pairs = np.sort(np.stack([chain[:-1], chain[1:]], -1), axis=1)
        return np.array([number[tuple(pair)] for pair in pairs])

    first = np.concatenate([mesh.face_first, middles(mesh.face_first)])
    last = np.concatenate([mesh.face_last, middles(mesh.face_last)])

    closed = sectors == profile.teeth
    node = np.arange(sectors * len(points)).reshape(sectors, -1)
    joined = slice(None) if closed else slice(None, -1)
    node[joined, last] = np.roll(node, -1, axis=0)[joined, first]
    angle = 2.0 * pi / profile.teeth * np.arange(sectors)
    place = rotate(points[None], angle[:, None])
    elements = node[:, quads].reshape(-1, 8)
    if quarter:
        centre = place[:, quads].mean(axis=2).reshape(-1, 2)
        elements = elements[(centre[:, 0] < 0.0) & (centre[:, 1] > 0.0)]
    # number what is left
    used = np.unique(elements)
    new = np.full(node.size, -1)
    new[used] = np.arange(len(used))
    flat = np.zeros((node.size, 2))
    flat[node] = place
    node = new[node]

    def chain(nodes: Index, parameter: Array) -> Chain:
        side = np.stack([nodes[:-1], nodes[1:], middles(nodes)], axis=-1)
        kept = node[:, side]
        kept[(kept < 0).any(axis=-1)] = -1
        return Chain(parameter=parameter, nodes=kept)

    bore_angle = np.arctan2(-local[mesh.bore, 0], local[mesh.bore, 1])
    stations = mesh.flank_stations
    return QuadraticRing(
        points=flat[used],
        elements=new[elements],
        bore=chain(mesh.bore, bore_angle),
        flanks=(chain(mesh.flank_right, stations), chain(mesh.flank_left, stations)),
        first_face=node[0, first],
        last_face=np.full_like(last, -1) if closed else node[-1, last],
    )


def _sides(mesh: SectorMesh, profile: ToothProfile) -> tuple[Index, Index, Array]:
    """Sides of a sector's elements (n, 2), those of each element, their middles."""
    local, quads = mesh.mesh.p.T, mesh.mesh.t.T
    pairs = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], -1), axis=-1)
    sides, which = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    middle = local[sides].mean(axis=1)
    # onto the profile, the bore and the top land where a side lies on them
    s = mesh.flank_stations
    flank, _, _ = profile.evaluate(0.5 * (s[1:] + s[:-1]))
    radius = np.hypot(*local.T)
    top = np.flatnonzero(np.isclose(radius, profile.addendum_radius, rtol=1e-9))
    top = top[np.argsort(local[top, 0])]
    curves = [(mesh.flank_right, flank), (mesh.flank_left, flank * MIRROR)]
    for arc in (mesh.bore, top):
        chord = local[arc].reshape(-1, 2)
        chord = 0.5 * (chord[1:] + chord[:-1])
        curves.append((arc, chord * (radius[arc[0]] / np.hypot(*chord.T))[:, None]))
    for arc, true in curves:
        ends = np.sort(np.stack([arc[:-1], arc[1:]], -1), axis=1)
        match = (sides[None] == ends[:, None]).all(axis=-1)
        middle[np.argmax(match, axis=1)] = true
    return sides, which.reshape(quads.shape), middle

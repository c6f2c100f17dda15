"""A toothed ring of a finite width: our plane sector, a solid in CalculiX.

Its two-lobe compliance under a radial traction cos 2 phi on the bore, the same over the
whole face width; and force and shape where two rigid walls spread it at the lobes.
"""

from __future__ import annotations

from pathlib import Path

import calculix
import numpy as np
from numpy.typing import NDArray
from quadratic_ring import QuadraticRing, quadratic_ring
from scipy.sparse import block_array, coo_array
from scipy.sparse.linalg import spsolve

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.units import mm

Array = NDArray[np.float64]

REFINEMENT, LAYERS = 0.34, 4
"""Of the solid: a mesh twice as fine in the plane changes the stiffness by 0.01 %, six
layers over half the width by 0.05 %."""
THINNER = 1.5
"""Each layer over the one outside it: axial stress falls to zero at the edge."""


def plane_compliance(element: Superelement, width: float) -> float:
    """Work of a traction cos 2 phi on the quarter, per width [J/m per Pa^2].

    The field has two lobes, so that a tooth repeats the one before it times
    exp(2 i pitch): one sector holds the whole ring.
    """
    x, size = element.skeleton, element.face_size
    count, pitch = len(x), 2.0 * np.pi / element.sectors
    join = np.zeros((2 * count, 2 * (count - size)), complex)
    join[: 2 * (count - size)] = np.eye(2 * (count - size))
    turn = rotate(np.eye(2), np.array(pitch)).T * np.exp(2j * pitch)
    for i in range(size):
        last = 2 * (count - size + i)
        join[last : last + 2, 2 * i : 2 * i + 2] = turn
    along = np.r_[size - 1 : count - size, count - 1]
    chord = np.hypot(*np.diff(x[along], axis=0).T)
    share = 0.5 * (np.r_[chord, 0.0] + np.r_[0.0, chord])
    angle = np.arctan2(-x[along, 0], x[along, 1])
    force = np.zeros((count, 2), complex)
    force[along] = (share * np.exp(2j * angle))[:, None] * (
        x[along] / np.hypot(*x[along].T)[:, None]
    )
    load = join.conj().T @ force.ravel()
    moved = np.linalg.solve(join.conj().T @ element.stiffness @ join, load)
    # the mean of cos^2 over the sectors of a quarter
    return float(element.sectors / 8.0 * (load.conj() @ moved).real * width)


def plane_wall(element: Superelement) -> tuple[float, Array]:
    """Force of a wall and shape of the ring between two of them.

    A wall moves the bore radially by cos 2 phi over :func:`wall_arc` on either side of
    a lobe, without friction; the rest of the ring is free.

    Returns:
        Radial force of one wall over its displacement at the lobe [N/m], and radial
        displacements of the bore at :func:`wall_faces` over the same (n,) [-].
    """
    x, size, sectors = element.skeleton, element.face_size, element.sectors
    own, local = 2 * (len(x) - size), np.arange(2 * len(x))
    along = np.r_[size - 1 : len(x) - size]
    count = sectors * own
    blocks, index, nodes = [], [], []
    for k in range(sectors):
        turn = rotate(np.eye(2), np.array(2.0 * np.pi / sectors * k))
        turned_by = np.kron(np.eye(len(x)), turn)
        blocks.append(turned_by.T @ element.stiffness @ turned_by)
        # the last face is the first one of the next sector
        index.append(np.where(local < own, k * own + local, -1))
        index[-1][own:] = (k + 1) % sectors * own + np.arange(2 * size)
        nodes.append(x[along] @ turn)
    row, column = (np.repeat(index, len(local), 1), np.tile(index, (1, len(local))))
    entries = np.reshape(blocks, (sectors, -1))
    matrix = coo_array((entries.ravel(), (row.ravel(), column.ravel())))
    place = np.concatenate(nodes)
    angle = np.arctan2(-place[:, 0], place[:, 1])
    out = place / np.hypot(*place.T)[:, None]
    first = np.concatenate([k * own + 2 * along for k in range(sectors)])
    # rows of the walls, and one that keeps the ring from turning
    from_lobe = np.abs((angle + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
    wall = np.flatnonzero(from_lobe < wall_arc(sectors) + 1e-6)
    n = len(wall)
    rows = np.zeros((n + 1, count))
    rows[np.arange(n), first[wall]] = out[wall, 0]
    rows[np.arange(n), first[wall] + 1] = out[wall, 1]
    rows[n, first[np.abs(angle).argmin()]] = 1.0
    scale = float(np.abs(element.stiffness).max())
    system = block_array([[matrix, scale * rows.T], [scale * rows, None]])
    right = np.r_[np.zeros(count), scale * np.cos(2.0 * angle[wall]), 0.0]
    found = spsolve(system.tocsc(), right)
    force = -scale * found[count:-1]
    near = np.abs(angle[:, None] - wall_faces(sectors)).argmin(axis=0)
    moved = np.stack([found[first[near]], found[first[near] + 1]], axis=-1)
    shape = np.einsum("ki,ki->k", moved, out[near])
    return float(force[np.abs(angle[wall]) < 0.5 * np.pi].sum()), shape


def wall_arc(sectors: int) -> float:
    """Where a wall ends, at a face between two teeth near 45 degrees [rad]."""
    return float((sectors // 8 + 0.5) * 2.0 * np.pi / sectors)


def wall_faces(sectors: int) -> Array:
    """Faces from the end of a wall to the minor axis (n,) [rad]."""
    return (np.arange(sectors // 8 + 1, sectors // 4) + 0.5) * 2.0 * np.pi / sectors


def solid_compliance(design: Design, folder: Path) -> float:
    """The same of a solid of the real width in CalculiX (C3D20R) [J/m per Pa^2]."""
    half = 0.5 * design.drive.face_width_mm
    points, elements, force = _extruded(_quarter(design), half)
    loads = calculix.load_block(force)
    found = _solved(design, folder, points, elements, loads)
    # N mm over mm of the half width, under 1 MPa, squared in the work
    return float((force * found.displacement).sum()) / half / 1e12


def _quarter(design: Design) -> QuadraticRing:
    """A quarter of the flexspline."""
    profile = tooth_profile(design, "flexspline")
    rim = design.flexspline.rim_mm * mm
    return quadratic_ring(profile, rim, REFINEMENT, sectors=profile.teeth, quarter=True)


def _solved(
    design: Design,
    folder: Path,
    points: Array,
    elements: NDArray[np.int64],
    loads: str,
    free_of: NDArray[np.int64] | tuple[()] = (),
) -> calculix.Fields:
    """A quarter of half the width under blocks of loads.

    Nodes ``free_of`` symmetry of the axis x = 0 have conditions of their own.
    """
    steel = design.material_of("flexspline")
    deck = "*NODE\n" + calculix.numbered(
        1, ([f"{value:.12g}" for value in point] for point in points)
    )
    deck += "*ELEMENT, TYPE=C3D20R, ELSET=RIM\n"
    for number, row in enumerate((elements + 1).astype(str).tolist(), 1):
        # at most 16 entries to a line
        deck += f"{number}, {', '.join(row[:15])},\n{', '.join(row[15:])}\n"
    deck += "*MATERIAL, NAME=STEEL\n*ELASTIC\n"
    deck += f"{steel.youngs_modulus / 1e6:.12g}, {steel.poisson_ratio:.12g}\n"
    deck += "*SOLID SECTION, ELSET=RIM, MATERIAL=STEEL\n*BOUNDARY\n"
    for axis in range(3):  # two axes of symmetry, and the middle of the width
        held = np.flatnonzero(np.abs(points[:, axis]) < 1e-9)
        if axis == 0:
            held = np.setdiff1d(held, free_of)
        deck += "".join(f"{node + 1}, {axis + 1}\n" for node in held)
    deck += f"*STEP\n*STATIC\n{loads}*NODE FILE\nU, RF\n*EL FILE\nS\n*END STEP\n"
    return calculix.run_solid(deck, folder, len(points))


def solid_wall(design: Design, folder: Path) -> tuple[float, Array]:
    """The same of a solid in CalculiX, its shape the mean over the width."""
    profile = tooth_profile(design, "flexspline")
    ring = _quarter(design)
    half = 0.5 * design.drive.face_width_mm
    points, elements, _ = _extruded(ring, half)
    sides = ring.bore.nodes.reshape(-1, 3)
    inner = np.unique(sides[(sides >= 0).all(axis=1)])
    bore_radius = np.hypot(*(ring.points[inner] / mm).T)
    radius = np.hypot(points[:, 0], points[:, 1])
    bore = np.flatnonzero(radius < bore_radius.max() + 1e-6)
    angle = np.arctan2(-points[bore, 0], points[bore, 1])
    wall = angle < wall_arc(profile.teeth) + 1e-6
    walled, inside = bore[wall], points[bore[wall], 0] > -1e-9
    held = "*NSET, NSET=WALL\n"
    held += "".join(f"{node + 1},\n" for node in walled)
    held += "*TRANSFORM, NSET=WALL, TYPE=C\n0., 0., 0., 0., 0., 1.\n*BOUNDARY\n"
    for node, own in zip(walled, angle[wall], strict=True):
        held += f"{node + 1}, 1, 1, {np.cos(2.0 * own):.12g}\n"
    # on the axis of symmetry the walled nodes have their own directions
    held += "".join(f"{node + 1}, 2\n" for node in walled[inside])
    found = _solved(design, folder, points, elements, held, free_of=walled)
    assert found.reaction is not None
    out = points[:, :2] / radius[:, None]
    force = np.einsum("ki,ki->k", found.reaction[walled][:, :2], out[walled]).sum()
    moved = np.einsum("ki,ki->k", found.displacement[:, :2], out)
    # over the width by the heights of the corners, which are not equal
    shape = []
    for face in wall_faces(profile.teeth):
        column = bore[np.abs(angle - face) < 1e-6]
        z = points[column, 2]
        order = np.argsort(z)
        shape.append(np.trapezoid(moved[column][order], z[order]) / half)
    # a quarter of the ring and half its width, 1 mm at the lobe
    return 4.0 * float(force) / mm, np.array(shape)


def _extruded(
    ring: QuadraticRing, half: float
) -> tuple[Array, NDArray[np.int64], Array]:
    """Nodes (n, 3) [mm], twenty-node elements, forces (n, 3) [N] of half the width."""
    plane, corner = ring.points / mm, np.zeros(len(ring.points), bool)
    corner[ring.elements[:, :4]] = True
    edges = np.r_[0.0, np.cumsum(THINNER ** -np.arange(LAYERS, dtype=float))]
    edges *= half / edges[-1]
    levels = np.sort(np.r_[edges, 0.5 * (edges[1:] + edges[:-1])])
    number = np.full((len(levels), len(plane)), -1)
    points: list[Array] = []
    for level, z in enumerate(levels):
        # between the layers only the corners of the quadrilaterals have nodes
        used = np.ones(len(plane), bool) if level % 2 == 0 else corner
        number[level, used] = np.arange(used.sum()) + sum(map(len, points))
        points.append(np.c_[plane[used], np.full(used.sum(), z)])
    nodes = np.concatenate(points)
    first, middle = ring.elements[:, :4], ring.elements[:, 4:]
    elements = np.concatenate(
        [
            np.c_[low[first], high[first], low[middle], high[middle], between[first]]
            for low, between, high in zip(
                number[:-1:2], number[1::2], number[2::2], strict=True
            )
        ]
    )
    radius = np.hypot(*plane.T)
    traction = np.cos(2.0 * np.arctan2(-plane[:, 0], plane[:, 1]))[:, None]
    traction = traction * plane / radius[:, None]
    force = np.zeros_like(nodes)
    sides = ring.bore.nodes.reshape(-1, 3)
    for a, b, m in sides[(sides >= 0).all(axis=1)]:
        for layer, height in enumerate(np.diff(edges)):
            area = np.hypot(*(plane[b] - plane[a])) * height
            # the face of eight nodes: corners -1/12, middles of its sides 1/3
            for level in (2 * layer, 2 * layer + 2):
                for node, part in ((a, -1 / 12), (b, -1 / 12), (m, 1 / 3)):
                    force[number[level, node], :2] += part * area * traction[node]
            for node in (a, b):
                force[number[2 * layer + 1, node], :2] += area / 3 * traction[node]
    return nodes, elements, force

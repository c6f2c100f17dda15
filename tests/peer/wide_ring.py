"""Two-lobe compliance of a toothed ring: our plane sector, a solid in CalculiX.

A radial traction cos 2 phi on the bore, the same over the whole face width.
"""

from __future__ import annotations

from pathlib import Path

import calculix
import numpy as np
from numpy.typing import NDArray
from quadratic_ring import QuadraticRing, quadratic_ring

from swgjoint.fe.corotation import rotate
from swgjoint.fe.superelement import Superelement
from swgjoint.gear.design import Design
from swgjoint.gear.profile import tooth_profile
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


def solid_compliance(design: Design, folder: Path) -> float:
    """The same of a solid of the real width in CalculiX (C3D20R) [J/m per Pa^2]."""
    profile = tooth_profile(design, "flexspline")
    rim = design.flexspline.rim_mm * mm
    ring = quadratic_ring(profile, rim, REFINEMENT, sectors=profile.teeth, quarter=True)
    half = 0.5 * design.drive.face_width_mm
    points, elements, force = _extruded(ring, half)
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
        held = np.flatnonzero(np.abs(points[:, axis]) < 1e-9) + 1
        deck += "".join(f"{node}, {axis + 1}\n" for node in held)
    deck += "*STEP\n*STATIC\n" + calculix.load_block(force)
    deck += "*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
    found = calculix.run_solid(deck, folder, len(points))
    # N mm over mm of the half width, under 1 MPa, squared in the work
    return float((force * found.displacement).sum()) / half / 1e12


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

"""Wave-generator contact of one of our states in space on the same mesh in CalculiX."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import calculix
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.stress import flexspline_stresses
from swgjoint.fe.solid.strip.elasticity import stress_maxima
from swgjoint.gear.design.design import Design
from swgjoint.units import mm

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MPa = 1e6
INSIDE = 4.0 * mm
"""Half of the width over which root stress is compared; the teeth end at 5 mm."""
# corners of scikit-fem's cube in the order of C3D8I
CORNERS = np.array([7, 4, 1, 5, 6, 2, 0, 3])


@dataclass(frozen=True, kw_only=True, eq=False)
class QuarterCup:
    """Strips of a quarter of the flexspline, merged; the cuts run through teeth."""

    points: Array
    """(n, 3) [m]."""
    cells: Index
    """(n_elements, 8)."""
    numbers: dict[str, Index]
    """Node by segment, sector and node of the segment, -1 elsewhere."""

    @classmethod
    def of(cls, model: SolidSectorModel) -> QuarterCup:
        """The quarter x <= 0, y >= 0 of a ring whose lobe lies at +y."""
        sectors = model.strip.sectors // 4 + 1
        points, cells, sizes = [], [], []
        for segment in model.strip.mesh.segments:
            p = np.asarray(segment.mesh.p).T
            for turn in model.place[:sectors]:
                cells.append(np.asarray(segment.mesh.t).T + sum(sizes))
                points.append(p @ turn.T)
                sizes.append(len(p))
        every, corners = np.concatenate(points), np.concatenate(cells)
        # first of the nodes at one place
        near = cKDTree(every).query_ball_point(every, 1e-9)
        leader = np.array([min(group) for group in near])
        middle = every[corners].mean(axis=1)
        corners = leader[corners[(middle[:, 0] < 0.0) & (middle[:, 1] > 0.0)]]
        used = np.unique(corners)
        number = np.full(len(every), -1)
        number[used] = np.arange(len(used))
        split = np.split(number[leader], np.cumsum(sizes)[:-1])
        names = [segment.name for segment in model.strip.mesh.segments]
        return cls(
            points=every[used],
            cells=number[corners][:, CORNERS],
            numbers={
                name: np.array(split[k * sectors : (k + 1) * sectors])
                for k, name in enumerate(names)
            },
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SolidReplay:
    """One state in both codes, by segment, sector of the quarter and node."""

    model: SolidSectorModel
    state: SolidState
    cup: QuarterCup
    displacement: Array
    """What CalculiX found (n, 3) [m]."""
    stress: Array
    """xx, yy, zz, xy, yz, zx (n, 6) [Pa]."""

    @cached_property
    def shape(self) -> dict[str, Array]:
        """CalculiX minus ours, radial, tangential and axial (n, 3) [m]."""
        found = {}
        model, loads = self.model, self.model.loads(self.state)
        frames = model.frames(self.state)
        for k, (segment, frame) in enumerate(
            zip(model.strip.segments, frames, strict=True)
        ):
            number = self.cup.numbers[segment.name]
            there = number >= 0
            u = segment.displacement(frame.displacement, None if k else loads)
            x = np.asarray(segment.mesh.mesh.p).T + u
            ours = np.einsum("sij,saj->sai", frame.turn, x)[: len(number)][there]
            start = self.cup.points[number[there]]
            apart = start + self.displacement[number[there]] - ours
            out = start[:, :2] / np.hypot(start[:, 0], start[:, 1])[:, None]
            found[segment.name] = np.stack(
                [
                    np.einsum("ni,ni->n", apart[:, :2], out),
                    apart[:, 1] * out[:, 0] - apart[:, 0] * out[:, 1],
                    apart[:, 2],
                ],
                axis=-1,
            )
        return found

    @cached_property
    def root_stress(self) -> tuple[float, float]:
        """Largest principal stress of the roots inside the face width, ours and theirs.

        The back edge is left out: a re-entrant corner, whose stress grows on finer
        meshes.
        """
        teeth = self.model.strip.mesh.teeth
        surface = np.concatenate([teeth.plane.flank_right, teeth.plane.flank_left])
        inside = teeth.nodes[np.abs(teeth.z) <= INSIDE + 1e-9][:, surface]
        ours, theirs = self.stresses("teeth", inside.ravel())
        return float(ours[0].max()), float(theirs[0].max())

    def stresses(self, name: str, nodes: Index) -> tuple[Array, Array]:
        """Ours and theirs, tensile, compressive and von Mises (3, sectors, n) [Pa].

        Args:
            name: Of a segment.
            nodes: Of its mesh.
        """
        number = self.cup.numbers[name][:, nodes]
        ours = flexspline_stresses(self.model, self.state)[name]
        ours = ours[: len(number), nodes]
        ours = np.where(number[..., None] >= 0, ours, 0.0)
        theirs = np.where(number[..., None] >= 0, self.stress[number], 0.0)
        return np.array(stress_maxima(ours)), np.array(stress_maxima(theirs))


def solid_replay(
    design: Design,
    model: SolidSectorModel,
    state: SolidState,
    folder: Path,
    *,
    element: str = "C3D8I",
) -> SolidReplay:
    """Apply the forces of the wave generator to the same mesh, large displacements.

    Args:
        design: The drive.
        model: Its model; the teeth must be a multiple of four.
        state: On the wave generator alone, at angle and rotation zero.
        folder: Where the files of CalculiX go.
        element: C3D8I is of the class of our own element.
    """
    cup = QuarterCup.of(model)
    points = cup.points / mm
    steel = design.material_of("flexspline")
    deck = "*NODE\n" + calculix.numbered(
        1, ([f"{x:.12g}" for x in point] for point in points)
    )
    deck += calculix.element_block(element, cup.cells, "CUP")
    deck += (
        "*MATERIAL, NAME=STEEL\n*ELASTIC\n"
        f"{steel.youngs_modulus / MPa:.12g}, {steel.poisson_ratio:.12g}\n"
        "*SOLID SECTION, ELSET=CUP, MATERIAL=STEEL\n"
    )
    deck += _supports(model, cup)
    deck += "*STEP, NLGEOM, INC=100\n*STATIC\n1.0, 1.0\n" + calculix.CONTROLS
    deck += calculix.load_block(_forces(model, state, cup))
    deck += "*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
    found = calculix.run_solid(deck, folder, len(points))
    return SolidReplay(
        model=model,
        state=state,
        cup=cup,
        displacement=found.displacement * mm,
        stress=found.stress * MPa,
    )


def _supports(model: SolidSectorModel, cup: QuarterCup) -> str:
    """Bore of the diaphragm held, symmetry on both cuts."""
    last = model.strip.mesh.segments[-1]
    assert last.end is not None
    held = np.unique(cup.numbers[last.name][:, last.end])
    lines = ["*BOUNDARY", *(f"{node + 1}, 1, 3" for node in held[held >= 0])]
    for axis in (0, 1):
        on_cut = np.flatnonzero(np.abs(cup.points[:, axis]) < 1e-10)
        lines += [f"{node + 1}, {axis + 1}" for node in np.setdiff1d(on_cut, held)]
    return "\n".join(lines) + "\n"


def _forces(model: SolidSectorModel, state: SolidState, cup: QuarterCup) -> Array:
    """Nodal forces of the wave generator on the quarter (n, 3) [N]."""
    number = cup.numbers["teeth"][:, model.strip.mesh.teeth.bore.ravel()]
    turn = model.frames(state)[0].turn[: len(number)]
    force = model.strip.teeth.nodal_force(model.loads(state))
    force = force[: len(number), model.strip.flank_dofs :].reshape(len(number), -1, 3)
    force = np.einsum("sij,spj->spi", turn, force)
    result = np.zeros_like(cup.points)
    there = number >= 0
    np.add.at(result, number[there], force[there])
    # on a cut half of a force belongs to the quarter
    on_cut = (np.abs(cup.points[:, :2]) < 1e-10).any(axis=1)
    result[on_cut] *= 0.5
    return result

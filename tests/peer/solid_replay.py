"""Contact forces of one of our states in space on the same mesh in CalculiX."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import calculix
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from swgjoint.fe.solid.corotation import about_z
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
class MergedCup:
    """Strips of a part of the flexspline as one mesh."""

    points: Array
    """(n, 3) [m]."""
    cells: Index
    """(n_elements, 8)."""
    numbers: dict[str, Index]
    """Node by segment, sector and node of the segment, -1 elsewhere."""

    @classmethod
    def quarter(cls, model: SolidSectorModel) -> MergedCup:
        """The quarter x <= 0, y >= 0 of a ring whose lobe lies at +y.

        Both cuts run through teeth.
        """
        return cls._of(
            model,
            model.strip.sectors // 4 + 1,
            lambda middle: (middle[:, 0] < 0.0) & (middle[:, 1] > 0.0),
        )

    @classmethod
    def half(cls, model: SolidSectorModel) -> MergedCup:
        """The sectors of a half model; both cuts run between teeth."""
        return cls._of(model, model.sectors, lambda middle: middle[:, 0] < np.inf)

    @classmethod
    def _of(
        cls,
        model: SolidSectorModel,
        sectors: int,
        keeps: Callable[[Array], NDArray[np.bool_]],
    ) -> MergedCup:
        """Elements whose middle is kept, of the first sectors."""
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
        corners = leader[corners[keeps(middle)]]
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
    cup: MergedCup
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
    """Apply the contact forces to the same mesh, large displacements.

    A state on the wave generator alone is symmetric and needs a quarter of the cup, one
    with teeth in contact needs half of it.

    Args:
        design: The drive.
        model: Its model; the teeth must be a multiple of four.
        state: On the wave generator alone, at angle and rotation zero, or an
            equilibrium of a half model under load.
        folder: Where the files of CalculiX go.
        element: C3D8I is of the class of our own element.
    """
    meshed = state.held is not None and len(state.held) > 0
    assert model.half or not meshed
    cup = MergedCup.half(model) if meshed else MergedCup.quarter(model)
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
    held = _bore_of_diaphragm(model, cup)
    deck += _closure(model, cup, held) if meshed else _symmetry(cup, held)
    deck += "*BOUNDARY\n" + "".join(f"{node + 1}, 1, 3\n" for node in held)
    deck += "*STEP, NLGEOM, INC=100\n*STATIC\n1.0, 1.0\n" + calculix.CONTROLS
    if meshed:
        turned = points[held] @ (about_z(np.array(state.rotation)) - np.eye(3)).T
        deck += "*BOUNDARY\n" + "".join(
            f"{node + 1}, {k + 1}, {k + 1}, {move[k]:.12g}\n"
            for node, move in zip(held, turned, strict=True)
            for k in range(2)
        )
    deck += calculix.load_block(_forces(model, state, cup, cut=not meshed))
    deck += "*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
    found = calculix.run_solid(deck, folder, len(points))
    if meshed:
        # nodes on the cuts get the mean of both sides, as all others
        first, last = cuts(model, cup)
        turned = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
        mean = 0.5 * (found.stress[first] + turned * found.stress[last])
        found.stress[first], found.stress[last] = mean, turned * mean
    return SolidReplay(
        model=model,
        state=state,
        cup=cup,
        displacement=found.displacement * mm,
        stress=found.stress * MPa,
    )


def _bore_of_diaphragm(model: SolidSectorModel, cup: MergedCup) -> Index:
    """Nodes at the bore of the diaphragm."""
    last = model.strip.mesh.segments[-1]
    assert last.end is not None
    held = np.unique(cup.numbers[last.name][:, last.end])
    return np.asarray(held[held >= 0])


def _symmetry(cup: MergedCup, held: Index) -> str:
    """Symmetry on both cuts of a quarter."""
    lines = ["*BOUNDARY"]
    for axis in (0, 1):
        on_cut = np.flatnonzero(np.abs(cup.points[:, axis]) < 1e-10)
        lines += [f"{node + 1}, {axis + 1}" for node in np.setdiff1d(on_cut, held)]
    return "\n".join(lines) + "\n"


def _closure(model: SolidSectorModel, cup: MergedCup, held: Index) -> str:
    """Equations that continue half of the cup as a copy rotated by 180 deg."""
    first, last = cuts(model, cup)
    lines = []
    for a, b in zip(first, last, strict=True):
        if a not in held:
            for axis, sign in enumerate((1.0, 1.0, -1.0)):
                lines += ["*EQUATION", "2"]
                lines += [f"{b + 1}, {axis + 1}, 1.0, {a + 1}, {axis + 1}, {sign}"]
    return "\n".join(lines) + "\n"


def cuts(model: SolidSectorModel, cup: MergedCup) -> tuple[Index, Index]:
    """Nodes on both cuts of half of a cup in the same order."""
    pairs = np.concatenate(
        [
            [
                cup.numbers[mesh.name][0, mesh.first],
                cup.numbers[mesh.name][-1, mesh.last],
            ]
            for mesh in model.strip.mesh.segments
        ],
        axis=1,
    )
    first, index = np.unique(pairs[0], return_index=True)
    last = pairs[1, index]
    turned = cup.points[first] * model.closure
    assert np.abs(cup.points[last] - turned).max() < 1e-9
    return first, last


def _forces(
    model: SolidSectorModel, state: SolidState, cup: MergedCup, *, cut: bool
) -> Array:
    """Nodal forces of wave generator and teeth (n, 3) [N].

    Args:
        model: The model.
        state: The state.
        cup: The mesh.
        cut: Whether the cuts run through loaded nodes, of whose forces half belongs to
            the mesh.
    """
    teeth = model.strip.mesh.teeth
    loaded = np.concatenate([teeth.flank.ravel(), teeth.bore.ravel()])
    number = cup.numbers["teeth"][:, loaded]
    turn = model.frames(state)[0].turn[: len(number)]
    force = model.strip.teeth.nodal_force(model.loads(state))
    force = force[: len(number)].reshape(len(number), -1, 3)
    force = np.einsum("sij,spj->spi", turn, force)
    result = np.zeros_like(cup.points)
    there = number >= 0
    np.add.at(result, number[there], force[there])
    if cut:
        on_cut = (np.abs(cup.points[:, :2]) < 1e-10).any(axis=1)
        result[on_cut] *= 0.5
    return result

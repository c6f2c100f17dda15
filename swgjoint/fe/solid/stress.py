"""Nodal stresses of all sectors of the 3D model, and their maxima."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swgjoint.fe.plane.stress import StressMaxima
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.strip.elasticity import COLUMNS, ROWS, stress_maxima
from swgjoint.typing import Array, Index


def flexspline_stresses(model: SolidSectorModel, state: SolidState) -> dict[str, Array]:
    """Stress xx, yy, zz, xy, yz, zx at the nodes by segment (N, n_nodes, 6) [Pa].

    Stresses are in the frames of the segments. At nodes on a face the stresses of both
    sectors are averaged, at nodes on a section those of both segments.

    Args:
        model: The 3D model.
        state: The equilibrium.
    """
    found: dict[str, Array] = {}
    loads = model.loads(state)
    frames = model.frames(state)
    for number, (segment, frame) in enumerate(
        zip(model.strip.segments, frames, strict=True)
    ):
        u = segment.displacement(frame.deformation, None if number else loads)
        stress = segment.stresses(u)
        faces = segment.mesh.first, segment.mesh.last
        average_faces(stress, frame.turn, *faces, model.closure)
        found[segment.name] = stress
    for k, (one, other) in enumerate(pairwise(model.strip.segments)):
        if one.mesh.end is not None and other.mesh.begin is not None:
            sections = one.mesh.end.ravel(), other.mesh.begin.ravel()
            turns = frames[k].turn, frames[k + 1].turn
            average_sections(found[one.name], found[other.name], turns, sections)
    return found


def circular_spline_stresses(
    model: SolidSectorModel, state: SolidState
) -> Array | None:
    """Stress xx, yy, zz, xy, yz, zx at the nodes of the circular spline.

    At nodes on a face the stresses of both teeth are averaged.

    Args:
        model: The 3D model.
        state: The equilibrium.

    Returns:
        Stress in the frames of the teeth (N_c, n_nodes, 6) [Pa]; None for a rigid
        circular spline.
    """
    gear = model.teeth.elastic_circular_spline
    if gear is None:
        return None
    u = gear.nodal_displacement(state.circular_spline_force)
    stress = np.asarray((gear.body.stress @ u.reshape(len(u), -1).T).T)
    stress = np.ascontiguousarray(stress.reshape(len(u), -1, 6))
    teeth = model.teeth.circular_spline.profile.teeth
    turn = about_z(
        2.0 * np.pi / teeth * np.arange(model.teeth.circular_spline_teeth, dtype=float)
    )
    segment = gear.mesh.teeth.segment
    average_faces(stress, turn, segment.first, segment.last, model.closure)
    return stress


def average_faces(
    stress: Array, turn: Array, first: Index, last: Index, closure: Array
) -> None:
    """Average the stress on every face over the two sectors that share it, in place.

    Args:
        stress: Stress by sector and node in the frames of the sectors (N, n_nodes, 6)
            [Pa].
        turn: Rotations of these frames (N, 3, 3).
        first: Nodes on the first face.
        last: Nodes on the last face, which is the first face of the next sector, in the
            same order.
        closure: Factors on x, y, z where the ring closes, see
            :class:`swgjoint.fe.solid.sector_model.SolidSectorModel` (3,).
    """
    after = np.roll(turn, -1, axis=0)
    after[-1] *= closure[:, None]
    step = np.einsum("sji,sjk->sik", turn, after)
    mean = 0.5 * (
        stress[:, last] + turned_stress(np.roll(stress[:, first], -1, axis=0), step)
    )
    stress[:, last] = mean
    back = turned_stress(mean, step.transpose(0, 2, 1))
    stress[:, first] = np.roll(back, 1, axis=0)


def average_sections(
    one: Array, other: Array, turns: tuple[Array, Array], sections: tuple[Index, Index]
) -> None:
    """Average the stress on a section over the two segments that share it, in place.

    Args:
        one: Stress by sector and node in the frames of a segment (N, n_nodes, 6) [Pa].
        other: Stress of the next segment in its own frames (N, n_nodes, 6) [Pa].
        turns: Rotations of the frames of both segments, each (N, 3, 3).
        sections: Nodes of the section in both segments, in the same order.
    """
    end, begin = sections
    step = np.einsum("sji,sjk->sik", *turns)
    mean = 0.5 * (one[:, end] + turned_stress(other[:, begin], step))
    one[:, end] = mean
    other[:, begin] = turned_stress(mean, step.transpose(0, 2, 1))


def turned_stress(stress: Array, turn: Array) -> Array:
    """Rotate stresses to other frames, R sigma R^T (N, n, 6) [Pa].

    Args:
        stress: Components xx, yy, zz, xy, yz, zx in the original frames (N, n, 6) [Pa].
        turn: Rotations R from the original frames to the other ones (N, 3, 3).
    """
    tensor = np.empty((*stress.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):
        tensor[..., i, j] = tensor[..., j, i] = stress[..., k]
    tensor = turn[:, None] @ tensor @ turn.transpose(0, 2, 1)[:, None]
    return np.stack([tensor[..., i, j] for i, j in zip(ROWS, COLUMNS, strict=True)], -1)


@dataclass(frozen=True, kw_only=True)
class StressPlace:
    """Location of the largest von Mises stress of the flexspline."""

    part: str
    """Name of the segment, or part of the toothed segment: ``tooth``, ``root``,
    ``bore`` or ``back edge``."""
    sector: int
    """Number of the sector."""
    position: tuple[float, float, float]
    """Undeformed position x, y, z in the frame of the tooth [m]."""


@dataclass(frozen=True, kw_only=True)
class SolidMaxima:
    """Largest stresses of both members at one state."""

    flexspline: StressMaxima
    circular_spline: StressMaxima | None
    """Largest stresses of the circular spline; None if it is rigid."""
    by_part: dict[str, StressMaxima]
    """Largest stresses of the flexspline by segment."""
    place: StressPlace
    """Location of the largest von Mises stress of the flexspline."""

    @classmethod
    def from_state(cls, model: SolidSectorModel, state: SolidState) -> SolidMaxima:
        """Recover the largest stresses of a state.

        Args:
            model: The 3D model.
            state: The equilibrium.
        """
        by_part, places = {}, {}
        for name, stress in flexspline_stresses(model, state).items():
            maxima = stress_maxima(stress)
            by_part[name] = _largest(maxima)
            worst = np.unravel_index(int(maxima[2].argmax()), maxima[2].shape)
            places[name] = int(worst[0]), int(worst[1])
        worst_part = max(by_part, key=lambda name: by_part[name].von_mises)
        circular = circular_spline_stresses(model, state)
        return cls(
            flexspline=StressMaxima(
                tensile=max(part.tensile for part in by_part.values()),
                compressive=max(part.compressive for part in by_part.values()),
                von_mises=max(part.von_mises for part in by_part.values()),
            ),
            circular_spline=None
            if circular is None
            else _largest(stress_maxima(circular)),
            by_part=by_part,
            place=_place(model, worst_part, *places[worst_part]),
        )

    def to_json(self) -> dict[str, dict[str, float] | None]:
        """Largest stresses by member [MPa]; None for a rigid circular spline."""
        circular = self.circular_spline
        return {
            "flexspline": self.flexspline.to_json(),
            "circular_spline": None if circular is None else circular.to_json(),
        }


def _largest(maxima: tuple[Array, Array, Array]) -> StressMaxima:
    tensile, compressive, von_mises = (float(part.max()) for part in maxima)
    return StressMaxima(tensile=tensile, compressive=compressive, von_mises=von_mises)


def _place(model: SolidSectorModel, part: str, sector: int, node: int) -> StressPlace:
    """Location of a node in a segment, with the name of its part."""
    strip = model.strip
    number = [segment.name for segment in strip.segments].index(part)
    mesh = strip.mesh.segments[number].mesh
    x, y, z = (float(value) for value in np.asarray(mesh.p)[:, node])
    name = part
    if number == 0:
        radius, back = float(np.hypot(x, y)), strip.mesh.teeth.z[-1]
        bore = float(np.hypot(strip.bore[:, 0], strip.bore[:, 1]).min())
        root = strip.profile.dedendum_radius
        if z > back - 1e-9:
            name = "back edge"
        elif radius < bore + 1e-6:
            name = "bore"
        else:
            name = "tooth" if radius > root + 0.3 * (root - bore) else "root"
    return StressPlace(part=name, sector=sector, position=(x, y, z))

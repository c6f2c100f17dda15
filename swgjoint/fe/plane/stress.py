"""Recovery of the nodal stresses of all sectors of the 2D model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.sector_model import SectorModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.typing import Array


def flexspline_stress(model: SectorModel, state: State) -> Array:
    """Nodal stresses of the flexspline.

    Args:
        model: The 2D model.
        state: An equilibrium.

    Returns:
        Components xx, yy, xy, zz in the sector frames (N, n_nodes, 4) [Pa].
    """
    frames = model.frames(state)
    return _nodal_stress(
        model.element, frames.deformation, state.flank_force, frames.angle
    )


def circular_spline_stress(model: SectorModel, state: State) -> Array | None:
    """Nodal stresses of the circular spline.

    Args:
        model: The 2D model.
        state: An equilibrium.

    Returns:
        Components xx, yy, xy, zz in the frames of its teeth (N_c, n_nodes, 4) [Pa];
        None for a rigid circular spline.
    """
    compliance = model.circular_spline.compliance
    if compliance is None:
        return None
    teeth = np.arange(model.circular_spline_teeth)
    return _nodal_stress(
        compliance.element,
        compliance.skeleton_displacement(state.circular_spline_force),
        state.circular_spline_force,
        np.asarray(2.0 * np.pi / model.circular_spline.profile.teeth * teeth, float),
    )


def _nodal_stress(
    element: Superelement, deformation: Array, flank_force: Array, angle: Array
) -> Array:
    """Nodal stresses of all sectors; on a face, the mean of the two sectors.

    Args:
        element: Condensed sector of the member.
        deformation: Skeleton displacements in the sector frames (N, 2 n_a) [m].
        flank_force: Forces on the flank nodes in the sector frames (N, 2 n_b) [N].
        angle: Angles of the sector frames (N,) [rad].
    """
    nodes = len(element.stress_from_skeleton)
    stress = deformation @ element.stress_from_skeleton.reshape(nodes * 3, -1).T
    stress += flank_force @ element.stress_from_flank.reshape(nodes * 3, -1).T
    stress = stress.reshape(len(angle), nodes, 3)
    first, last = element.mesh.face_first, element.mesh.face_last
    # rotation from each sector's frame to the next one
    step = (np.roll(angle, -1) - angle)[:, None]
    after = np.roll(stress[:, first], -1, axis=0)
    mean = 0.5 * (stress[:, last] + turned_stress(after, step))
    stress[:, last] = mean
    stress[:, first] = np.roll(turned_stress(mean, -step), 1, axis=0)
    axial = element.axial_stress * (stress[..., :1] + stress[..., 1:2])
    return np.concatenate([stress, axial], axis=-1)


def turned_stress(stress: Array, angle: Array) -> Array:
    """Stress components in another frame about the same axis.

    Args:
        stress: Components xx, yy, xy and optionally the axial stress zz, which does not
            change, in the last axis (..., 3 or 4) [Pa].
        angle: Angle from the new frame to the frame of ``stress``, counter-clockwise
            (...) [rad].
    """
    xx, yy, xy = stress[..., 0], stress[..., 1], stress[..., 2]
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    cos, sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
    turned = half * cos - xy * sin
    plane = [middle + turned, middle - turned, half * sin + xy * cos]
    return np.concatenate([np.stack(plane, axis=-1), stress[..., 3:]], axis=-1)


@dataclass(frozen=True, kw_only=True)
class StressMaxima:
    """Largest nodal stresses of one member."""

    tensile: float
    """Largest tensile stress [Pa]."""
    compressive: float
    """Largest compressive stress as a magnitude [Pa]."""
    von_mises: float
    """Largest von Mises stress [Pa]."""

    @classmethod
    def from_stress(cls, stress: Array) -> StressMaxima:
        """Maxima over all nodes of stresses xx, yy, xy, zz (..., 4) [Pa]."""
        tensile, compressive, von_mises = stress_maxima(stress)
        return cls(
            tensile=float(tensile.max()),
            compressive=float(compressive.max()),
            von_mises=float(von_mises.max()),
        )

    def to_json(self) -> dict[str, float]:
        """Largest stresses by kind [MPa]."""
        return {kind: getattr(self, kind) / 1e6 for kind in KINDS}


KINDS = ("tensile", "compressive", "von_mises")
"""Kinds of stress, as the fields of :class:`StressMaxima` name them."""


@dataclass(frozen=True, kw_only=True)
class MemberMaxima:
    """Largest stresses of both members at one state."""

    flexspline: StressMaxima
    """Stresses of the flexspline."""
    circular_spline: StressMaxima | None
    """Stresses of the circular spline; None if it is rigid."""

    @classmethod
    def from_state(cls, model: SectorModel, state: State) -> MemberMaxima:
        """Largest stresses of both members at a state.

        Args:
            model: The 2D model.
            state: An equilibrium.
        """
        circular_spline = circular_spline_stress(model, state)
        return cls(
            flexspline=StressMaxima.from_stress(flexspline_stress(model, state)),
            circular_spline=None
            if circular_spline is None
            else StressMaxima.from_stress(circular_spline),
        )

    def to_json(self) -> dict[str, dict[str, float] | None]:
        """Largest stresses by member and kind [MPa]; None for a rigid member."""
        circular_spline = self.circular_spline
        return {
            "flexspline": self.flexspline.to_json(),
            "circular_spline": None
            if circular_spline is None
            else circular_spline.to_json(),
        }

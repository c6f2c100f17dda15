"""Stress recovery at the nodes of all sectors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.ring import RingModel
from swgjoint.fe.plane.state import State
from swgjoint.fe.plane.superelement import Superelement
from swgjoint.typing import Array


def flexspline_stress(model: RingModel, state: State) -> Array:
    """Stress xx, yy, xy, zz at the nodes, sector frames (N, n_nodes, 4) [Pa]."""
    frames = model.frames(state)
    return _nodal_stress(
        model.element, frames.deformation, state.flank_force, frames.angle
    )


def circular_spline_stress(model: RingModel, state: State) -> Array | None:
    """The same in the frames of the circular spline's teeth; None if it is rigid."""
    compliance = model.circular_spline.compliance
    if compliance is None:
        return None
    teeth = np.arange(model.ring_teeth)
    return _nodal_stress(
        compliance.element,
        compliance.skeleton_displacement(state.ring_force),
        state.ring_force,
        np.asarray(2.0 * np.pi / model.circular_spline.profile.teeth * teeth, float),
    )


def _nodal_stress(
    element: Superelement, deformation: Array, flank_force: Array, angle: Array
) -> Array:
    """Stress of every sector; nodes on the faces get the mean of their two sectors."""
    nodes = len(element.stress_from_skeleton)
    stress = deformation @ element.stress_from_skeleton.reshape(nodes * 3, -1).T
    stress += flank_force @ element.stress_from_flank.reshape(nodes * 3, -1).T
    stress = stress.reshape(len(angle), nodes, 3)
    first, last = element.mesh.face_first, element.mesh.face_last
    # angle of each sector's frame seen from the one before it
    step = (np.roll(angle, -1) - angle)[:, None]
    after = np.roll(stress[:, first], -1, axis=0)
    mean = 0.5 * (stress[:, last] + turned_stress(after, step))
    stress[:, last] = mean
    stress[:, first] = np.roll(turned_stress(mean, -step), 1, axis=0)
    axial = element.axial_stress * (stress[..., :1] + stress[..., 1:2])
    return np.concatenate([stress, axial], axis=-1)


def turned_stress(stress: Array, angle: Array) -> Array:
    """Components in a frame from which the given one is turned by ``angle``.

    What follows xx, yy and xy in the last axis, the axial stress, stays as it is.
    """
    xx, yy, xy = stress[..., 0], stress[..., 1], stress[..., 2]
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    cos, sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
    turned = half * cos - xy * sin
    plane = [middle + turned, middle - turned, half * sin + xy * cos]
    return np.concatenate([np.stack(plane, axis=-1), stress[..., 3:]], axis=-1)


@dataclass(frozen=True, kw_only=True)
class StressMaxima:
    """Largest nodal stresses of one member [Pa]; compression as a magnitude."""

    tensile: float
    compressive: float
    von_mises: float

    @classmethod
    def from_stress(cls, stress: Array) -> StressMaxima:
        """Maxima over all nodes of stresses (..., 4)."""
        tensile, compressive, von_mises = stress_maxima(stress)
        return cls(
            tensile=float(tensile.max()),
            compressive=float(compressive.max()),
            von_mises=float(von_mises.max()),
        )

    def to_json(self) -> dict[str, float]:
        """Values in MPa."""
        return {kind: getattr(self, kind) / 1e6 for kind in KINDS}


KINDS = ("tensile", "compressive", "von_mises")


@dataclass(frozen=True, kw_only=True)
class MemberMaxima:
    """Largest stresses of both members at one state."""

    flexspline: StressMaxima
    circular_spline: StressMaxima | None
    """None while it is rigid."""

    @classmethod
    def from_state(cls, model: RingModel, state: State) -> MemberMaxima:
        """Recover the stresses of a state."""
        ring = circular_spline_stress(model, state)
        return cls(
            flexspline=StressMaxima.from_stress(flexspline_stress(model, state)),
            circular_spline=None if ring is None else StressMaxima.from_stress(ring),
        )

    def to_json(self) -> dict[str, dict[str, float] | None]:
        """Values in MPa by member, null for a rigid circular spline."""
        ring = self.circular_spline
        return {
            "flexspline": self.flexspline.to_json(),
            "circular_spline": None if ring is None else ring.to_json(),
        }

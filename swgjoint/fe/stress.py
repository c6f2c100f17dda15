"""Stress recovery at the nodes of all sectors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.elasticity import stress_maxima
from swgjoint.fe.ring import RingModel
from swgjoint.fe.state import State

Array = NDArray[np.float64]


def nodal_stress(model: RingModel, state: State) -> Array:
    """Stress xx, yy, xy at the nodes, in the sector frames [Pa]. (N, n_nodes, 3).

    Nodes on the faces get the mean of the two sectors that share them.
    """
    element, frames = model.element, model.frames(state)
    nodes = len(element.stress_from_skeleton)
    stress = frames.deformation @ element.stress_from_skeleton.reshape(nodes * 3, -1).T
    stress += state.flank_force @ element.stress_from_flank.reshape(nodes * 3, -1).T
    stress = stress.reshape(model.sectors, nodes, 3)
    first, last = element.mesh.face_first, element.mesh.face_last
    # angle of each sector's frame seen from the one before it
    step = np.roll(frames.angle, -1) - frames.angle
    after = np.roll(stress[:, first], -1, axis=0)
    mean = 0.5 * (stress[:, last] + _turned(after, step[:, None]))
    stress[:, last] = mean
    stress[:, first] = np.roll(_turned(mean, -step[:, None]), 1, axis=0)
    return stress


def _turned(stress: Array, angle: Array) -> Array:
    """Components in a frame from which the given one is turned by ``angle``."""
    xx, yy, xy = stress[..., 0], stress[..., 1], stress[..., 2]
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    cos, sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
    turned = half * cos - xy * sin
    return np.stack([middle + turned, middle - turned, half * sin + xy * cos], axis=-1)


@dataclass(frozen=True, kw_only=True)
class StressMaxima:
    """Largest stresses of one member at one state [Pa]; compression as a magnitude."""

    tensile: float
    compressive: float
    von_mises: float

    def to_json(self) -> dict[str, float]:
        """Values in MPa."""
        return {
            key: getattr(self, key) / 1e6
            for key in ("tensile", "compressive", "von_mises")
        }


def flexspline_maxima(model: RingModel, state: State) -> StressMaxima:
    """Largest nodal stresses of the flexspline."""
    tensile, compressive, von_mises = stress_maxima(nodal_stress(model, state))
    return StressMaxima(
        tensile=float(tensile.max()),
        compressive=float(compressive.max()),
        von_mises=float(von_mises.max()),
    )

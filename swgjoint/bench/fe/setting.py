"""Settings of ``swgjoint bench fe``, and the results of each.

Every setting solves the same positions over one pitch: unloaded for the kinematic
error, and at rated torque for stiffness, stress and rim shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, TypeVar

import numpy as np

from swgjoint.errors import ComputationError
from swgjoint.fe.plane.state import State
from swgjoint.fe.rings.state import ThinRingState
from swgjoint.fe.solid.state import SolidState
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array

AnyState = TypeVar("AnyState", State, SolidState, ThinRingState)

POSITIONS = 4
"""Number of positions over one pitch, the same in every setting."""
RIM = 90
"""Number of angles over half a turn at which the rim shape is compared."""


@dataclass(frozen=True, kw_only=True)
class FeSetting:
    """One model with its mesh refinement."""

    model: str
    """``ring``, ``2d`` or ``3d``."""
    refinement: float
    """Mesh refinement [-]; for thin rings half the number of elements per tooth pitch,
    zero for closed forms."""
    nonlinear: bool = True
    """Whether the sectors undergo large rotations; no effect on thin rings."""
    full: bool = False
    """Whether all teeth are modelled even if symmetry allows half of them."""

    @property
    def name(self) -> str:
        """Name of the setting in tables, without the model."""
        if self.model == "ring":
            if not self.refinement:
                return "closed form"
            return f"thin rings, refinement {self.refinement:g}"
        return (
            f"refinement {self.refinement:g}"
            + ("" if self.nonlinear else ", linear")
            + (", all teeth" if self.full else "")
        )

    @property
    def key(self) -> str:
        """Unique name: model and name."""
        return f"{self.model}, {self.name}"

    @property
    def kind(self) -> str:
        """Kind of the setting: model and linearity.

        Settings of one kind differ only in their mesh and in the number of modelled
        teeth.
        """
        return self.model + ("" if self.nonlinear else " linear")


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """Results of a setting."""

    stiffness: float | None
    """Mean tangent stiffness at rated torque [N·m/rad]."""
    kinematic_error: Array | None
    """Unloaded output error minus its mean, shape (POSITIONS,) [rad]."""
    tensile: float | None
    """Largest tensile stress of the flexspline, averaged over the positions [Pa]."""
    rim_shape: Array | None = None
    """Radial deflection of the bore at mid-face, at angles from the major axis of the
    wave generator, under rated torque at the first position, shape (RIM,) [m]."""
    wall_s: float
    """Wall time [s]."""
    cpu_s: float | None = None
    """CPU time of all threads [s]; None if it was not measured."""
    peak_MB: float | None = None
    """Largest resident memory of the process [MB]; None if it was not measured."""
    nodes: int | None = None
    """Number of nodes in one sector of the flexspline, or of a thin ring per tooth
    pitch; None for closed forms."""


def require_equilibrium(state: AnyState) -> AnyState:
    """Return the state unchanged if it is an equilibrium.

    Raises:
        ComputationError: If it is not an equilibrium.
    """
    if not state.outcome.ok:
        raise ComputationError(state.outcome.value)
    return state


def positions(design: Design) -> Array:
    """Input angles over one pitch [rad], shape (POSITIONS,)."""
    pitch = 2.0 * pi / design.periodicity
    return np.asarray(pitch * np.arange(POSITIONS) / POSITIONS)


def mean_of(
    error: Sequence[float],
    compliance: Sequence[float],
    tensile: Sequence[float],
    **rest: Any,
) -> Found:
    """Combine the solved positions into the results of a setting.

    Args:
        error: Unloaded output error at each position [rad].
        compliance: Compliance at rated torque at each position [rad/(N·m)].
        tensile: Largest tensile stress at rated torque at each position [Pa].
        **rest: Other fields of :class:`Found`.
    """
    return Found(
        stiffness=1.0 / float(np.mean(compliance)),
        kinematic_error=np.array(error) - np.mean(error),
        tensile=float(np.mean(tensile)),
        **rest,
    )


def rim_shape(points: Array, radius: float, alpha: float) -> Array:
    """Radial deflection at equally spaced angles from the major axis.

    Points of both half turns are mapped onto one half turn.

    Args:
        points: Points of the deflected rim in any order, shape (n, 2) [m].
        radius: Undeformed radius of the rim [m].
        alpha: Wave-generator angle, from the y axis to the major axis [rad].

    Returns:
        Deflection, shape (RIM,) [m].
    """
    phi = np.mod(np.arctan2(-points[:, 0], points[:, 1]) - alpha, pi)
    at = pi * np.arange(RIM) / RIM
    outward = np.hypot(points[:, 0], points[:, 1]) - radius
    return np.asarray(np.interp(at, phi, outward, period=pi))

"""What ``swgjoint bench fe`` solves, and what it keeps of a solution.

Every setting solves the same positions over one pitch: without torque for the kinematic
error, at rated torque for stiffness, stress and the shape of the rim.
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
"""Over one pitch; the same ones in every setting."""
RIM = 90
"""Angles over half a turn at which the shape of the rim is compared."""


@dataclass(frozen=True, kw_only=True)
class FeSetting:
    """One model and its effort."""

    model: str
    """``ring``, ``2d`` or ``3d``."""
    refinement: float
    """Of the mesh; of thin rings elements a tooth pitch over two, 0 for closed forms.
    """
    nonlinear: bool = True
    full: bool = False
    """All teeth also where half of them would do."""

    @property
    def name(self) -> str:
        """As the table has it."""
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
        """Model and name."""
        return f"{self.model}, {self.name}"

    @property
    def kind(self) -> str:
        """Settings of one kind differ in their mesh alone."""
        return self.model + ("" if self.nonlinear else " linear")


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """What a setting says of the drive."""

    stiffness: float | None
    """Mean tangent at rated torque [N·m/rad]."""
    kinematic_error: Array | None
    """Unloaded output error less its mean (POSITIONS,) [rad]."""
    tensile: float | None
    """Mean over the positions of the largest tensile stress of the flexspline [Pa]."""
    rim_shape: Array | None = None
    """Radial deflection of the bore at mid-face, from the major axis of the wave
    generator, under rated torque at the first position (RIM,) [m]."""
    wall_s: float
    cpu_s: float | None = None
    """Of all threads."""
    peak_MB: float | None = None
    """Largest resident memory of the process that did nothing else."""
    nodes: int | None = None
    """Nodes of one sector of the flexspline."""


def require_equilibrium(state: AnyState) -> AnyState:
    """The state, if it is an equilibrium.

    Raises:
        ComputationError: If it is not.
    """
    if not state.outcome.ok:
        raise ComputationError(state.outcome.value)
    return state


def positions(design: Design) -> Array:
    """Input angles over one pitch [rad]."""
    pitch = 2.0 * pi / design.periodicity
    return np.asarray(pitch * np.arange(POSITIONS) / POSITIONS)


def mean_of(
    error: Sequence[float],
    compliance: Sequence[float],
    tensile: Sequence[float],
    **rest: Any,
) -> Found:
    """What the solved positions say together.

    Args:
        error: Unloaded output error at each [rad].
        compliance: At rated torque [rad/(N·m)].
        tensile: Largest tensile stress there [Pa].
        **rest: Other fields of :class:`Found`.
    """
    return Found(
        stiffness=1.0 / float(np.mean(compliance)),
        kinematic_error=np.array(error) - np.mean(error),
        tensile=float(np.mean(tensile)),
        **rest,
    )


def rim_shape(points: Array, radius: float, alpha: float) -> Array:
    """Radial deflection at equal angles from the major axis, half turns folded.

    Args:
        points: Of the deflected rim, anywhere around (n, 2) [m].
        radius: Undeformed [m].
        alpha: Wave-generator angle [rad].
    """
    phi = np.mod(np.arctan2(-points[:, 0], points[:, 1]) - alpha, pi)
    at = pi * np.arange(RIM) / RIM
    outward = np.hypot(points[:, 0], points[:, 1]) - radius
    return np.asarray(np.interp(at, phi, outward, period=pi))

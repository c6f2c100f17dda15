"""Figures of a specification sheet that a map does not contain.

These are the radial stiffness and the fatigue safety factor.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

from swgjoint.errors import DesignError
from swgjoint.fe.solid.figures.fatigue import fatigue
from swgjoint.fe.solid.figures.radial_stiffness import radial_stiffness
from swgjoint.gear.design.design import Design
from swgjoint.maps.cache import recall
from swgjoint.progress import Progress, silent


@dataclass(frozen=True, kw_only=True)
class SolidFigures:
    """Figures of a specification sheet from the 3D model."""

    values: dict[str, float] = field(default_factory=dict)
    """Computed figures by key, in the unit that the key states."""
    missing: dict[str, str] = field(default_factory=dict)
    """Reasons why figures are not available for this design, by key."""
    details: dict[str, Any] = field(default_factory=dict)
    """Load cases, locations and error estimates, by ``radial_stiffness`` and
    ``fatigue``."""


def solid_figures(
    design: Design,
    keys: Collection[str],
    torque: float,
    *,
    progress: Progress = silent,
) -> SolidFigures:
    """Compute ``radial_stiffness_N_mm`` and ``fatigue_safety_factor``.

    The safety factor is the smallest one over the face width. A figure can take several
    minutes to compute and is stored in the user's cache.

    Args:
        design: The drive.
        keys: Keys of the sheet. Only figures with these keys are computed; other keys
            are ignored.
        torque: Output torque at which fatigue is assessed, usually the rated torque
            [N·m].
        progress: Called during the computation.

    Raises:
        ComputationError: If a solve fails or the model does not fit in memory.
    """

    def radial() -> SolidFigures:
        result = radial_stiffness(design, progress=progress)
        return SolidFigures(
            values={"radial_stiffness_N_mm": result.mid_face / 1e3},
            details={"radial_stiffness": result.to_json()},
        )

    def safety() -> SolidFigures:
        (result,) = fatigue(design, [torque], progress=progress)
        return SolidFigures(
            values={"fatigue_safety_factor": result.worst.safety.combined},
            details={"fatigue": result.to_json()},
        )

    compute: dict[str, Callable[[], SolidFigures]] = {
        "fatigue_safety_factor": safety,
        "radial_stiffness_N_mm": radial,
    }
    figures = SolidFigures()
    for key, work in compute.items():
        if key not in keys:
            continue
        if design.cup is None:
            figures.missing[key] = "needs a design with a [cup]"
            continue
        parts: dict[str, Any] = {"figure": key, "design": design.content_hash()}
        if work is safety:
            parts["torque"] = torque
        try:
            one = recall("figures", parts, SolidFigures, work)
        except DesignError as fault:
            figures.missing[key] = "; ".join(str(fault).splitlines())
        else:
            figures.values.update(one.values)
            figures.details.update(one.details)
    return figures

"""Figures of a specification sheet beyond those of a map: radial stiffness, fatigue."""

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
    """Computed figures, in the units of their keys."""

    values: dict[str, float] = field(default_factory=dict)
    """Figures by key."""
    missing: dict[str, str] = field(default_factory=dict)
    """Reasons, by key, why a figure is not available for this design."""
    details: dict[str, Any] = field(default_factory=dict)
    """Load case, location and error estimates of ``radial_stiffness`` and ``fatigue``.
    """


def solid_figures(
    design: Design,
    keys: Collection[str],
    torque: float,
    *,
    progress: Progress = silent,
) -> SolidFigures:
    """Compute ``radial_stiffness_N_mm`` and ``fatigue_safety_factor``.

    The safety factor is the smallest one of all sections over the face width. Each
    figure takes up to several minutes and is stored in the user's cache.

    Args:
        design: The drive.
        keys: Keys of the sheet; only these figures are computed, and keys other than
            the two above are ignored.
        torque: Torque at which fatigue is assessed, the rated one [N·m].
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

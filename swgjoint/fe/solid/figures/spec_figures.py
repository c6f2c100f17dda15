"""Figures of a spec sheet that no map holds: radial stiffness and fatigue."""

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
    """What was found, in the units of the keys."""

    values: dict[str, float] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    """Reason of every key that this design cannot have."""
    details: dict[str, Any] = field(default_factory=dict)
    """``radial_stiffness`` and ``fatigue``: where, how, and how sure."""


def solid_figures(
    design: Design,
    keys: Collection[str],
    torque: float,
    *,
    progress: Progress = silent,
) -> SolidFigures:
    """Compute the wanted ones of ``radial_stiffness_N_mm``, ``fatigue_safety_factor``.

    The safety factor is the least of all sections over the face width. Each figure
    takes up to minutes and is kept in the user's cache.

    Args:
        design: The drive.
        keys: Of the sheet; others are passed over.
        torque: At which fatigue is assessed, the rated one [N·m].
        progress: Called on the way.

    Raises:
        ComputationError: If a solve fails or memory will not do.
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
    found = SolidFigures()
    for key, work in compute.items():
        if key not in keys:
            continue
        if design.cup is None:
            found.missing[key] = "needs a design with a [cup]"
            continue
        parts: dict[str, Any] = {"figure": key, "design": design.content_hash()}
        if work is safety:
            parts["torque"] = torque
        try:
            one = recall("figures", parts, SolidFigures, work)
        except DesignError as fault:
            found.missing[key] = "; ".join(str(fault).splitlines())
        else:
            found.values.update(one.values)
            found.details.update(one.details)
    return found

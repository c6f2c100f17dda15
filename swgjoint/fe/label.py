"""Validity label of the samples of a map."""

from __future__ import annotations

from typing import Any

from swgjoint.fe.common.stress_state import stress_state_label
from swgjoint.fe.plane.drive2d import carries_bearing, unmodelled_parts
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import has_errors
from swgjoint.gear.mounting import springs_of


def label_of(design: Design, model: str) -> dict[str, Any]:
    """Validity label: what the samples of a model represent and what they neglect.

    Args:
        design: The drive.
        model: Fidelity, ``2d`` or ``3d``.
    """
    plane = model == "2d"
    return {
        "model": model,
        "level": "nonlinear",
        "circular_spline": "elastic, outside " + design.circular_spline.outer_rim,
        "cup": "closed-form torsion in series"
        if plane and design.cup is not None
        else None,
        "bearing": "balls at rest on the cam, their passage left out"
        if plane and carries_bearing(design)
        else None,
        "stress_state": stress_state_label(design) if plane else None,
        "springs_Nm_rad": springs_of(design),
        "friction": "left out of the potential; hysteresis of the 2d model"
        if design.friction.tooth_coefficient
        else None,
        "tolerances": _named(design),
        "left_out": unmodelled_parts(design, model),
    }


def _named(design: Design) -> dict[str, float] | None:
    """Nonzero tolerances of the drive, for the validity label."""
    values = design.tolerances.model_dump()
    return {k: v for k, v in values.items() if v} if has_errors(design) else None

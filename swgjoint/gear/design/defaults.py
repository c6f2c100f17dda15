"""Values that a design file leaves to their default."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel

from swgjoint.gear.design.design import Design

ASSUMED = (
    "material",
    "drive",
    "flexspline",
    "circular_spline",
    "wave_generator",
    "cup",
)
"""Tables whose values every result depends on; an absent one among the others means
that there is no such part, error or friction."""


def defaults_taken(design: Design) -> dict[str, Any]:
    """Numbers and choices by dotted key that the file does not state.

    Those that are zero or absent by default are left out: they add nothing.
    """
    found: dict[str, Any] = {}
    for name in ASSUMED:
        table = getattr(design, name)
        if table is not None:
            found |= _unset(table, f"{name}.")
    return found


def _unset(table: BaseModel, above: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, BaseModel):
            found |= _unset(value, f"{above}{name}.")
        elif name not in table.model_fields_set and value not in (None, 0.0, ""):
            found[f"{above}{name}"] = value
    return found

"""Default values that a design takes because its file does not state them."""

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
"""Tables whose default values affect every result. Without one of the other tables, the
drive does not have the part, the error or the friction that this table describes."""


def defaults_taken(design: Design) -> dict[str, Any]:
    """Default values of numbers and choices that the design file does not state.

    Defaults that are zero, empty or None are omitted because they have no effect.

    Returns:
        Default values by dotted key, in the unit of the key.
    """
    defaults: dict[str, Any] = {}
    for name in ASSUMED:
        table = getattr(design, name)
        if table is not None:
            defaults |= _unset(table, f"{name}.")
    return defaults


def _unset(table: BaseModel, above: str) -> dict[str, Any]:
    defaults: dict[str, Any] = {}
    for name in type(table).model_fields:
        value = getattr(table, name)
        if isinstance(value, BaseModel):
            defaults |= _unset(value, f"{above}{name}.")
        elif name not in table.model_fields_set and value not in (None, 0.0, ""):
            defaults[f"{above}{name}"] = value
    return defaults

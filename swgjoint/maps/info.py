"""The record ``info`` of a map that comes from a file: what is read of it is checked.

A map is sound without its record. So a known key of another kind than this package
writes is left out with a warning instead of refusing the map, and whoever reads a key
may rely on its kind. ``validation`` has a reader of its own, see
:mod:`swgjoint.maps.sheet.map_validity`; unknown keys are kept as they are.
"""

from __future__ import annotations

import warnings
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from swgjoint.errors import MapFileError

MOST_DEPTH = 30
"""Tables and lists inside each other; a validation record has five."""
Number = Annotated[float, Field(ge=-1e60, le=1e60, allow_inf_nan=False, strict=True)]
Text = Annotated[str, Field(strict=True)]


class Pruned(BaseModel):
    """What was dropped, and bounds of the effect."""

    model_config = ConfigDict(extra="allow")

    tolerance_arcmin: Number
    dropped: list[tuple[int, int]]
    output_angle_bound_arcmin: Number
    kinematic_error_bound_arcmin: Number
    torque_bound_Nm: Number
    harmonics: int


class Label(BaseModel):
    """What the elements model; other entries are shown as they are."""

    model_config = ConfigDict(extra="allow")

    stress_state: Text | None = None


KINDS: dict[str, TypeAdapter[Any]] = {
    **dict.fromkeys(
        (
            *("source", "design_hash", "ratings_source", "manufacturing_errors"),
            *("kinematic_error", "hysteresis"),
        ),
        TypeAdapter(Text),
    ),
    "pruned": TypeAdapter(Pruned),
    "stated": TypeAdapter(dict[str, Number | None]),
    "missing": TypeAdapter(dict[str, Text]),
    "label": TypeAdapter(Label),
    "sampled_torque_Nm": TypeAdapter(tuple[Number, Number]),
    "hysteresis_left_out": TypeAdapter(Annotated[int, Field(strict=True, ge=0)]),
    "residual": TypeAdapter(dict[str, Any]),
    "energy_check": TypeAdapter(dict[str, Any]),
    "perfect_teeth": TypeAdapter(dict[str, Any]),
    "stiffness_range_Nm_rad": TypeAdapter(tuple[Number, Number]),
}
"""Keys that are read anywhere, and of what kind they are."""


def sound_info(info: dict[str, Any], *, name: str) -> dict[str, Any]:
    """The record without keys of a wrong kind, of which one warning tells.

    Args:
        info: As the file has it.
        name: Of the map, for the warning.
    """
    wrong = [
        key for key, kind in KINDS.items() if key in info and not _fits(kind, info[key])
    ]
    if wrong:
        warnings.warn(
            f"map {name[:60]!r}: info {', '.join(wrong)} left out: of another kind than"
            " swgjoint writes; the drive is the same without",
            stacklevel=2,
        )
    return {key: value for key, value in info.items() if key not in wrong}


def _fits(kind: TypeAdapter[Any], value: Any) -> bool:
    try:
        kind.validate_python(value)
    except ValidationError:
        return False
    return True


def check_texts(content: Any) -> None:
    """Refuse a header that could not be written again.

    Raises:
        MapFileError: If it is nested too deep, or a text has half a character.
    """
    todo = [(content, 0)]
    while todo:
        value, depth = todo.pop()
        if depth > MOST_DEPTH:
            raise MapFileError(
                f"header nested too deep; accepted: {MOST_DEPTH} tables and lists"
            )
        if isinstance(value, dict):
            todo += [(one, depth + 1) for pair in value.items() for one in pair]
        elif isinstance(value, list):
            todo += [(one, depth + 1) for one in value]
        elif isinstance(value, str):
            try:
                value.encode()
            except UnicodeEncodeError:
                raise MapFileError("header with text that is not Unicode") from None

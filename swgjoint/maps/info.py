"""Checks of the record ``info`` of a map that was read from a file.

A map is usable without its record. A known key is therefore dropped with a warning if
its type differs from the one that this package writes, so that code that reads a key
can rely on its type. ``validation`` has its own reader, see
:mod:`swgjoint.maps.sheet.map_validity`; unknown keys are kept unchanged.
"""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from swgjoint.errors import MapFileError

MOST_DEPTH = 30
"""Deepest accepted nesting of objects and lists; a validation record has 5 levels."""
Number = Annotated[float, Field(ge=-1e60, le=1e60, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e30, allow_inf_nan=False, strict=True)]
Text = Annotated[str, Field(strict=True)]


class Pruned(BaseModel):
    """Dropped harmonics and bounds on their effect."""

    model_config = ConfigDict(extra="allow")

    tolerance_arcmin: Number
    dropped: list[tuple[int, int]]
    output_angle_bound_arcmin: Number
    kinematic_error_bound_arcmin: Number
    torque_bound_Nm: Number
    harmonics: int


class Label(BaseModel):
    """What the finite elements model; other entries are not checked."""

    model_config = ConfigDict(extra="allow")

    stress_state: Text | None = None


class FrictionTable(BaseModel):
    """Friction over temperature, see :mod:`swgjoint.maps.friction_temperature`."""

    model_config = ConfigDict(extra="allow")

    temperature_C: Annotated[list[Number], Field(min_length=2, max_length=1000)]
    lubricant: Text
    source: Text
    coulomb_Nm: list[NotNegative]
    static_Nm: list[NotNegative]
    stribeck_rad_s: list[NotNegative]
    viscous_Nms_rad: list[NotNegative]
    load: list[NotNegative]
    stiffness_Nm_rad: list[NotNegative]
    damping_Nms_rad: list[NotNegative]

    @model_validator(mode="after")
    def _sound(self) -> Self:
        grid = self.temperature_C
        columns = [
            *(self.coulomb_Nm, self.static_Nm, self.viscous_Nms_rad, self.load),
            *(self.stribeck_rad_s, self.stiffness_Nm_rad, self.damping_Nms_rad),
        ]
        if any(len(column) != len(grid) for column in columns):
            raise ValueError("columns of different lengths")
        if any(b <= a for a, b in pairwise(grid)):
            raise ValueError("temperatures do not increase")
        if min(*self.stiffness_Nm_rad, *self.stribeck_rad_s) < 1e-30:
            raise ValueError("stiffness or Stribeck speed is not positive")
        if any(s < c for s, c in zip(self.static_Nm, self.coulomb_Nm, strict=True)):
            raise ValueError("static friction below Coulomb friction")
        return self


KINDS: dict[str, TypeAdapter[Any]] = {
    **dict.fromkeys(
        (
            *("source", "design_hash", "ratings_source", "manufacturing_errors"),
            *("kinematic_error", "hysteresis"),
        ),
        TypeAdapter(Text),
    ),
    "pruned": TypeAdapter(Pruned),
    "friction_over_temperature": TypeAdapter(FrictionTable),
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
"""Types of the keys that the package reads from the record of a loaded map."""


def sound_info(info: dict[str, Any], *, name: str) -> dict[str, Any]:
    """The record without keys of a wrong type; one warning lists the dropped keys.

    Args:
        info: Record as read from the file.
        name: Name of the map for the warning.
    """
    wrong = [
        key for key, kind in KINDS.items() if key in info and not _fits(kind, info[key])
    ]
    if wrong:
        warnings.warn(
            f"map {name[:60]!r}: info {', '.join(wrong)} ignored: the type differs from"
            " the one that swgjoint writes; the drive itself is not affected",
            stacklevel=2,
        )
    return {key: value for key, value in info.items() if key not in wrong}


def _fits(kind: TypeAdapter[Any], value: Any) -> bool:
    """Whether a value has the required type."""
    try:
        kind.validate_python(value)
    except ValidationError:
        return False
    return True


def check_texts(content: Any) -> None:
    """Reject a header that could not be written to a file again.

    Raises:
        MapFileError: If it is nested too deeply or a text is not valid Unicode.
    """
    todo = [(content, 0)]
    while todo:
        value, depth = todo.pop()
        if depth > MOST_DEPTH:
            raise MapFileError(
                f"header nested too deeply; accepted: at most {MOST_DEPTH} levels"
            )
        if isinstance(value, dict):
            todo += [(one, depth + 1) for pair in value.items() for one in pair]
        elif isinstance(value, list):
            todo += [(one, depth + 1) for one in value]
        elif isinstance(value, str):
            try:
                value.encode()
            except UnicodeEncodeError:
                raise MapFileError(
                    "header contains text that is not valid Unicode"
                ) from None

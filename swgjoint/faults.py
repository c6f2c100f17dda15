"""Validation of input files: all faults at once, one line each with path and value.

It applies to all TOML files of the package, such as designs, scenes and sweeps.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from swgjoint.errors import InputError

CONTROL_CHARACTERS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""Control characters that can disturb a terminal, which tab and newline do not."""

# units by the last part of a key, as written in messages; a unit precedes its own end
_UNITS = {
    "rad_s_Nm": "rad/(s·N·m)",
    "rad_Nm": "rad/(N·m)",
    "uV_V_Nm": "µV/(V·N·m)",
    "per_mm": "1/mm",
    "kg_m3": "kg/m³",
    "kgm2": "kg·m²",
    "mm2_s": "mm²/s",
    "Nms_rad": "N·m·s/rad",
    "Nm_rad": "N·m/rad",
    "Nm_arcmin": "N·m/arcmin",
    "N_mm": "N/mm",
    "Nm_A": "N·m/A",
    "deg_s": "deg/s",
    "deg_s2": "deg/s²",
    "rad_s": "rad/s",
    "mm": "mm",
    "um": "µm",
    "m": "m",
    "deg": "deg",
    "rad": "rad",
    "arcmin": "arcmin",
    "arcsec": "arcsec",
    "GB": "GB",
    "GPa": "GPa",
    "MPa": "MPa",
    "Nm": "N·m",
    "N": "N",
    "A": "A",
    "kg": "kg",
    "rpm": "rpm",
    "Hz": "Hz",
    "h": "h",
    "s": "s",
    "percent": "%",
    "mNm": "mN·m",
    "C": "°C",
}
_BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_BOUND_ERRORS = {
    "greater_than",
    "greater_than_equal",
    "less_than",
    "less_than_equal",
}
_SIZES = {
    "too_short": ("at least", "min_length"),
    "string_too_short": ("at least", "min_length"),
    "string_too_long": ("at most", "max_length"),
}
_TYPES = {
    "float_type": "a number",
    "int_type": "an integer",
    "int_from_float": "an integer",
    "string_type": "a quoted string",
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "tuple_type": "a list",
    "list_type": "a list",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
}


Model = TypeVar("Model", bound=BaseModel)


class Section(BaseModel):
    """One table of an input file: strict, frozen, no unknown keys."""

    model_config = ConfigDict(
        strict=True, extra="forbid", frozen=True, allow_inf_nan=False
    )


class Fault(ValueError):
    """Faults that concern several keys of a table.

    Args:
        lines: Pairs of key path below the table and message.
    """

    def __init__(self, *lines: tuple[str, str]) -> None:
        super().__init__("; ".join(f"{path}: {text}" for path, text in lines))
        self.lines = lines


def split_unit(key: str) -> tuple[str, str]:
    """Split a key into its name and the unit that its last part states.

    >>> split_unit("face_width_mm"), split_unit("compliance_rad_Nm")
    (('face_width', 'mm'), ('compliance', 'rad/(N·m)'))
    """
    for suffix, unit in _UNITS.items():
        if key == suffix or key.endswith("_" + suffix):
            return key.removesuffix(suffix).removesuffix("_"), unit
    return key, ""


def unit_of(key: str) -> str:
    """Unit that the last part of a key states, or the empty string.

    >>> unit_of("flexspline.rim_mm"), unit_of("torque_Nm")
    ('mm', 'N·m')
    """
    return split_unit(key)[1]


def shorten(text: str, most: int = 60) -> str:
    """Shorten text from a file for a message and replace control characters.

    Args:
        text: The text.
        most: Largest length of the result [characters].

    >>> shorten("a" * 100, 20)
    'aaaaaaaaaaaaaaaaa...'
    """
    text = CONTROL_CHARACTERS.sub("?", text)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def validate(
    model: type[Model],
    data: Mapping[str, Any],
    *,
    where: str,
    error: type[InputError] = InputError,
) -> Model:
    """Build a model from plain data and report all faults at once.

    Args:
        model: Class of the model, which describes one table.
        data: Keys and values as read from the file.
        where: Name of the file, for messages.
        error: Exception class to raise.

    Raises:
        InputError: If the data are invalid. The message has one line per fault, with
            file, key path, value with unit, and what is accepted.
    """
    try:
        return model.model_validate(dict(data))
    except ValidationError as exc:
        lines: list[str] = []
        details = exc.errors(include_url=False)
        for detail in details:
            if not _follows(detail, details):
                lines += [f"{where}: {line}" for line in _lines(model, detail)]
        raise error("\n".join(dict.fromkeys(lines))) from None


def _follows(detail: ErrorDetails, others: list[ErrorDetails]) -> bool:
    """Whether a list is too short only because its items are faulty."""
    loc = detail["loc"]
    return detail["type"] == "too_short" and any(
        len(other["loc"]) > len(loc) and other["loc"][: len(loc)] == loc
        for other in others
    )


def _lines(model: type[BaseModel], detail: ErrorDetails) -> list[str]:
    """Message lines for one pydantic error, without the file name."""
    path, owner, info = _walk(model, detail["loc"])
    key = path.rpartition(".")[2].partition("[")[0]
    kind, ctx = detail["type"], detail.get("ctx", {})
    value = detail["input"]
    if kind == "value_error":
        fault = ctx.get("error")
        if isinstance(fault, Fault):
            prefix = f"{path}." if path else ""
            return [f"{prefix}{below}: {text}" for below, text in fault.lines]
        return [f"{path}: {fault}"]
    if kind == "extra_forbidden":
        accepted = sorted(owner.model_fields) if owner else []
        near = get_close_matches(key, accepted, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]}? " if near else ""
        return [f"{path}: unknown key; {hint}accepted here: {', '.join(accepted)}"]
    if kind == "missing":
        return [f"{path}: missing; accepted: {_accepted(info, key, path)}"]
    if kind == "union_tag_not_found":
        tags = ", ".join(repr(_tag(m)) for m in models_in(info.annotation))
        return [f"{path}.kind: missing; accepted: {tags}"]
    if kind == "union_tag_invalid":
        tags = ctx["expected_tags"]
        near = get_close_matches(str(ctx["tag"]), re.findall(r"\w+", tags), n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        return [f"{path}.kind = {_shown(ctx['tag'], '')}: {hint}accepted: {tags}"]
    if kind == "literal_error":
        return [f"{path} = {_shown(value, '')}: accepted: {ctx['expected']}"]
    if kind in _BOUND_ERRORS:
        return [f"{path} = {_shown(value, key)}: accepted: {_accepted(info, key)}"]
    if kind == "too_long":
        return [f"{path} = {_shown(value, '')}: accepted: {_accepted(info, key)}"]
    if kind in _TYPES:
        example = _example(info, key, path, kind)
        limits = _limits(info, key) if info is not None else ""
        bounds = f"{', each' if example else ''} {limits}" if limits else ""
        text = f"accepted: {_TYPES[kind]}{example}{bounds}"
        return [f"{path} = {_shown(value, '')}: {text}"]
    if kind in _SIZES:
        count, unit = (
            ctx[_SIZES[kind][1]],
            "item" if kind == "too_short" else "character",
        )
        plural = "" if count == 1 else "s"
        text = f"{_SIZES[kind][0]} {count} {unit}{plural}"
        return [f"{path} = {_shown(value, '')}: accepted: {text}"]
    if kind == "string_pattern_mismatch":
        return [f"{path} = {_shown(value, '')}: accepted: text like {ctx['pattern']}"]
    return [f"{path} = {_shown(value, key)}: {detail['msg']}"]


def _walk(
    model: type[BaseModel], loc: tuple[int | str, ...]
) -> tuple[str, type[BaseModel] | None, Any]:
    """Dotted key path, owning model and field of a location in the input.

    pydantic includes the tag of a discriminated union in the location. The tag is not
    part of the path in the file and is omitted.
    """
    path, owner, info = "", model, None
    here: type[BaseModel] | None = model
    options: dict[str, type[BaseModel]] = {}
    named = False  # whether the next part is a name from the file and not a field
    for part in loc:
        if options and part in options:
            here, options = options[str(part)], {}
            continue
        if isinstance(part, int):
            path += f"[{part}]"
            continue
        name = shorten(str(part))
        path += f".{name}" if path else name
        if named or here is None:
            named = False
            continue
        owner, info = here, here.model_fields.get(part)
        models = models_in(info.annotation) if info is not None else []
        # discriminated by kind, in the field itself or in the items of a list
        union = len(models) > 1 and all("kind" in m.model_fields for m in models)
        options = {_tag(m): m for m in models} if union else {}
        here = models[0] if len(models) == 1 and not union else None
        named = info is not None and get_origin(info.annotation) is dict
    if here is not None and loc:
        owner = owner if info is not None and here is not model else here
    return path, owner, info


def _tag(model: type[BaseModel]) -> str:
    """Value of the key ``kind`` that selects a model."""
    return str(model.model_fields["kind"].default)


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Models in a type annotation, including those inside unions and Annotated."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    found: list[type[BaseModel]] = []
    for argument in getattr(annotation, "__args__", ()):
        found += models_in(argument)
    return found


def _limits(info: Any, key: str) -> str:
    """Bounds of a field with their unit, e.g. ``> 0 mm and <= 20 mm``."""
    unit = unit_of(key)
    metadata = list(info.metadata)
    for inner in getattr(info.annotation, "__args__", ()):  # items of a list, X | None
        metadata += getattr(inner, "__metadata__", ())
    fields = [getattr(item, "metadata", [item]) for item in metadata]
    parts = [
        f"{sign} {getattr(item, name):g}{' ' + unit if unit else ''}"
        for item in itertools.chain(*fields)
        for name, sign in _BOUNDS.items()
        if getattr(item, name, None) is not None
    ]
    return " and ".join(parts)


def _example(info: Any, key: str, path: str, kind: str) -> str:
    """Example of a list or a table, e.g. ``, e.g. [0, 0, 60]``, or an empty string."""
    annotation = getattr(info, "annotation", None)
    if annotation is None:
        return ""
    for part in (annotation, *get_args(annotation)):  # X | None
        origin, items = get_origin(part), get_args(part)
        if kind in ("tuple_type", "list_type") and origin in (tuple, list):
            if models_in(part):
                return f", one [[{path}]] table for each item"
            several = origin is list or Ellipsis in items
            texts = any(item is str for item in items)
            one = '"a"' if texts else "1.5"
            count = 2 if several else len(items)
            return f", e.g. {key} = [{', '.join([one] * count)}]"
        if kind == "dict_type" and origin is dict:
            value = "{...}" if models_in(part) else "1.5"
            return f" with one value for each name, e.g. {path}.NAME = {value}"
    if kind == "dict_type" or not models_in(annotation):
        return ""
    keys = list(dict.fromkeys(k for m in models_in(annotation) for k in m.model_fields))
    return f" [{path}] with {', '.join(keys)}"


def _accepted(info: Any, key: str, path: str = "") -> str:
    limits = _limits(info, key) if info is not None else ""
    if limits:
        return limits
    annotation = getattr(info, "annotation", None)
    if models_in(annotation):
        several = get_origin(annotation) in (tuple, list)
        return (
            f"a list, one [[{path or key}]] table for each item"
            if several
            else "a table"
        )
    items = get_args(annotation)
    if get_origin(annotation) is tuple and Ellipsis not in items:
        return f"a list of {len(items)} numbers"
    unit = unit_of(key)
    names: dict[Any, str] = {
        float: "a number",
        int: "an integer",
        str: "a quoted string",
    }
    name = names.get(annotation, "a value")
    return f"{name} in {unit}" if unit else name


def _shown(value: Any, key: str) -> str:
    """Value as written in the file, shortened, with its unit."""
    text = (
        {True: "true", False: "false"}[value]
        if value is True or value is False
        else (f"{value:g}" if isinstance(value, float) else repr(value))
    )
    unit = unit_of(key)
    return f"{shorten(text)} {unit}" if unit else shorten(text)

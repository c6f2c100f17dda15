"""JSON Schema of every input file, with unit, range, default and meaning of each key.

Range and default come from the models that check the files, the meaning from the
docstring below a field, the unit from the ending of the key.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from swgjoint.faults import unit_of
from swgjoint.sim.figures import keys

DIALECT = "https://json-schema.org/draft/2020-12/schema"
"""Version of JSON Schema."""
KINDS = ("design", "scene", "sweep", "optimise", "spec", "lot", "accept")
"""Kinds of input files."""
_ROLE = re.compile(r":[a-z]+:`~?([^`]+)`")
"""Cross-reference of a docstring."""
_TYPES = {
    "object": "table",
    "array": "list",
    "string": "text",
    "boolean": "true or false",
}
_PLURALS = {
    "integer": "integers",
    "number": "numbers",
    "string": "texts",
    "array": "lists",
}
"""Types of the values of lists and tables."""
_SIGNS = {
    "exclusiveMinimum": ">",
    "minimum": ">=",
    "exclusiveMaximum": "<",
    "maximum": "<=",
}


def file_schema(kind: str) -> dict[str, Any]:
    """JSON Schema of one kind of file.

    Args:
        kind: One of :data:`KINDS`. ``optimise`` is the file of a search; ``spec``,
            ``lot`` and ``accept`` are the files with the limits of ``swgjoint
            compare``, ``lot`` and ``accept``.
    """
    if kind in ("spec", "lot", "accept"):
        return _limits(kind)
    model = _model(kind)
    schema = model.model_json_schema(schema_generator=_WithMeaning)
    return {"$schema": DIALECT, **schema}


def schema_text(kind: str) -> str:
    """JSON Schema of one kind of file as the text of a file.

    Args:
        kind: One of :data:`KINDS`.
    """
    return json.dumps(file_schema(kind), indent=1, ensure_ascii=False) + "\n"


def _model(kind: str) -> type[BaseModel]:
    if kind == "design":
        from swgjoint.gear.design.design import Design

        return Design
    if kind == "scene":
        from swgjoint.sim.scene.scene import Scene

        return Scene
    if kind == "sweep":
        from swgjoint.explore.sweep.file import SweepFile

        return SweepFile
    from swgjoint.explore.optimise.file import OptimisationFile

    return OptimisationFile


class _WithMeaning(GenerateJsonSchema):
    """Schema whose properties carry the unit and the meaning of their key."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        found = super().model_schema(schema)
        meaning = meanings(schema["cls"])
        for key, entry in found.get("properties", {}).items():
            entry.pop("title", None)
            if unit := unit_of(key):
                entry["unit"] = unit
            if key in meaning:
                entry["description"] = meaning[key]
        if known := getattr(schema["cls"], "known", None):  # names of figures
            found["properties"]["figures"]["items"] = {"enum": list(known)}
        return found


def meanings(cls: type) -> dict[str, str]:
    """Field docstrings of a class and its base classes."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        found |= _docstrings(base.__module__).get(base.__name__, {})
    return found


@lru_cache
def _docstrings(module: str) -> dict[str, dict[str, str]]:
    """Docstrings below annotated names of a module of this package, by class."""
    if module.partition(".")[0] != "swgjoint":
        return {}
    tree = ast.parse(inspect.getsource(sys.modules[module]))
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    return {node.name: dict(_documented(node.body)) for node in classes}


def _documented(body: Sequence[ast.stmt]) -> Iterator[tuple[str, str]]:
    for field, text in pairwise(body):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
            and isinstance(text.value.value, str)
        ):
            yield field.target.id, " ".join(text.value.value.split())


def _limits(kind: str) -> dict[str, Any]:
    """Schema of a file with a table of limits."""
    from swgjoint.explore import bearing_lot, lot
    from swgjoint.explore.accept import figures as accept
    from swgjoint.explore.compare import compare

    lower: tuple[str, ...]
    names: tuple[str, ...]
    if kind == "spec":
        command, lower = "compare", keys.LOWER
        names = (*keys.UPPER, *keys.LOWER)
        meaning = meanings(compare.Compared)
    elif kind == "accept":
        command, lower, names = "accept", accept.LOWER, accept.LIMITED
        meaning = {
            key: text for of in accept.FIGURES.values() for key, text in of.items()
        }
    else:
        command, lower = "lot", lot.LOWER
        names = tuple(dict.fromkeys((*lot.FIGURES, *bearing_lot.FIGURES)))
        meaning = meanings(bearing_lot.DriveOnBearing) | meanings(lot.Drawn)
    figures = {}
    for key in names:
        bound = "Smallest" if key in lower else "Largest"
        text = f"{bound} accepted value. {meaning.get(key, '')}".strip()
        unit = {"unit": unit_of(key)} if unit_of(key) else {}
        entry = {"type": "number", "exclusiveMinimum": 0, "description": text}
        figures[key] = {**entry, **unit}
    table = {
        "type": "object",
        "description": "Limits, each of which must be met.",
        "properties": figures,
        "additionalProperties": False,
        "minProperties": 1,
    }
    return {
        "$schema": DIALECT,
        "title": "Spec",
        "description": f"Limits of swgjoint {command} --spec FILE.",
        "type": "object",
        "properties": {"spec": table},
        "required": ["spec"],
        "additionalProperties": False,
    }


def described_keys(schema: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Flatten a schema into one entry per key, tables before their keys.

    Returns:
        ``key`` (dotted; NAME stands for a name that the file chooses, [] for an item of
        a list), ``of_kind`` (value of ``kind`` in the table of the key; None if the
        table has no kinds), ``type``, ``unit``, ``range``, ``default`` (None if there
        is none), ``required``, ``removable`` (whether the file may omit the key or
        table without a default taking its place), ``meaning``, ``forms`` (schemas of
        the accepted types).
    """
    return list(_keys(schema, schema, "", None))


def _keys(
    table: Mapping[str, Any], root: Mapping[str, Any], above: str, kind: str | None
) -> Iterator[dict[str, Any]]:
    required = table.get("required", ())
    for name, entry in table.get("properties", {}).items():
        key = f"{above}{name}"
        forms = _forms(entry, root)
        values = [form for form in forms if form.get("type") != "null"]
        default = entry.get("default")
        yield {
            "key": key,
            "of_kind": kind,
            "type": " or ".join(dict.fromkeys(map(_type, values))),
            "unit": entry.get("unit", ""),
            "range": " or ".join(dict.fromkeys(filter(None, map(_range, values)))),
            "default": default if not isinstance(default, Mapping) else None,
            "required": name in required,
            "removable": len(values) < len(forms),
            "meaning": _meaning(name, entry, values, table),
            "forms": values,
        }
        for form in values:
            yield from _below(form, root, key)


def _meaning(
    name: str,
    entry: Mapping[str, Any],
    values: Sequence[Mapping[str, Any]],
    table: Mapping[str, Any],
) -> str:
    """Meaning of a key as plain text; the key ``kind`` has that of its table."""
    own = entry.get("description")
    if own is None and name == "kind":
        own = table.get("description")
    elif own is None and len(values) == 1 and not _kind_of(values[0]):
        own = values[0].get("description")
    paragraph = str(own or "").partition("\n\n")[0]
    return " ".join(_ROLE.sub(r"\1", paragraph).replace("``", "").split())


def _kind_of(form: Mapping[str, Any]) -> str | None:
    """The only accepted value of the key ``kind`` of a table; None without it."""
    kind: str | None = form.get("properties", {}).get("kind", {}).get("const")
    return kind


def _below(
    form: Mapping[str, Any], root: Mapping[str, Any], key: str
) -> Iterator[dict[str, Any]]:
    """Keys of a table, of tables with free names, and of the tables in a list."""
    if "properties" in form:
        yield from _keys(form, root, f"{key}.", _kind_of(form))
    for inner, mark in (("additionalProperties", ".NAME"), ("items", "[]")):
        if isinstance(form.get(inner), Mapping):
            for item in _forms(form[inner], root):
                yield from _below(item, root, key + mark)


def _forms(entry: Mapping[str, Any], root: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Alternatives of an entry, with references resolved."""
    if "$ref" in entry:
        name = entry["$ref"].rpartition("/")[2]
        return _forms(root["$defs"][name], root)
    for several in ("anyOf", "oneOf", "allOf"):
        if several in entry:
            return [form for item in entry[several] for form in _forms(item, root)]
    return [dict(entry)]


def _type(form: Mapping[str, Any]) -> str:
    if "const" in form:
        return repr(form["const"])
    if "enum" in form:
        return " or ".join(map(repr, form["enum"]))
    kind = str(form.get("type", "any value"))
    return _contents(form) or _TYPES.get(kind, kind)


def _contents(form: Mapping[str, Any]) -> str:
    """Type of a list or a table of plain values; the empty string for other types."""
    items = form.get("prefixItems")
    inner = items[0] if items else form.get("additionalProperties") or form.get("items")
    if isinstance(inner, Mapping) and "enum" in inner:
        return f"list of {_type(inner)}"
    if not isinstance(inner, Mapping) or inner.get("type") not in _PLURALS:
        return ""
    many = _PLURALS[inner["type"]]
    if form["type"] == "object":
        return f"table of {many}"
    return f"list of {len(items)} {many}" if items else f"list of {many}"


def _range(form: Mapping[str, Any]) -> str:
    inner = form.get("additionalProperties") or form.get("items")
    if isinstance(inner, Mapping):
        return _range(inner)
    parts = [f"{sign} {form[k]:g}" for k, sign in _SIGNS.items() if k in form]
    return ", ".join(parts)

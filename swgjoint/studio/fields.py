"""Fields of a design that the page shows, taken from the schema of design files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from swgjoint.errors import InputError
from swgjoint.explore.schema import described_keys, file_schema
from swgjoint.faults import split_unit
from swgjoint.json_text import json_text
from swgjoint.toml_file import parse_value

_PATH = re.compile(r"[A-Za-z_]\w*(?:\[\d+\])?(?:\.[A-Za-z_]\w*(?:\[\d+\])?)*")
"""Dotted path of a key at the start of a message."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """One key or table of a design file."""

    key: str
    """Dotted key."""
    table: bool
    """Whether the key is a table."""
    removable: bool
    """Whether the design may lack the table or key, with no default in its place."""
    choices: tuple[str, ...]
    """Accepted texts of a key with a choice; empty for other keys."""
    text: bool
    """Whether the value is a text."""
    unit: str
    """Unit of the value; empty if it has none."""
    range: str
    """Accepted range; empty if there is none."""
    default: str
    """Default value as text; empty if there is none."""
    meaning: str
    """What the key means."""

    @property
    def label(self) -> str:
        """Name of the key as words, without its unit."""
        return split_unit(self.key.rpartition(".")[2])[0].replace("_", " ")

    @property
    def above(self) -> str:
        """Dotted key of the table that contains the key; empty at the top level."""
        return self.key.rpartition(".")[0]

    @property
    def hint(self) -> str:
        """Meaning, unit, range and default in one line."""
        parts = [self.range and f"{self.range} {self.unit}".strip()]
        parts.append(self.default and f"default {self.default} {self.unit}".strip())
        return f"{self.meaning} ({'; '.join(filter(None, [*parts, self.key]))})"


def list_fields(data: Mapping[str, Any]) -> list[Field]:
    """Fields of the design that a file describes, in the order of the schema.

    Keys of other kinds of tooth or wave generator, and those of absent tables, are
    omitted; the absent tables themselves are listed.

    Args:
        data: Content of the design file, valid or not.
    """
    rows: dict[str, list[dict[str, Any]]] = {}
    for row in _rows():
        above = row["key"].rpartition(".")[0]
        if above and above not in rows:
            continue
        if above and rows[above][0]["removable"] and value_at(data, above) is None:
            continue
        first = row["key"].endswith(".kind") or row["of_kind"] is None
        if first or row["of_kind"] == _kind(data, above):
            rows.setdefault(row["key"], []).append(row)
    return [_field(key, found) for key, found in rows.items()]


def value_at(data: Mapping[str, Any], key: str) -> Any:
    """Value of a dotted key; None if the key or a table above it is absent.

    Args:
        data: Content of a file.
        key: Dotted key.
    """
    here: Any = data
    for part in key.split("."):
        here = here.get(part) if isinstance(here, Mapping) else None
    return here


def parse_text(field: Field, text: str) -> Any:
    """Value of the text in a field, as a file would contain it; None if it is empty.

    Args:
        field: The field.
        text: Its text.
    """
    text = text.strip()
    if field.text:
        return text or None
    try:
        return parse_value(text, where=field.key) if text else None
    except InputError:
        return text  # the check of the design rejects it beside its field


def text_of(value: Any) -> str:
    """Text of a value for its field."""
    if value is None or isinstance(value, str):
        return value or ""
    try:
        return json_text(value, indent=None)
    except TypeError:  # a date or a time, which no field accepts
        return str(value)


def key_of_message(line: str) -> str:
    """Dotted key at the start of a message; empty if there is none."""
    found = _PATH.match(line)
    return re.sub(r"\[\d+\]", "", found[0]) if found else ""


@cache
def _rows() -> tuple[dict[str, Any], ...]:
    return tuple(described_keys(file_schema("design")))


def _kind(data: Mapping[str, Any], table: str) -> str | None:
    """Kind of a table, its first kind by default."""
    kind = value_at(data, f"{table}.kind")
    known = [row["of_kind"] for row in _rows() if row["key"] == f"{table}.kind"]
    return kind if kind in known else next(iter(known), None)


def _field(key: str, rows: list[dict[str, Any]]) -> Field:
    row = rows[0]
    forms = [form for row in rows for form in row["forms"]]
    choices = [c for f in forms for c in f.get("enum", [f.get("const")]) if c]
    default = row["default"]
    return Field(
        key=key,
        table=any("properties" in form for form in forms),
        removable=row["removable"],
        choices=tuple(dict.fromkeys(choices)),
        text=any(form.get("type") == "string" for form in forms),
        unit=row["unit"],
        range=row["range"],
        default="" if default is None else text_of(default),
        meaning=row["meaning"],
    )

"""Draft of a design: content of a design file while it is edited, valid or not."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from swgjoint.errors import DesignError
from swgjoint.faults import split_unit
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks
from swgjoint.models_path import bundled_names
from swgjoint.studio.fields import key_of_message, list_fields, value_at
from swgjoint.toml_file import parse_toml, read_toml

Draft = dict[str, Any]
"""Content of a design file."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Result of checking a draft."""

    design: Design | None
    """The design; None if the draft is not valid or cannot be built."""
    faults: tuple[str, ...]
    """Messages of the command line, without the name of the file."""

    def faults_by_key(self, draft: Draft) -> dict[str, str]:
        """Messages by the key of the field that they belong to.

        A message about a table or a key that is not shown belongs to no field.
        """
        shown = {field.key for field in list_fields(draft)}
        found: dict[str, str] = {}
        for line in dict.fromkeys(self.faults):
            key = key_of_message(line)
            if key in shown:
                found[key] = f"{found[key]}; {line}" if key in found else line
        return found


def open_bundled(name: str) -> Draft:
    """Draft of a bundled design or of ``size-NN-RRR``.

    Raises:
        DesignError: If there is no such design.
    """
    return Design.preset(name).model_dump(exclude_unset=True)


def open_file(content: bytes, folder: Path) -> Draft:
    """Draft of a design file that the user opens; its values may be invalid.

    Args:
        content: Content of the file.
        folder: Folder for the file while it is read.

    Raises:
        DesignError: If the content is not the TOML of a design.
    """
    path = folder / "design.toml"
    path.write_bytes(content)
    try:
        return read_toml(path, what="design", error=DesignError)
    except DesignError as error:
        raise DesignError(str(error).replace(f"{folder}/", "")) from None


def judge(draft: Draft) -> Verdict:
    """Check a draft as the command line checks a design file."""
    from swgjoint.faults import validate

    where = "design"
    try:
        design = validate(Design, draft, where=where, error=DesignError)
    except DesignError as error:
        return Verdict(design=None, faults=_lines(error, where))
    # the parser of TOML sees every text of a file before the models do
    try:
        parse_toml(design.to_toml(), where=where, error=DesignError)
    except DesignError as error:
        return Verdict(design=None, faults=_lines(error, where))
    faults = [
        line
        for check in design_checks(design)
        if not check.ok
        for line in _lines(check.fault, design.drive.name)
    ]
    return Verdict(design=None if faults else design, faults=tuple(faults))


def with_value(draft: Draft, key: str, value: Any) -> Draft:
    """Copy of a draft with another value; None removes the key.

    A new kind of a table keeps the values that it has in common with the old one, if
    they give a valid design. Otherwise it begins, like a new table, with the values of
    a bundled design, with lengths scaled by the module, or with its defaults.

    Args:
        draft: The draft.
        key: Dotted key.
        value: New value; a table is added with an empty mapping.
    """
    changed = deepcopy(draft)
    *tables, last = key.split(".")
    table: Any = changed
    for name in tables:
        if not isinstance(table.get(name), dict):
            table[name] = {}  # a file may have a number in the place of the table
        table = table[name]
    if value is None:
        table.pop(last, None)
        return changed
    table[last] = value
    if isinstance(value, Mapping):
        return _begin(changed, key)
    return _begin(changed, ".".join(tables)) if last == "kind" else changed


def differences(
    one: Draft, other: Draft, above: str = ""
) -> list[tuple[str, Any, Any]]:
    """Keys with different values in two drafts, with both values, None if absent.

    Args:
        one: A draft or one of its tables.
        other: The same of another draft.
        above: Start of the keys, which ends with a dot unless it is empty.
    """
    found: list[tuple[str, Any, Any]] = []
    for name in dict.fromkeys((*one, *other)):
        a, b, key = one.get(name), other.get(name), f"{above}{name}"
        if isinstance(a, dict) or isinstance(b, dict):
            parts = [part if isinstance(part, dict) else {} for part in (a, b)]
            found += differences(parts[0], parts[1], f"{key}.")
        elif a != b:
            found.append((key, a, b))
    return found


def _begin(draft: Draft, above: str) -> Draft:
    """The draft with the first values for a table that give a valid design.

    If none do, those of the first bundled design with the same kind are taken.

    Args:
        draft: The draft, with the kind of the table, if it has kinds.
        above: Dotted key of the table.
    """
    table = value_at(draft, above)
    names = {
        f.key.rpartition(".")[2]: f for f in list_fields(draft) if f.above == above
    }
    usual = names["kind"].default if "kind" in names else None
    kind = table.get("kind", usual)
    fixed = {k: v for k, v in table.items() if k == "kind" or isinstance(v, Mapping)}
    examples = [
        _scaled(above, other, _module(draft) / _module(example))
        for example in _examples()
        if (other := value_at(example, above)) is not None
        and other.get("kind", usual) == kind
    ]
    tries = [
        _replaced(draft, above, {k: v for k, v in values.items() if k in names})
        for values in (table, *({**e, **fixed} for e in examples), fixed)
    ]
    valid = (one for one in tries if judge(one).design is not None)
    return next(valid, tries[1])


def _replaced(draft: Draft, above: str, table: Draft) -> Draft:
    """Copy of a draft with another table."""
    changed = deepcopy(draft)
    *tables, last = above.split(".")
    (value_at(changed, ".".join(tables)) if tables else changed)[last] = table
    return changed


def _scaled(name: str, value: Any, scale: float) -> Any:
    """Value of another design; lengths are multiplied by a factor."""
    if isinstance(value, Mapping):
        return {key: _scaled(key, one, scale) for key, one in value.items()}
    unit = split_unit(name)[1]
    if isinstance(value, float) and unit in ("mm", "1/mm"):
        return float(f"{value * (scale if unit == 'mm' else 1.0 / scale):.4g}")
    return value


@cache
def _examples() -> tuple[Draft, ...]:
    return tuple(open_bundled(name) for name in bundled_names("drives", ".toml"))


def _module(draft: Draft) -> float:
    value = value_at(draft, "drive.module_mm")
    return float(value) if isinstance(value, int | float) and value > 0 else 1.0


def _lines(error: DesignError | str, where: str) -> tuple[str, ...]:
    return tuple(line.removeprefix(f"{where}: ") for line in str(error).splitlines())

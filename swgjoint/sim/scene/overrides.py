"""Changes of a scene by dotted keys, as on the command line."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from swgjoint.drives.sections import DRIVE_KEYS
from swgjoint.errors import InputError
from swgjoint.faults import shorten
from swgjoint.sim.scene.trajectory_sections import MOTIONS
from swgjoint.toml_file import MAX_DEPTH, parse_value

ALTERNATIVES = (tuple(DRIVE_KEYS), ("torque_Nm", "rated_fraction"))
"""Keys of a table that exclude each other: drives of a joint, and sizes of a load."""


def merge(
    data: Mapping[str, Any],
    overrides: Mapping[str, Any] | Iterable[str] | None,
    where: str,
) -> dict[str, Any]:
    """Deep copy of the tables of a scene with some keys changed.

    Args:
        data: Tables of a scene file.
        overrides: Dotted keys with new values, as a mapping or as ``key=value`` strings
            whose value is parsed as TOML.
        where: Name of the scene in messages.

    Raises:
        InputError: If a key or a value cannot be read, or a key lies below a value.
    """

    def copied(value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: copied(item) for key, item in value.items()}
        return value

    merged: dict[str, Any] = copied(data)
    pairs = (
        list(overrides.items())
        if isinstance(overrides, Mapping)
        else [parse_override(text) for text in overrides or ()]
    )
    given = {key for key, _ in pairs}
    # apply a new kind of motion first, because it drops the keys of the old kind
    for key, value in sorted(pairs, key=lambda pair: pair[0] != "trajectory.kind"):
        if key == "trajectory.kind":
            _switch_motion(merged.get("trajectory"), value)
        *tables, last = key.split(".")
        table = merged
        for name in tables:
            _make_room(table, name, ())
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise InputError(f"{where}: {key}: {name} is not a table")
        beside = {k.split(".")[-1] for k in given if k.split(".")[:-1] == tables}
        _make_room(table, last, beside)
        table[last] = value
    return merged


def _switch_motion(table: Any, kind: Any) -> None:
    """Drop the keys of a motion that a new kind of motion does not have."""
    if not isinstance(table, dict) or table.get("kind") == kind:
        return
    model = MOTIONS.get(kind) if isinstance(kind, str) else None
    if model is not None:
        for key in set(table) - set(model.model_fields):
            del table[key]


def _make_room(table: dict[str, Any], key: str, given: Collection[str]) -> None:
    """Drop the alternatives to a key, unless they are given, too, which is an error."""
    for keys in ALTERNATIVES:
        for other in keys if key in keys else ():
            if other != key and other not in given:
                table.pop(other, None)


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``key=value`` of the command line into a dotted key and a TOML value."""
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not all(key.split(".")):
        raise InputError(
            f"{shorten(text)!r}: accepted: key=value, for example"
            " simulation.step_s=0.0005"
        )
    if key.count(".") >= MAX_DEPTH:
        raise InputError(
            f"key {shorten(key)}: accepted: a dotted key of at most {MAX_DEPTH} parts"
        )
    return key, parse_value(value, where=key)  # a bare word is a name or a path

"""Equilibria as named arrays, for files from which a run resumes bit-identically."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from swgjoint.errors import Outcome
from swgjoint.fe.common.following import Unloaded
from swgjoint.fe.common.friction import SlipHistory
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.state import State
from swgjoint.fe.solid.state import SolidState
from swgjoint.fe.solid.teeth import ToothRows

_KINDS: dict[str, type[Any]] = {
    kind.__name__: kind
    for kind in (State, SolidState, Contacts, ToothRows, SlipHistory, Unloaded)
}
_KIND = "kind"
_NUMBERS = {"float": float, "int": int}

T = TypeVar("T")


def pack(value: Any, name: str) -> dict[str, Any]:
    """Named arrays that represent a state or a part of it, including type names.

    Args:
        value: A state, an array, a number, an outcome, a tuple of these, or None.
        name: Prefix of all array names.

    Returns:
        Arrays by name.
    """
    if value is None:
        return {}
    if isinstance(value, Outcome):
        return {name: value.name}
    if isinstance(value, tuple) and any(is_dataclass(one) for one in value):
        arrays: dict[str, Any] = {f"{name}.{_KIND}": f"tuple {len(value)}"}
        for k, one in enumerate(value):
            arrays |= pack(one, f"{name}.{k}")
        return arrays
    if is_dataclass(value):
        arrays = {f"{name}.{_KIND}": type(value).__name__}
        for item in fields(value):
            arrays |= pack(getattr(value, item.name), f"{name}.{item.name}")
        return arrays
    return {name: value}


def unpack(arrays: Mapping[str, Any], name: str) -> Any:
    """Value from the named arrays that :func:`pack` returned.

    Args:
        arrays: Arrays by name.
        name: Prefix of their names.

    Returns:
        The value; None if there is no array of that name.

    Raises:
        KeyError: If the name of a type or of an outcome is unknown.
        TypeError: If an entry of a state is missing or has the wrong type.
        ValueError: If an entry of a state has an invalid value.
    """
    kind = arrays.get(f"{name}.{_KIND}")
    if kind is None:
        return arrays.get(name)
    if str(kind).startswith("tuple "):
        count = int(str(kind).removeprefix("tuple "))
        return tuple(unpack(arrays, f"{name}.{k}") for k in range(count))
    cls = _KINDS[str(kind)]
    values = {}
    for item in fields(cls):
        value = unpack(arrays, f"{name}.{item.name}")
        if value is None:
            continue
        if item.type in _NUMBERS:
            value = _NUMBERS[str(item.type)](value)
        elif item.type == "Outcome":
            value = Outcome[str(value)]
        elif item.type == "tuple[float, ...]":
            value = tuple(float(one) for one in value)
        values[item.name] = value
    return cls(**values)


def copy_contiguous(value: T) -> T:
    """Value whose arrays have the memory layout of arrays that were read from a file.

    The last digit of a sum may depend on the memory layout, and the results of a
    resumed run must not differ from those of an uninterrupted run.
    """
    changed: Any = value
    if isinstance(value, np.ndarray):
        changed = np.ascontiguousarray(value) if value.ndim else value
    elif isinstance(value, tuple):
        changed = tuple(copy_contiguous(one) for one in value)
    elif is_dataclass(value) and not isinstance(value, type):
        parts: Iterable[str] = (item.name for item in fields(value))
        changed = replace(
            value, **{key: copy_contiguous(getattr(value, key)) for key in parts}
        )
    return changed  # type: ignore[no-any-return]

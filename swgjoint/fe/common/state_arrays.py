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
from swgjoint.fe.solid.tooth_rows import ToothRows

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


def pack_solve(result: Any, *, theta: float, torque: float) -> dict[str, Any]:
    """Named arrays of a solve at an input angle [rad] under a torque [N·m].

    Args:
        result: A state, an :class:`Unloaded` drive without torque, or None if the solve
            failed.
        theta: Input angle [rad].
        torque: Output torque [N·m].
    """
    return {"theta": theta, "torque": torque, **pack(result, "state")}


def unpack_solve(
    arrays: Mapping[str, Any], *, theta: float, torque: float, like: Any
) -> tuple[Any]:
    """Result of a solve from its arrays, as a tuple because None marks a failed solve.

    Args:
        arrays: Arrays that :func:`pack_solve` returned.
        theta: Input angle of the solve [rad].
        torque: Output torque of the solve [N·m].
        like: State of the same model; None accepts any model.

    Raises:
        ValueError: If the result does not belong to this angle, torque and model.
    """
    if (float(arrays["theta"]), float(arrays["torque"])) != (theta, torque):
        raise ValueError("stored equilibrium has another angle or torque")
    stored: Any = unpack(arrays, "state")
    if isinstance(stored, Unloaded) != (torque == 0.0):
        raise ValueError("stored equilibrium has the wrong type for its torque")
    states = [stored] if torque else [stored.state, *(stored.sides or ())]
    for state in states:
        if state is not None:
            _check_like(state, like)
    return (stored,)


def _check_like(state: Any, like: Any) -> None:
    """Reject a stored state that is not an equilibrium of the same model."""
    if like is not None and (
        type(state) is not type(like) or state.faces.shape != like.faces.shape
    ):
        raise ValueError("stored state belongs to another model")
    if not np.isfinite(state.faces).all():
        raise ValueError("stored state contains values that are not finite")


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

"""Dotted keys of designs and scenes that a sweep may vary."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from swgjoint.faults import models_in
from swgjoint.gear.design.design import Design
from swgjoint.sim.scene.scene import Scene

ANY = "*"
"""Placeholder for a name that the file chooses, such as the name of a joint."""
BASE = "design"
"""Key of the base design itself."""
_PATHS = (BASE, "arm", "trajectory.file", "defaults.drive", f"joints.{ANY}.drive")


def keys_of(model: type[BaseModel], above: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Dotted keys of a model and of its nested tables, with their fields.

    Args:
        model: Model of a design, of a scene or of one of their tables.
        above: Prefix of the keys, ending with a dot; empty at the top level.
    """
    for name, field in model.model_fields.items():
        key = f"{above}{name}"
        yield key, field
        shape = next(
            (
                get_origin(part)
                for part in (field.annotation, *get_args(field.annotation))
                if get_origin(part) in (dict, list, tuple)
            ),
            None,
        )
        if shape in (list, tuple):
            continue  # a list can only be changed as a whole
        if shape is dict:
            key = f"{key}.{ANY}"
            yield key, field
        for inner in models_in(field.annotation):
            yield from keys_of(inner, f"{key}.")


@lru_cache
def known_keys(kind: str) -> dict[str, bool]:
    """Every key of a ``design`` or ``scene``, and whether it takes integers."""
    model: type[BaseModel] = Design if kind == "design" else Scene
    found: dict[str, bool] = {}
    for key, field in keys_of(model):
        whole = int in (field.annotation, *get_args(field.annotation))
        # kinds of profiles or wave generators may share a key, which takes integers
        # only if it does so in all of them
        found[key] = found.get(key, True) and whole
    return found


def find_key(key: str, kind: str) -> bool | None:
    """Whether a key takes integers; None if no design or scene has the key.

    Args:
        key: Dotted key.
        kind: ``design`` or ``scene``.
    """
    known = known_keys(kind)
    if key in known:
        return known[key]
    parts = key.split(".")
    return next(
        (
            whole
            for pattern, whole in known.items()
            if ANY in pattern and _matches(pattern.split("."), parts)
        ),
        None,
    )


def _matches(pattern: list[str], parts: list[str]) -> bool:
    return len(pattern) == len(parts) and all(
        p in (ANY, part) for p, part in zip(pattern, parts, strict=True)
    )


def is_path(key: str) -> bool:
    """Whether the value of a key may be the path of a file."""
    return any(_matches(path.split("."), key.split(".")) for path in _PATHS)


def kind_of(key: str, kinds: tuple[str, ...]) -> str | None:
    """Kind that a key belongs to, ``design`` or ``scene``; None for neither.

    Args:
        key: Dotted key, or ``design`` for the base design itself.
        kinds: Kinds that the file has a base for.
    """
    if key == BASE and BASE in kinds:
        return BASE
    return next((kind for kind in kinds if find_key(key, kind) is not None), None)


def unknown(key: Any, kinds: tuple[str, ...]) -> str:
    """Message for an unknown key; it suggests the most similar known keys.

    Args:
        key: Unknown key.
        kinds: Kinds that the file has a base for.
    """
    every = [k for kind in kinds for k in known_keys(kind)]
    last = str(key).rpartition(".")[2]
    near = get_close_matches(str(key), every, n=3, cutoff=0.75)
    ends = [k for k in every if k.rpartition(".")[2] == last]
    near += [k for k in ends if k not in near]
    if not near:
        lasts = {k.rpartition(".")[2] for k in every}
        close = get_close_matches(last, lasts, n=1)
        near = [k for k in every if close and k.rpartition(".")[2] == close[0]]
    hint = f"did you mean {' or '.join(near[:3])}?" if near else "see a bundled file"
    return f"{key!r}: unknown key of a {' or '.join(kinds)}; {hint}"

"""Select hinges of a model by names and patterns."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import Any, TypeVar

import mujoco

from swgjoint.errors import InputError
from swgjoint.joint.callers import depth_of_caller
from swgjoint.joint.obstacles import Surroundings

V = TypeVar("V")


def chosen_hinges(spec: mujoco.MjSpec, keys: Iterable[str]) -> dict[str, str]:
    """First matching key of every hinge that takes a drive.

    A key is the name of a joint or a pattern with ``*``, ``?`` and ``[...]`` as in file
    names. A pattern selects hinges; matching hinges that cannot take a drive are
    omitted, with one warning that lists them. Rotors of drives are never selected.

    Args:
        spec: Model; unchanged.
        keys: Names and patterns; earlier keys have priority.

    Returns:
        Key by joint, in the order of the model.

    Raises:
        InputError: If a named joint cannot take a drive, if a pattern matches no hinge
            that can, or if earlier keys already select all joints of a key; with one
            line for each problem.
    """
    around = Surroundings(spec)
    keys = list(keys)
    for key in keys:
        if not isinstance(key, str):
            raise InputError(f"joint {key!r}; accepted: a joint name or a pattern")
    patterns = [key for key in keys if _is_pattern(key, around)]
    place = {key: k for k, key in enumerate(keys)}
    hinges = [
        joint
        for joint in spec.joints
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE and not around.is_rotor(joint.name)
    ]
    chosen: dict[str, str] = {}
    meant: dict[str, list[str]] = {key: [] for key in keys}
    left_out: dict[str, list[str]] = {key: [] for key in keys}
    wrong = []
    for joint in hinges:
        found = [key for key in patterns if fnmatchcase(joint.name, key)]
        if joint.name in place:
            found.append(joint.name)
        for key in found:
            meant[key].append(joint.name)
        if not found:
            continue
        first = min(found, key=place.__getitem__)
        why = _obstacle(joint, around)
        if not why:
            chosen[joint.name] = first
        elif first != joint.name:
            left_out[first].append(why)
        else:
            wrong.append(why)
    taken = set(chosen.values())
    for key in keys:
        if key not in patterns and not meant[key]:
            wrong.append(_no_hinge(key, around))
        elif not meant[key]:
            known = around.nearest_names(
                key, [joint.name for joint in hinges if joint.name]
            )
            wrong.append(f"pattern {key!r} matches no hinge; {known}")
        elif key not in taken and left_out[key]:
            reasons = "; ".join(left_out[key])
            wrong.append(f"pattern {key!r}: no hinge can take a drive: {reasons}")
        elif before := {chosen.get(name, key) for name in meant[key]} - {key}:
            if key not in taken:
                others = ", ".join(sorted(map(repr, before)))
                wrong.append(
                    f"{key!r} selects no joint, because {others} comes earlier and"
                    " matches the same joints; put the more specific key first"
                )
    if wrong:
        raise InputError("\n".join(wrong))
    skipped = [why for key in keys for why in left_out[key]]
    if skipped:
        warnings.warn(
            f"{len(skipped)} hinges get no drive: {'; '.join(skipped)}",
            stacklevel=depth_of_caller(),
        )
    return chosen


def with_whole_names(spec: mujoco.MjSpec, values: Mapping[str, V]) -> dict[str, V]:
    """Values by joint name or pattern, with the suffix ``_joint`` where it is omitted.

    Args:
        spec: Model; unchanged.
        values: Values by name or pattern. The suffix is added to a name that no joint
            has if a joint has the name with the suffix.

    Raises:
        InputError: If a joint is stated with and without the suffix.
    """
    named: dict[str, V] = {}
    for key, value in values.items():
        whole = f"{key}_joint"
        omitted = spec.joint(str(key)) is None and spec.joint(whole) is not None
        name = whole if omitted else key
        if name in named:
            raise InputError(
                f"{key!r}: joint {name!r} has a drive already; accepted: one drive"
            )
        named[name] = value
    return named


def _is_pattern(key: str, around: Surroundings) -> bool:
    return key not in around.joints and any(sign in key for sign in "*?[")


def _no_hinge(name: str, around: Surroundings) -> str:
    """Reason why a name selects no hinge."""
    try:
        around.driven_joint(name)
    except InputError as error:
        return str(error)
    raise AssertionError(name)


def _obstacle(joint: Any, around: Surroundings) -> str:
    """Reason why a hinge cannot take a drive; empty if it can take one."""
    if not joint.name:
        return f"a hinge of body {joint.parent.name!r} has no name"
    try:
        around.driven_joint(joint.name)
    except InputError as error:
        return str(error)
    return ""

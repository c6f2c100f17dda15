"""Which hinges of a model a table of names and patterns means."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from fnmatch import fnmatchcase
from typing import Any

import mujoco

from swgjoint.errors import InputError
from swgjoint.joint.callers import depth_of_caller
from swgjoint.joint.obstacles import Surroundings


def chosen_hinges(spec: mujoco.MjSpec, keys: Iterable[str]) -> dict[str, str]:
    """The key of every hinge that takes a drive: the first that matches it.

    A key is the name of a joint or a pattern with ``*``, ``?`` and ``[...]`` as in file
    names. A pattern means hinges; those that cannot take a drive are left out with one
    warning that lists them. Rotors of drives are never meant.

    Args:
        spec: Model.
        keys: Names and patterns, in order.

    Returns:
        Key by joint, in the order of the model.

    Raises:
        InputError: For a name that cannot take a drive, a pattern that matches no hinge
            that can, and a key whose joints are all taken by keys before it; a line for
            each.
    """
    around = Surroundings(spec)
    keys = list(keys)
    hinges = [
        joint
        for joint in spec.joints
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE and not around.is_rotor(joint.name)
    ]
    chosen: dict[str, str] = {}
    left_out: dict[str, list[str]] = {key: [] for key in keys}
    wrong = []
    for key in keys:
        if not isinstance(key, str):
            raise InputError(f"joint {key!r}; accepted: a name or a pattern")
        if not _is_pattern(key, around):
            try:
                around.driven_joint(key)
            except InputError as error:
                wrong.append(str(error))
    for joint in hinges:
        first = next((key for key in keys if _means(key, joint.name, around)), None)
        if first is None:
            continue
        why = _obstacle(joint, around) if _is_pattern(first, around) else ""
        if why:
            left_out[first].append(why)
        else:
            chosen[joint.name] = first
    for key in keys:
        if not _is_pattern(key, around) and key not in around.joints:
            continue  # said above
        matched = [j.name for j in hinges if _means(key, j.name, around)]
        if _is_pattern(key, around) and not matched:
            known = around.known(key, [joint.name for joint in hinges if joint.name])
            wrong.append(f"pattern {key!r} matches no hinge; {known}")
        elif left_out[key] and key not in chosen.values():
            reasons = "; ".join(left_out[key])
            wrong.append(f"pattern {key!r}: no hinge can take a drive: {reasons}")
        elif matched and key not in chosen.values() and not left_out[key]:
            before = ", ".join(sorted({repr(chosen.get(n, key)) for n in matched}))
            if key in {chosen.get(n, key) for n in matched}:
                continue  # a name that was refused above
            wrong.append(
                f"{key!r} is never reached: {before} before it matches the same joints;"
                " put the narrower one first"
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


def _is_pattern(key: str, around: Surroundings) -> bool:
    return key not in around.joints and any(sign in key for sign in "*?[")


def _means(key: str, name: str, around: Surroundings) -> bool:
    if _is_pattern(key, around):
        return fnmatchcase(name, key)
    return key == name


def _obstacle(joint: Any, around: Surroundings) -> str:
    """Why a hinge cannot take a drive; empty if it can."""
    if not joint.name:
        return f"a hinge of body {joint.parent.name!r} has no name"
    try:
        around.driven_joint(joint.name)
    except InputError as error:
        return str(error)
    return ""

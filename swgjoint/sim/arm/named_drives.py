"""Drives of an arm that the user states by joint name or pattern."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from swgjoint.errors import InputError
from swgjoint.joint.patterns import chosen_hinges, with_whole_names
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.scene.scene import Scene

ALL = "*"
"""Pattern of the drive that all joints get which no other pattern selects."""


def drives_by_joint(drives: Mapping[str, str], arm: RigidArm) -> dict[str, str]:
    """Drives of single joints; without those that only :data:`ALL` selects.

    Args:
        drives: Drive by joint name or pattern; the first key that matches a joint
            applies. Names may omit the suffix ``_joint``.
        arm: The arm.

    Returns:
        Drive by joint, in the order of the arm.

    Raises:
        InputError: If a key selects no joint of the arm, or a joint has two drives.
    """
    if not drives.keys() - {ALL}:
        return {}
    for key in drives:
        for name in (key, f"{key}_joint"):
            if name in arm.held:
                raise InputError(
                    f"joint {name!r} gets no drive: {arm.held[name]}; accepted:"
                    f" {', '.join(arm.joints)}"
                )
    spec = arm.spec()
    named = with_whole_names(spec, drives)
    chosen = chosen_hinges(spec, named)
    return {joint: named[key] for joint, key in chosen.items() if key != ALL}


def check_drives(
    scene: Scene,
    drives: Mapping[str, str],
    own: Mapping[str, str],
    changes: Iterable[str],
) -> None:
    """Reject changes of a scene that contradict the drives stated beside them.

    A change of one joint may replace the drive of a pattern, and every change the drive
    of all joints in single joints.

    Args:
        scene: The scene with all drives and changes.
        drives: Drive by joint name or pattern.
        own: Drive by joint, from :func:`drives_by_joint`.
        changes: Dotted keys of the changes.

    Raises:
        InputError: If a drive is stated twice, with two values.
    """
    changes = list(changes)
    faults = []
    if ALL in drives and scene.defaults.drive != drives[ALL]:
        faults.append(_contradiction(drives[ALL], "all joints", "defaults", scene))
    for joint, drive in own.items():
        key = f"joints.{joint}"
        named = joint in drives or joint.removesuffix("_joint") in drives
        specific = any(one == key or one.startswith(f"{key}.") for one in changes)
        if scene.joint_settings(joint).drive != drive and (named or not specific):
            faults.append(_contradiction(drive, f"joint {joint!r}", key, scene))
    if faults:
        raise InputError("\n".join(faults))


def _contradiction(drive: str, what: str, key: str, scene: Scene) -> str:
    _, _, joint = key.partition(".")
    section = scene.joint_settings(joint) if joint else scene.defaults
    other = "no drive" if not section.has_drive else "linear or numbers"
    if section.drive is not None:
        other = repr(section.drive)
    return (
        f"drive {drive!r} of {what}, but {key} states {other}; accepted: one drive, or"
        " both the same"
    )

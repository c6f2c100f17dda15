"""Command-line options for changed keys and for an arm without a scene."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.drive_option import drives_of
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError

if TYPE_CHECKING:
    from swgjoint.sim.arm.drive_choice import DriveChoice
    from swgjoint.sim.arm.scene import ArmScene
    from swgjoint.sim.scene.scene import Scene

OF_AN_ARM = {
    "joints": "--joints",
    "pose": "--pose",
    "motion": "--motion",
    "balance_inertia": "--balance-inertia",
}
"""Options that apply to an arm only, by attribute of the parsed arguments."""


def add_arm_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that select joints, start pose and motion of an arm."""
    group = parser.add_argument_group("options for an arm (MJCF or URDF file)")
    group.add_argument(
        "--joints",
        metavar="NAME,PATTERN,...",
        action="append",
        default=[],
        help="hinge joints that get drives and move; wildcards * and ? are allowed,"
        " as in 'shoulder*,elbow'; all other joints are locked in the start pose and"
        " get no drives; default: all; repeatable",
    )
    group.add_argument(
        "--pose",
        metavar="NAME",
        help="start pose: name of a keyframe in the file, 'reference', or 'middle' (of"
        " the joint ranges); default: the first of keyframe, reference and middle in"
        " which no bodies touch",
    )
    group.add_argument(
        "--motion",
        metavar="KIND",
        help="sweep (default), step, trapezoid, constant_speed, speed_steps,"
        " chirp, line, circle, iso9283 or csv, with default values suitable for an arm;"
        " change them with --set trajectory.KEY=VALUE",
    )
    group.add_argument(
        "--balance-inertia",
        action="store_true",
        help="set all three principal moments of a physically impossible inertia in the"
        " file to their mean, and those of a body that has a mass alone to those of a"
        " sphere of water",
    )


def add_overrides(
    parser: argparse._ActionsContainer, text: str = "change a key of the scene"
) -> None:
    """Add the repeatable option ``--set KEY=VALUE``, stored as ``overrides``.

    Args:
        parser: Parser of the command.
        text: Help text of the option.
    """
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help=f"{text}; repeatable",
    )


def scene_of(
    args: argparse.Namespace, changes: list[str]
) -> tuple[Scene, Any, tuple[str, ...]]:
    """Load the scene named on the command line, or build one for an arm.

    Args:
        args: Parsed arguments: ``scene``, the options of :func:`add_arm_arguments` and,
            if the command has it, ``drives``.
        changes: Changes of the scene, each as ``KEY=VALUE``.

    Returns:
        The scene, for an arm the JSON object of the automatically selected drives by
        joint (None if ``args.scene`` is a scene), and the joints whose rotor inertia is
        assumed.

    Raises:
        InputError: If an option for an arm is combined with a scene, or if drives are
            incomplete or contradict each other.
    """
    from swgjoint.sim.arm.scene import arm_scene, is_arm
    from swgjoint.sim.scene.scene import Scene

    drives = drives_of(getattr(args, "drives", []))
    if is_arm(args.scene):
        made: ArmScene = arm_scene(
            args.scene,
            drive=drives,
            joints=args.joints,
            pose=args.pose,
            motion=args.motion,
            balance_inertia=args.balance_inertia,
            overrides=changes,
        )
        choice: dict[str, DriveChoice] = made.drive_choice
        selected = {name: one.as_json() for name, one in choice.items()}
        return made.scene, selected, made.assumed_rotors
    arm_options = [option for name, option in OF_AN_ARM.items() if getattr(args, name)]
    if arm_options:
        raise InputError(
            f"{', '.join(arm_options)} with scene {args.scene!r}; accepted: with an arm"
            " (an MJCF or URDF file); with a scene, use --set KEY=VALUE instead"
        )
    if drives:
        return _scene_with(args.scene, drives, changes), None, ()
    return Scene.load_file(args.scene, changes), None, ()


def _scene_with(reference: str, drives: dict[str, str], changes: list[str]) -> Scene:
    """Load a scene with other drives in all joints or in some of them."""
    from swgjoint.sim.arm.named_drives import ALL, check_drives, drives_by_joint
    from swgjoint.sim.arm.scene import rigid_arm_of
    from swgjoint.sim.scene.overrides import parse_override
    from swgjoint.sim.scene.scene import Scene

    scene, own = Scene.load_file(reference), {}
    if drives.keys() - {ALL}:
        # the changes may state another arm or other joints that have drives
        own = drives_by_joint(drives, rigid_arm_of(scene.with_changes(changes)))
    if ALL in drives:
        scene = scene.with_drive(drives[ALL])
    changed = scene.with_drives(own).with_changes(changes)
    check_drives(changed, drives, own, [parse_override(one)[0] for one in changes])
    return changed


def choice_lines(choice: dict[str, Any]) -> list[str]:
    """Table of the automatically selected drives, with remarks on those too weak.

    Args:
        choice: JSON objects of the selected drives by joint.

    Returns:
        Lines of text.
    """
    rows = [
        (
            joint,
            one["drive"],
            f"{one['decided_by']} {one['needed_Nm']:.3g}",
            f"{one['available_Nm']:.4g}",
            _remark(one),
        )
        for joint, one in choice.items()
    ]
    lacking = [name for name, one in choice.items() if not one["fits"]]
    lines = [
        "drives selected by rule: the smallest CSG drive of ratio 100 that covers the"
        " motor torque limit in the file (effort), the weight and the motion; to select"
        " others: --drive [JOINT=]NAME; to leave joints such"
        " as a gripper's without a drive: --joints 'PATTERN,...'",
        table(
            [("", "", "N·m", "N·m", ""), *rows],
            header=("joint", "drive", "required torque", "capacity", ""),
        ),
    ]
    if lacking:
        which = "any joint" if len(lacking) == len(choice) else ", ".join(lacking)
        lines.append(
            f"no CSG drive of ratio 100 is strong enough for {which}: the largest one"
            " is used instead"
        )
    return lines


def _remark(one: dict[str, Any]) -> str:
    if not one["fits"]:
        others = ", ".join(
            f"{kind} {torque:.3g} N·m"
            for kind, torque in one["asked_Nm"].items()
            if kind != one["decided_by"]
        )
        return (
            f"too weak for {_torque(one['needed_Nm'])} from the"
            f" {_SOURCES[one['decided_by']]}; largest drive: {one['drive']}; other"
            f" requirements: {others}"
        )
    if one["larger_than_needed"]:
        return "smallest drive, its capacity is more than 10 times larger than required"
    return ""


_SOURCES = {
    "effort": "effort limit in the file",
    "weight": "weight",
    "motion": "motion",
}


def _torque(value: float) -> str:
    return f"{value / 1e3:.3g} kN·m" if value >= 1e4 else f"{value:.4g} N·m"

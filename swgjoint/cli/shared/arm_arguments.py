"""What ``run`` and ``advise`` ask about an arm that has no scene."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

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


def add_arm_arguments(parser: argparse.ArgumentParser) -> None:
    """Which hinges move, from where, and how."""
    group = parser.add_argument_group("for an arm, an MJCF or URDF file")
    group.add_argument(
        "--joints",
        metavar="NAME,PATTERN,...",
        action="append",
        default=[],
        help="hinges that get drives and move, with * and ? as in 'shoulder*,elbow';"
        " the others are held in the start pose, without drives; default: all;"
        " repeatable",
    )
    group.add_argument(
        "--pose",
        metavar="NAME",
        help="where the arm starts: a keyframe of the file, reference or middle (of the"
        " ranges); default: the first of keyframe, reference and middle in which no"
        " bodies touch",
    )
    group.add_argument(
        "--motion",
        metavar="KIND",
        help="sweep (default), step, trapezoid, constant_speed, chirp, line, circle,"
        " iso9283 or csv, with values that suit an arm; others: --set"
        " trajectory.KEY=VALUE",
    )
    group.add_argument(
        "--balance-inertia",
        action="store_true",
        help="repair inertias that no rigid body has: their mean in all directions",
    )


def scene_of(args: argparse.Namespace, changes: list[str]) -> tuple[Scene, Any]:
    """The scene that is asked for, and the drives chosen by rule.

    Args:
        args: With ``scene``, the options of :func:`add_arm_arguments` and, where the
            command has it, ``drive``.
        changes: Of the scene, as ``KEY=VALUE``.

    Returns:
        The scene, and for an arm its drives by rule, as for JSON; None for a scene.
    """
    from swgjoint.sim.arm.scene import arm_scene, is_arm
    from swgjoint.sim.scene.scene import Scene

    drive: str | None = getattr(args, "drive", None)
    if is_arm(args.scene):
        made: ArmScene = arm_scene(
            args.scene,
            drive=drive,
            joints=args.joints,
            pose=args.pose,
            motion=args.motion,
            balance_inertia=args.balance_inertia,
            overrides=changes,
        )
        choice: dict[str, DriveChoice] = made.drive_choice
        return made.scene, {name: one.as_json() for name, one in choice.items()}
    given = [option for name, option in OF_AN_ARM.items() if getattr(args, name)]
    if given:
        raise InputError(
            f"{', '.join(given)} with scene {args.scene!r}; accepted: with an arm, an"
            " MJCF or URDF file; a scene says it in its own keys"
        )
    if drive:
        scene = Scene.load_file(args.scene).with_drive(drive)
        return scene.with_changes(changes), None
    return Scene.load_file(args.scene, changes), None


def choice_lines(choice: dict[str, Any]) -> list[str]:
    """Drives chosen by default, what decided, and where no drive is strong enough."""
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
        "drives by rule, the smallest CSG of ratio 100 that carries effort (of the"
        " file), weight and motion; others: --drive, --set joints.JOINT.drive=NAME",
        table(
            [("", "", "N·m", "N·m", ""), *rows],
            header=("joint", "drive", "decided by", "carries", ""),
        ),
    ]
    if lacking:
        which = "any joint" if len(lacking) == len(choice) else ", ".join(lacking)
        lines.append(f"no drive of the rule carries {which}: the largest stands in")
    return lines


def _remark(one: dict[str, Any]) -> str:
    if not one["fits"]:
        others = ", ".join(
            f"{kind} {torque:.3g} N·m"
            for kind, torque in one["asked_Nm"].items()
            if kind != one["decided_by"]
        )
        return (
            f"none carries {_torque(one['needed_Nm'])} of the"
            f" {_SOURCES[one['decided_by']]}, largest {one['drive']} ({others})"
        )
    if one["larger_than_needed"]:
        return "smallest drive, over 10 times larger than what is asked"
    return ""


_SOURCES = {
    "effort": "file's effort",
    "weight": "weight",
    "motion": "motion",
}


def _torque(value: float) -> str:
    return f"{value / 1e3:.3g} kN·m" if value >= 1e4 else f"{value:.4g} N·m"

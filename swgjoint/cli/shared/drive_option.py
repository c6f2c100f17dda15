"""Option ``--drive [JOINT=]NAME``: drives of an arm by joint name or pattern."""

from __future__ import annotations

import argparse
from pathlib import Path

from swgjoint.errors import InputError


def add_drive_option(
    parser: argparse._ActionsContainer, joints: str, default: str
) -> None:
    """Add the repeatable option ``--drive``, stored as ``drives``.

    Args:
        parser: Parser of the command, or a group of its options.
        joints: Joints that get a drive without ``JOINT=``, for the help text.
        default: What applies without the option, for the help text.
    """
    parser.add_argument(
        "--drive",
        metavar="[JOINT=]NAME",
        action="append",
        default=[],
        dest="drives",
        help=f"design, map or catalogue drive for {joints}, or for the joint or pattern"
        " JOINT, as in 'wrist_*=CSG-17-100'; the first option that matches a joint"
        f" applies; repeatable; {default}",
    )


def drives_of(options: list[str]) -> dict[str, str]:
    """Drive by joint name or pattern from the options ``--drive``.

    Args:
        options: Values of the option, each ``NAME`` or ``JOINT=NAME``. The name of an
            existing file is a ``NAME``, even if it contains ``=``.

    Raises:
        InputError: If a value is incomplete, or a joint has two drives.
    """
    drives: dict[str, str] = {}
    for text in options:
        joint, equals, name = text.partition("=")
        if not equals or Path(text).is_file():
            joint, name = "*", text
        if not (joint and name):
            raise InputError(f"--drive {text!r}; accepted: NAME or JOINT=NAME")
        if joint in drives:
            what = "all joints have" if joint == "*" else f"joint {joint!r} has"
            raise InputError(
                f"--drive {text!r}: {what} the drive {drives[joint]!r} already;"
                " accepted: one drive"
            )
        drives[joint] = name
    # the drive of all other joints comes last, wherever its option stands
    if "*" in drives:
        drives["*"] = drives.pop("*")
    return drives

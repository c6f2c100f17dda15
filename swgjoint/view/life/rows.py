"""Rows of the table of the life over a duty cycle, for the terminal and the report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from swgjoint.view.words import format_figure, format_hours, short

COLUMNS = (
    ("joint", ""),
    ("cubic mean torque", "N·m"),
    ("mean input speed", "rpm"),
    ("L50", "h"),
    ("L10", "h"),
    ("root stress", "MPa, amplitude"),
    ("Goodman safety", ""),
    ("flexspline life", "h"),
    ("momentary peak", "margin"),
    ("ratcheting", "margin"),
    ("buckling", "margin"),
)
"""Name and unit of every column."""


def describe_cycle(cycle: Mapping[str, Any]) -> str:
    """Duration and tasks of a duty cycle in one line.

    >>> tasks = [{"name": "lift", "duration_s": 2.0, "times": 3, "rest": False}]
    >>> describe_cycle({"duration_s": 6.0, "tasks": tasks})
    'Duty cycle of 6 s: lift 3 x 2 s'
    """
    parts = [
        f"{task['name']} "
        + (f"{task['times']} x " if task["times"] > 1 else "")
        + f"{task['duration_s']:g} s"
        for task in cycle["tasks"]
    ]
    return f"Duty cycle of {cycle['duration_s']:g} s: {', '.join(parts)}"


def life_cells(joint: str, life: Mapping[str, Any]) -> list[str]:
    """Cells of one joint, in the order of :data:`COLUMNS`.

    Args:
        joint: Name of the joint.
        life: Its figures ``life``.
    """
    bearing, flexspline = life["bearing"], life["flexspline"]
    return [
        short(joint),
        format_figure(life["cubed_mean_Nm"]),
        format_figure(life["mean_input_speed_rpm"]),
        format_hours(bearing["L50_h"]),
        format_hours(bearing["L10_h"]),
        format_figure(flexspline["stress_amplitude_MPa"]),
        format_figure(flexspline["goodman_safety"]),
        "unlimited" if flexspline["unlimited"] else format_hours(flexspline["life_h"]),
        *(format_figure(life["margins"][k]) for k in life["margins"]),
    ]


def life_grid(
    lives: Mapping[str, Mapping[str, Any]],
) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Columns and rows of the table; columns without any value are left out.

    Args:
        lives: Figures ``life`` by joint.
    """
    rows = [life_cells(joint, life) for joint, life in lives.items()]
    used = [k for k in range(len(COLUMNS)) if any(row[k] != "-" for row in rows)]
    return [COLUMNS[k] for k in used], [[row[k] for k in used] for row in rows]


BEARING_COLUMNS = (
    ("output bearing", ""),
    ("tilt", "arcmin, mean"),
    ("tilt", "arcmin, pp"),
    ("peak moment", "N·m"),
    ("permissible", "N·m"),
    ("mean moment", "N·m"),
    ("radial force", "N, mean"),
    ("axial force", "N, mean"),
    ("L10", "h"),
)
"""Name and unit of every column of the table of output bearings."""


def bearing_grid(joints: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Rows of the table of output bearings; empty without any.

    Args:
        joints: Figures of the joints.
    """
    return [
        [
            short(name),
            format_figure(one["tilt_arcmin"]["mean"]),
            format_figure(one["tilt_arcmin"]["pp"]),
            *(
                format_figure(one[key])
                for key in (
                    "peak_moment_Nm",
                    "permissible_moment_Nm",
                    "mean_moment_Nm",
                    "mean_radial_N",
                    "mean_axial_N",
                )
            ),
            format_hours(one["L10_h"]),
        ]
        for name, joint in joints.items()
        if (one := joint.get("output_bearing"))
    ]


def bearing_notes(joints: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Reasons for missing lives of output bearings.

    Args:
        joints: Figures of the joints.
    """
    return [
        f"-: no life of the output bearing of {short(name)}: {one['missing']}"
        for name, joint in joints.items()
        if (one := joint.get("output_bearing")) and one["missing"]
    ]


def missing_lines(joints: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Reasons for missing figures, grouped by joints with the same reason.

    Args:
        joints: Figures ``life`` by joint.
    """
    names: dict[tuple[str, str], list[str]] = {}
    for joint, life in joints.items():
        for part, title in (("bearing", "bearing life"), ("flexspline", "fatigue")):
            if reason := life[part]["missing"]:
                names.setdefault((title, reason), []).append(short(joint))
    return [
        f"-: no {title}"
        + ("" if len(of) == len(joints) else f" of {', '.join(of)}")
        + f": {reason}"
        for (title, reason), of in names.items()
    ]

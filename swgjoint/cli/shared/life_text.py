"""Life over the duty cycle, output bearings and strain gauges in terminal output."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table


def bearing_lines(result: dict[str, Any]) -> list[str]:
    """Format the tilt and the life of all output bearings; empty without any.

    Args:
        result: Figures of a run.
    """
    joints = result["joints"]
    if not any("output_bearing" in joint for joint in joints.values()):
        return []
    from swgjoint.view.life.rows import BEARING_COLUMNS, bearing_grid, bearing_notes

    names, units = zip(*BEARING_COLUMNS, strict=True)
    rows = bearing_grid(joints)
    return [table([units, *rows], header=names), *bearing_notes(joints)]


def gauge_lines(result: dict[str, Any]) -> list[str]:
    """Format the readings of all strain gauges; empty without any.

    Args:
        result: Figures of a run.
    """
    joints = result["joints"]
    if not any("gauges" in joint for joint in joints.values()):
        return []
    from swgjoint.view.gauges import GAUGE_COLUMNS, gauge_grid, gauge_notes

    names, units = zip(*GAUGE_COLUMNS, strict=True)
    rows = gauge_grid(joints)
    return [table([units, *rows], header=names), *gauge_notes(joints)]


def life_lines(result: dict[str, Any]) -> list[str]:
    """Format the life of all drives; empty without a duty cycle.

    Args:
        result: Figures of a run.
    """
    if "cycle" not in result:
        return []
    from swgjoint.view.life.rows import describe_cycle, life_grid, missing_lines

    lives = {name: joint["life"] for name, joint in result["joints"].items()}
    columns, rows = life_grid(lives)
    names, units = zip(*columns, strict=True)
    return [
        describe_cycle(result["cycle"]),
        table([units, *rows], header=names),
        *missing_lines(lives),
    ]

"""Life, output bearings, strain gauges and temperatures in terminal output."""

from __future__ import annotations

from collections.abc import Sequence
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

    return [_grid(BEARING_COLUMNS, bearing_grid(joints)), *bearing_notes(joints)]


def gauge_lines(result: dict[str, Any]) -> list[str]:
    """Format the readings of all strain gauges; empty without any.

    Args:
        result: Figures of a run.
    """
    joints = result["joints"]
    if not any("gauges" in joint for joint in joints.values()):
        return []
    from swgjoint.view.gauges import GAUGE_COLUMNS, gauge_grid, gauge_notes

    return [_grid(GAUGE_COLUMNS, gauge_grid(joints)), *gauge_notes(joints)]


def thermal_lines(result: dict[str, Any]) -> list[str]:
    """Format the temperatures of drives that warm; empty without any.

    Args:
        result: Figures of a run.
    """
    joints = result["joints"]
    if not any("thermal" in joint for joint in joints.values()):
        return []
    from swgjoint.view.thermal import THERMAL_COLUMNS, thermal_grid

    return [_grid(THERMAL_COLUMNS, thermal_grid(joints))]


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
    return [
        describe_cycle(result["cycle"]),
        _grid(columns, rows),
        *missing_lines(lives),
    ]


def _grid(columns: Sequence[tuple[str, str]], rows: Sequence[Sequence[str]]) -> str:
    """Table with the names of the columns and, below them, their units."""
    names, units = zip(*columns, strict=True)
    return table([units, *rows], header=names)

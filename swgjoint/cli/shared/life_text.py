"""Life, output bearings, strain gauges and temperatures in terminal output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from swgjoint.cli.shared.text import table


def joint_lines(result: dict[str, Any]) -> list[str]:
    """Format the output bearings, strain gauges and temperatures that the run has.

    Args:
        result: Figures of a run.
    """
    joints = result["joints"]
    present = {key for joint in joints.values() for key in joint}
    lines = []
    if "output_bearing" in present:
        from swgjoint.view.life.rows import BEARING_COLUMNS, bearing_grid, bearing_notes

        lines += [_grid(BEARING_COLUMNS, bearing_grid(joints)), *bearing_notes(joints)]
    if "gauges" in present:
        from swgjoint.view.gauges import GAUGE_COLUMNS, gauge_grid, gauge_notes

        lines += [_grid(GAUGE_COLUMNS, gauge_grid(joints)), *gauge_notes(joints)]
    if "thermal" in present:
        from swgjoint.view.thermal import THERMAL_COLUMNS, thermal_grid

        lines.append(_grid(THERMAL_COLUMNS, thermal_grid(joints)))
    return lines


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

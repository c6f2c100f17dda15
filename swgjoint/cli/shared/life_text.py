"""Life over the duty cycle in terminal output."""

from __future__ import annotations

from typing import Any

from swgjoint.cli.shared.text import table


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

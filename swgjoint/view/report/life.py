"""Life over the duty cycle in the HTML report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from swgjoint.view.life.rows import (
    BEARING_COLUMNS,
    bearing_grid,
    bearing_notes,
    describe_cycle,
    life_grid,
    missing_lines,
)
from swgjoint.view.report.tables import Table, cells_of

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


def bearing_tables(runs: Mapping[str, Run]) -> list[Table]:
    """One table for every run with output bearings.

    Args:
        runs: Runs by displayed name.
    """
    tables = []
    for label, run in runs.items():
        if not run.assembly.bearings:
            continue
        joints = run.figures["joints"]
        tables.append(
            Table(
                title=f"Output bearings of {label}",
                header=BEARING_COLUMNS,
                rows=cells_of(bearing_grid(joints)),
                notes=bearing_notes(joints),
            )
        )
    return tables


def life_tables(runs: Mapping[str, Run]) -> list[Table]:
    """One table for every run with a duty cycle.

    Args:
        runs: Runs by displayed name.
    """
    tables = []
    for label, run in runs.items():
        if not run.cycle:
            continue
        metrics = run.figures
        lives = {name: joint["life"] for name, joint in metrics["joints"].items()}
        columns, rows = life_grid(lives)
        tables.append(
            Table(
                title=f"Life of {label}",
                header=columns,
                rows=cells_of(rows),
                notes=[
                    f"{describe_cycle(metrics['cycle'])}.",
                    *missing_lines(lives),
                ],
            )
        )
    return tables

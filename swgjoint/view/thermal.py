"""Table and picture of the temperatures of drives that warm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from swgjoint.pictures import png
from swgjoint.view.report.tables import Table, cells_of
from swgjoint.view.words import short

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

THERMAL_COLUMNS = (
    ("temperature", ""),
    ("start", "°C"),
    ("end", "°C"),
    ("surroundings", "°C"),
    ("losses", "J"),
    ("released", "J"),
    ("time constant", "s"),
)
"""Name and unit of every column of the table of temperatures."""


def thermal_grid(joints: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Rows of the table of temperatures; empty without any.

    Args:
        joints: Figures of the joints of a run, by name.
    """
    rows = []
    for name, joint in joints.items():
        if (one := joint.get("thermal")) is None:
            continue
        constant = one["time_constant_s"]
        rows.append(
            [
                short(name),
                f"{one['start_C']:.2f}",
                f"{one['end_C']:.2f}",
                f"{one['ambient_C']:.2f}",
                f"{one['loss_J']:.4g}",
                f"{one['released_J']:.4g}",
                "-" if constant is None else f"{constant:.4g}",
            ]
        )
    return rows


def thermal_tables(runs: Mapping[str, Run]) -> list[Table]:
    """One table for every run with drives that warm.

    Args:
        runs: Runs by name.
    """
    return [
        Table(
            title=f"Temperatures of {label}",
            header=THERMAL_COLUMNS,
            rows=cells_of(thermal_grid(run.figures["joints"])),
        )
        for label, run in runs.items()
        if run.heat
    ]


def thermal_picture(run: Run) -> bytes:
    """Draw the temperature and the mean power of the losses of every drive that warms.

    Args:
        run: A run with drives that warm.

    Returns:
        The PNG file.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for joint, heat in run.heat.items():
        left.plot(heat.time, heat.celsius, lw=1.1, label=short(joint))
        right.stairs(heat.power, heat.time, baseline=None, label=short(joint))
    left.set_ylabel("temperature [°C]")
    right.set_ylabel("losses, mean of an interval [W]")
    right.set_ylim(bottom=0.0)
    for axis in (left, right):
        axis.set_xlabel("time [s]")
        axis.margins(x=0)
        axis.legend(fontsize=8, ncols=2)
    return png(figure, dpi=110)

"""Comparison of the baseline controllers as a text table and as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.pictures import png

if TYPE_CHECKING:
    from swgjoint.validation.control.ladder import Ladder

COLORS = ("0.6", "C1", "C0", "C2", "C3", "C5", "C4")
"""Colours of the controllers, in the sequence of the ladder."""


def ladder_table(ladder: Ladder) -> list[str]:
    """Lines of a text table: mean ± standard deviation of the specimens.

    There is one row per controller and one column per figure.
    """
    header = ["", *ladder.units]
    rows = [["", *ladder.units.values()]]
    for rung, figures in ladder.figures.items():
        cells = [
            f"{values.mean():.3g} ± {values.std(ddof=min(1, values.size - 1)):.2g}"
            + ("*" if ladder.made_for[rung] == key else " ")
            for key, values in figures.items()
        ]
        rows.append([rung, *cells])
    wide = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    lines = [
        "  ".join(cell.ljust(w) for cell, w in zip(row, wide, strict=True)).rstrip()
        for row in [header, *rows]
    ]
    return [*lines, "* figure that this controller is designed for"]


def ladder_picture(name: str, ladder: Ladder) -> bytes:
    """Draw signals of the first specimen, and figures of all specimens, as PNG.

    Args:
        name: Name of the drive.
        ladder: Results of the controllers.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 7.5), layout="constrained")
    axes = figure.subplots(2, 3)
    signals = (
        (
            axes[0, 0],
            "time",
            "tracking",
            "time [s]",
            "link error in the fast move [arcmin]",
        ),
        (
            axes[0, 1],
            "output",
            "positioning",
            "output angle [deg]",
            "link error in the slow turn\nminus its mean [arcmin]",
        ),
        (
            axes[0, 2],
            "even_time",
            "ripple",
            "time [s]",
            "output torque minus its mean [N·m]",
        ),
    )
    rungs = dict(zip(ladder.made_for, COLORS, strict=True))
    for ax, x, y, along, label in signals:
        for rung, shown in ladder.shown.items():
            off = shown[y].mean() if y == "positioning" else 0.0
            ax.plot(shown[x], shown[y] - off, lw=0.9, color=rungs[rung], label=rung)
        ax.set(xlabel=along, ylabel=label)
        ax.grid(alpha=0.3)
    axes[0, 0].legend(fontsize="x-small")
    bars = ("tracking_rms", "positioning_pp", "ripple_rms")
    for ax, key in zip(axes[1], bars, strict=True):
        names = list(ladder.figures)
        values = np.array([ladder.figures[rung][key] for rung in names])
        place = np.arange(len(names))
        ax.bar(place, values.mean(axis=1), color=[rungs[rung] for rung in names])
        for k, row in enumerate(values):
            ax.plot(np.full(row.size, k), row, "k.", ms=2)
        ax.set_yscale("log")
        ax.set_xticks(place, names, rotation=30, ha="right", fontsize="small")
        ax.set(title=f"{key.replace('_', ', ')} [{ladder.units[key]}]")
        ax.grid(alpha=0.3, axis="y")
    count = next(iter(ladder.figures.values()))[bars[0]].size
    figure.suptitle(
        f"{name}: one specimen (top); {count} specimens, dots, and their mean, bars"
        " (bottom)"
    )
    return png(figure, dpi=100)

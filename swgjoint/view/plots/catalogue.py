"""Picture of the comparison with the catalogue: model value over catalogue value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from swgjoint.pictures import png

if TYPE_CHECKING:
    from swgjoint.validation.rows import Row

PANELS = ("K1", "K2", "K3", "ratcheting torque")
"""Quantities that get a panel."""
_COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple")


def catalogue_picture(rows: Sequence[Row]) -> bytes | None:
    """Draw the ratio of model to catalogue by gear ratio and size as PNG.

    A bar extends from the smallest to the largest result of the variants, and a dot is
    the middle between them. A triangle is a lower bound. Grey areas show which ratios
    meet the accuracy goal.

    Args:
        rows: Rows of the study.

    Returns:
        The PNG file; None if no row can be drawn.
    """
    from matplotlib.figure import Figure

    shown = [row for row in rows if row.more["low_over_source"] is not None]
    panels = [name for name in PANELS if any(row.quantity == name for row in shown)]
    if not panels:
        return None
    ratios = sorted({row.more["ratio"] for row in shown})
    sizes = sorted({row.more["size"] for row in shown})
    figure = Figure(figsize=(1.0 + 3.4 * len(panels), 4.2), layout="constrained")
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axis, name in zip(axes, panels, strict=True):
        axis.axhline(1.0, color="0.3", lw=1.0)
        for row in (row for row in shown if row.quantity == name):
            size = sizes.index(row.more["size"])
            x = ratios.index(row.more["ratio"]) + 0.13 * (size - 0.5 * len(sizes) + 0.5)
            middle = row.more["over_source"]
            ends = row.more["low_over_source"], row.more["high_over_source"]
            colour = _COLOURS[size % len(_COLOURS)]
            if middle is None:  # a lower bound
                axis.plot(x, ends[0], "^", color=colour, ms=6, mfc="none")
            else:
                axis.vlines(x, *ends, color=colour, lw=4, alpha=0.45)
                axis.plot(x, middle, "o", color=colour, ms=5)
            if row.more["goal"] is not None:
                goal = row.more["goal"]
                axis.fill_between(
                    [x - 0.065, x + 0.065], 1 - goal, 1 + goal, color="0.85", zorder=0
                )
        axis.set_title(name)
        axis.set_xticks(range(len(ratios)), [f"{ratio}:1" for ratio in ratios])
        axis.set_xlabel("gear ratio")
        axis.grid(axis="y", alpha=0.3)
    highest = max(
        row.more["high_over_source"] or row.more["low_over_source"]
        for row in shown
        if row.quantity in panels
    )
    axes[0].set_ylim(0.0, 1.05 * max(highest, 1.4))
    for k, size in enumerate(sizes):
        colour = _COLOURS[k % len(_COLOURS)]
        axes[0].plot([], [], "o", color=colour, label=f"size {size}")
    axes[0].legend(fontsize="small")
    axes[0].set_ylabel("model / catalogue")
    figure.suptitle(
        "bar and dot: range of the variants and its middle; triangle: lower bound;"
        " grey: goal"
    )
    return png(figure, dpi=130)

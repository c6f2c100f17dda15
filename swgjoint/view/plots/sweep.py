"""Picture of a sweep: every figure over every parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.faults import split_unit
from swgjoint.pictures import png

if TYPE_CHECKING:
    from swgjoint.explore.sweep.sweep import SweepResult

MOST = 6
"""Largest number of parameters, and of figures, in a picture; the first ones are
drawn."""


def sweep_picture(result: SweepResult) -> bytes:
    """Draw one row of panels per figure and one column per parameter as PNG.

    Every design is a point. Its colour shows the first figure in all panels, so that a
    design can be recognised across them. Designs without figures are crosses at the
    bottom.
    """
    from matplotlib.figure import Figure

    rows = result.rows()
    columns, figures = result.columns[:MOST], result.file.figures[:MOST]
    canvas = Figure(
        figsize=(2.0 + 3.2 * len(columns), 1.2 + 2.6 * len(figures)),
        layout="constrained",
    )
    axes = canvas.subplots(
        len(figures), len(columns), squeeze=False, sharex="col", sharey="row"
    )
    colour = _numbers([row[figures[0]] for row in rows])
    shown = None
    for j, column in enumerate(columns):
        places, labels = _places([row[column] for row in rows])
        for i, figure in enumerate(figures):
            axis = axes[i, j]
            values = _numbers([row[figure] for row in rows])
            there = np.isfinite(values)
            if there.any():
                shown = axis.scatter(
                    places[there], values[there], c=colour[there], s=22, zorder=2
                )
            axis.plot(
                places[~there],
                np.full(np.count_nonzero(~there), 0.02),
                "x",
                color="tab:red",
                transform=axis.get_xaxis_transform(),
                ms=6,
            )
            axis.grid(alpha=0.3)
            if labels is not None:
                axis.set_xticks(range(len(labels)), labels, rotation=30, ha="right")
            if i == len(figures) - 1:
                axis.set_xlabel(label_of(column))
            if j == 0:
                axis.set_ylabel(label_of(figure))
    if shown is not None:
        canvas.colorbar(shown, ax=axes, label=label_of(figures[0]), aspect=40)
    ok = sum(record.ok for record in result.records)
    text = f"{ok} designs with figures, {len(rows) - ok} without (crosses)"
    canvas.suptitle(f"{result.file.description or 'sweep'}\n{text}", fontsize=10)
    return png(canvas, dpi=100)


def _numbers(values: Sequence[Any]) -> Any:
    return np.array([np.nan if v is None else float(v) for v in values])


def _places(values: Sequence[Any]) -> tuple[Any, list[str] | None]:
    """Positions on the axis, and tick labels if the values are not all numbers."""
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        return np.array(values, dtype=float), None
    labels = list(dict.fromkeys(str(value) for value in values))
    places = np.array([labels.index(str(value)) for value in values], dtype=float)
    return places, [text if len(text) <= 20 else f"{text[:17]}..." for text in labels]


def label_of(key: str) -> str:
    """Last part of a dotted key in words, with its unit.

    If only the part before it has a unit, the last part is the name of a joint, which
    then follows after a comma.
    """
    *above, last = key.split(".")
    name, unit = split_unit(last)
    joint = ""
    if not unit and above and split_unit(above[-1])[1]:
        (name, unit), joint = split_unit(above[-1]), f", {last}"
    return name.replace("_", " ") + (f" [{unit}]" if unit else "") + joint

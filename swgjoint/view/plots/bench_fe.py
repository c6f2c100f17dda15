"""Picture of ``swgjoint bench fe``."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

from swgjoint.pictures import png

STYLES = {
    "ring": ("C2", "^", "thin ring"),
    "2d linear": ("C0", "x", "2D, linear"),
    "2d": ("C0", "s", "2D"),
    "3d linear": ("C3", "x", "3D, linear"),
    "3d": ("C3", "o", "3D"),
}
"""Colour, marker and name by kind of model."""
LEAST = 1e-3
"""Smaller errors are drawn at this value [%]."""


def cost_picture(
    result: Mapping[str, Any],
    *,
    quantities: Collection[str],
    bounds: Collection[float],
    seconds: Callable[[Mapping[str, Any]], float],
) -> bytes:
    """Draw the magnitude of the error over CPU time with the Pareto front as PNG.

    Args:
        result: Result of :func:`swgjoint.bench.fe.cost.run_fe_cost`.
        quantities: Quantities of the rows, one panel each.
        bounds: Error bounds that are marked [%].
        seconds: Function that returns the CPU time of a row [s].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 8.4), layout="constrained")
    rows = [row for row in result["rows"] if row["error_percent"] is not None]
    reference = rows[0]["reference"]
    panels = figure.subplots(2, 2)
    for ax, quantity in zip(panels.flat, quantities, strict=True):
        here = [row for row in rows if row["quantity"] == quantity]
        shown = [r for r in here if f"{r['model']}, {r['setting']}" != r["reference"]]
        for kind, (colour, marker, name) in STYLES.items():
            of_kind = [row for row in shown if row["kind"] == kind]
            x = [seconds(row) for row in of_kind]
            y = [max(row["error_percent"], LEAST) for row in of_kind]
            ax.plot(x, y, marker, color=colour, label=name, ms=7)
            for row, a, b in zip(of_kind, x, y, strict=True):
                short = row["setting"].removeprefix("thin rings, ")
                short = short.removeprefix("refinement ").removesuffix(", linear")
                ax.annotate(
                    short, (a, b), xytext=(5, 4), textcoords="offset points", fontsize=7
                )
        front = sorted((row for row in shown if row["pareto"]), key=seconds)
        ax.plot(
            [seconds(row) for row in front],
            [max(row["error_percent"], LEAST) for row in front],
            "-",
            color="0.6",
            zorder=0,
            label="Pareto front",
        )
        for row in here:
            if f"{row['model']}, {row['setting']}" == row["reference"]:
                ax.axvline(seconds(row), color="0.6", ls=":", label="reference")
        for bound in bounds:
            ax.axhline(bound, color="0.9", zorder=0)
        ax.set(xscale="log", yscale="log", title=quantity)
        ax.set(xlabel="CPU time [s]", ylabel="error [%]")
        ax.margins(x=0.12, y=0.1)
    panels[0, 0].legend(fontsize="small")
    figure.suptitle(f"{result['design']}; reference: {reference}")
    return png(figure, dpi=100)

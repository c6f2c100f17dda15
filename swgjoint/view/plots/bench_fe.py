"""Picture of ``swgjoint bench fe``."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
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
TITLES = {
    "torsional_stiffness_Nm_rad": "torsional stiffness",
    "kinematic_error_pp_arcsec": "kinematic error without load, peak to peak",
    "tensile_MPa": "largest tensile stress",
    "rim_shape_mm": "shape of the rim",
}
"""Titles of the panels by quantity."""
LEAST = 1e-3
"""Smaller errors are drawn at this value [%]."""
PLACES = ((6, 4), (6, -11), (-6, 4), (-6, -11))
"""Offsets of a label from its point, in the order in which they are tried [points]."""
LETTER, LINE, APART = 4.2, 7.0, 3.0
"""Width of a letter, height of a label, and distance between two labels [points]."""


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
        labels = []
        for kind, (colour, marker, name) in STYLES.items():
            of_kind = [row for row in shown if row["kind"] == kind]
            x = [seconds(row) for row in of_kind]
            y = [max(row["error_percent"], LEAST) for row in of_kind]
            ax.plot(x, y, marker, color=colour, label=name, ms=7)
            labels += [
                (_short(row["setting"]), a, b)
                for row, a, b in zip(of_kind, x, y, strict=True)
            ]
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
        ax.set(xscale="log", yscale="log", title=TITLES.get(quantity, quantity))
        ax.set(xlabel="CPU time [s]", ylabel="error [%]")
        ax.margins(x=0.12, y=0.1)
        _label(ax, labels)
    panels[0, 0].legend(fontsize="small")
    figure.suptitle(f"{result['design']}; reference: {reference}")
    return png(figure, dpi=100)


def _short(setting: str) -> str:
    """Refinement of a setting, and whether all teeth are solved."""
    short = setting.removeprefix("thin rings, ").removeprefix("refinement ")
    return short.removesuffix(", linear")


def _label(ax: Any, labels: Sequence[tuple[str, float, float]]) -> None:
    """Write texts next to their points, unless they would cover others.

    Args:
        ax: Axes with their final limits.
        labels: Texts with the coordinates of their points.
    """
    points = 72.0 / ax.figure.dpi
    at = [ax.transData.transform((a, b)) * points for _, a, b in labels]
    taken = [(x - 3.0, x + 3.0, y - 3.0, y + 3.0) for x, y in at]
    for (text, a, b), (x, y) in zip(labels, at, strict=True):
        for right, up in PLACES:
            left = x + right - (LETTER * len(text) if right < 0 else 0.0)
            box = (left, left + LETTER * len(text) + APART, y + up, y + up + LINE)
            if any(_overlap(box, other) for other in taken):
                continue
            ax.annotate(
                text,
                (a, b),
                xytext=(right, up),
                textcoords="offset points",
                ha="left" if right > 0 else "right",
                fontsize=7,
            )
            taken.append(box)
            break


def _overlap(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two boxes (left, right, low, high) overlap."""
    return a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3]

"""Picture of ``swgjoint bench scaling``."""

from __future__ import annotations

from collections.abc import Mapping
from math import isqrt
from typing import Any

import numpy as np

from swgjoint.pictures import png


def scaling_picture(result: Mapping[str, Any], labels: Mapping[str, str]) -> bytes:
    """Draw the CPU time over the size of the problem, with fitted power laws, as PNG.

    Args:
        result: JSON object of the benchmark, with ``rows`` and ``fits``.
        labels: Label of the size axis by sweep; one panel each, in this order.
    """
    from matplotlib.figure import Figure

    columns = min(4, isqrt(max(len(labels) - 1, 0)) + 1)
    lines = -(-len(labels) // columns)
    figure = Figure(figsize=(3.6 * columns, 3.3 * lines), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    fits = {fit["sweep"]: fit for fit in result["fits"]}
    for ax, (sweep, label) in zip(panels, labels.items(), strict=False):
        rows = [r for r in result["rows"] if r["sweep"] == sweep and r["seconds"]]
        ax.loglog([r["size"] for r in rows], [r["seconds"] for r in rows], "o-", ms=4)
        if (fit := fits.get(sweep)) is not None:
            x = np.array([r["size"] for r in rows if r["size"] >= fit["from_size"]])
            y = fit["coefficient"] * x ** fit["exponent"]
            ax.loglog(x, y, "k--", lw=1.0, label=f"exponent {fit['exponent']:.2f}")
            ax.legend(fontsize="small")
        ax.set(xlabel=label, ylabel="CPU time [s]")
        if rows:
            ax.set_title(f"{sweep}: time per {rows[0]['per']}", fontsize=9)
            sizes = [row["size"] for row in rows]
            ax.set_xticks(sizes, [f"{size:.4g}" for size in sizes], fontsize=7)
        ax.xaxis.minorticks_off()
        ax.tick_params(axis="y", which="both", labelsize=7)
        ax.grid(alpha=0.3)
    for ax in panels[len(labels) :]:
        ax.set_visible(False)
    return png(figure, dpi=90)

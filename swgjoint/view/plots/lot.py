"""Picture of a lot: distribution of its figures, and yield as a function of limits."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from swgjoint.pictures import png

_LABELS = {
    "transmission_accuracy_arcmin": "transmission accuracy [arcmin]",
    "ripple_rms_percent": "torque ripple, output held [% of rated, rms]",
    "torsional_stiffness_Nm_rad": "torsional stiffness at rated torque [N·m/rad]",
    "lost_motion_arcmin": "lost motion [arcmin]",
    "K1_Nm_rad": "torsional stiffness K1 [N·m/rad]",
}


def lot_picture(result: dict[str, Any], *, lower: Collection[str]) -> bytes | None:
    """Draw the histogram of every figure, and the yield for any limit on it, as PNG.

    Drives without a solution count as drives that miss the limit.

    Args:
        result: Result of :func:`swgjoint.explore.lot.run_lot`.
        lower: Keys of the figures that have a lower limit; the others have an upper
            one.

    Returns:
        The PNG file; None if no drive was solved.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import PercentFormatter

    rows = result["rows"]
    keys = [key for key, value in result["figures"].items() if value is not None]
    if not keys:
        return None
    figure = Figure(figsize=(1.0 + 4.2 * len(keys), 6.0), layout="constrained")
    axes = figure.subplots(2, len(keys), sharex="col", squeeze=False)
    for (above, below), key in zip(axes.T, keys, strict=True):
        values = np.sort([row[key] for row in rows if row[key] is not None])
        above.hist(values, bins="auto", color="tab:blue", alpha=0.6)
        # the total includes drives without a solution, which miss every limit
        part = np.arange(1, values.size + 1) / len(rows)
        if key in lower:
            part = part[::-1]
        below.step(values, part, where="post", color="tab:blue")
        below.yaxis.set_major_formatter(PercentFormatter(1.0))
        below.set_ylim(0.0, 1.02)
        below.set_xlabel(_LABELS[key])
        below.grid(alpha=0.3)
        limit = (result["spec"] or {}).get(key)
        if limit is not None:
            for axis in (above, below):
                axis.axvline(limit, color="tab:red", lw=1.2)
            alone = result["yield"]["by_limit"][key]["part"]
            below.set_title(f"limit {limit:g}: {100 * alone:.1f} % pass", fontsize=10)
    axes[0][0].set_ylabel("number of drives")
    axes[1][0].set_ylabel("yield for this limit alone")
    meaning = {
        "limit": "sizes of the errors equal to the tolerances",
        "uniform": "sizes of the errors drawn between zero and the tolerances",
    }[result["sizes"]]
    figure.suptitle(f"{result['design']}: {len(rows)} drives, {meaning}", fontsize=11)
    return png(figure, dpi=110)

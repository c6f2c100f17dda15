"""Picture of a measured and a predicted torque loop, and their difference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.pictures import png
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.maps.fit.overlay import Overlay


def overlay_picture(name: str, laid: Overlay) -> bytes:
    """Draw both loops over the torque, and the residual by load direction, as PNG.

    A grey band shows the rms residual of each segment of the torque range.

    Args:
        name: Name of the drive.
        laid: Measured and predicted loop.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.4), layout="constrained")
    loops, rest = figure.subplots(1, 2)
    torque = laid.measured.torque
    loops.plot(
        torque, laid.measured.torsion / arcmin, color="0.55", lw=2.5, label="measured"
    )
    loops.plot(
        torque,
        laid.predicted.torsion / arcmin,
        color="tab:red",
        lw=1.1,
        label="predicted",
    )
    loops.set_title("torque loop, input locked")
    loops.set_ylabel("torsion [arcmin]")
    loops.legend(fontsize="small")
    residual = laid.residual / arcmin
    for rising, colour in ((True, "tab:blue"), (False, "tab:orange")):
        label = "increasing torque" if rising else "decreasing torque"
        for begin, end in laid.measured.turns():
            if (torque[end] > torque[begin]) == rising:
                part = slice(begin, end + 1)
                rest.plot(torque[part], residual[part], color=colour, label=label)
                label = "_"
    for row in laid.segments():
        if row["rms_arcmin"] is None:
            continue
        for sign in (-1.0, 1.0):
            edges = sign * np.array([row["from_Nm"], row["to_Nm"]])
            band = np.full(2, row["rms_arcmin"])
            rest.fill_between(edges, -band, band, color="0.5", alpha=0.2, lw=0)
    rest.set_title("residual: measured minus predicted (grey band: rms)")
    rest.set_ylabel("residual torsion [arcmin]")
    rest.legend(fontsize="small")
    for axis in (loops, rest):
        axis.set_xlabel("torque [N·m]")
        axis.grid(alpha=0.3)
    figure.suptitle(f"{name}: measured and predicted torque loop")
    return png(figure, dpi=130)

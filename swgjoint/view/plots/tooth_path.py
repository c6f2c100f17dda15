"""Picture of a rigid flexspline tooth passing through a tooth space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.pictures import png
from swgjoint.units import deg, mm, um

if TYPE_CHECKING:
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.tooth_path import ToothPath

SHOWN = 25
"""Approximate number of tooth positions in the picture."""


def tooth_path_picture(design: Design, path: ToothPath) -> bytes:
    """Draw the positions of a tooth in its space, and its clearance, as PNG.

    The tooth is rigid and follows the prescribed neutral line. In a real drive, elastic
    deformation would have to take up an overlap.

    Args:
        design: The design.
        path: Passage of its flexspline tooth.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.8), layout="constrained")
    space, clearance = figure.subplots(1, 2)
    ring = tooth_profile(design, "circular_spline")
    outline, _, _ = ring.evaluate(np.linspace(0.0, ring.stations[-1], 200))
    # the axis of the space is half a pitch from the axis of a tooth next to it
    cos, sin = np.cos(ring.half_pitch), np.sin(ring.half_pitch)
    x, y = -outline[:, 0], outline[:, 1]
    right = np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)
    for side in (1.0, -1.0):
        space.plot(side * right[:, 0] / mm, right[:, 1] / mm, color="tab:red")
    inside = np.flatnonzero(np.isfinite(path.clearance))
    if inside.size:
        for k in inside[:: max(1, inside.size // SHOWN)]:
            flank = path.flank[k] / mm
            space.plot(flank[:, 0], flank[:, 1], color="tab:blue", lw=0.6, alpha=0.6)
    space.plot(path.tip[:, 0] / mm, path.tip[:, 1] / mm, "k:", lw=0.8)
    low, high = ring.addendum_radius / mm, ring.dedendum_radius / mm
    space.set_ylim(low - 0.6 * (high - low), high + 0.1 * (high - low))
    width = 1.4 * float(right[:, 0].max()) / mm
    space.set_xlim(-width, width)
    space.set_aspect("equal")
    space.set_xlabel("x [mm]")
    space.set_ylabel("y [mm]")
    space.set_title(
        "positions of the right flank, path of the tip (dotted)", fontsize="medium"
    )
    clearance.plot(path.theta / deg, path.clearance / um, color="tab:blue")
    clearance.axhline(0.0, color="0.5", lw=0.8)
    worst = path.worst
    clearance.plot(
        path.theta[worst] / deg, path.clearance[worst] / um, "o", c="tab:red"
    )
    clearance.set_yscale("symlog", linthresh=1.0)
    clearance.set_xlabel("angle of the tooth from the lobe [deg]")
    clearance.set_ylabel("clearance [µm] (negative: overlap)")
    where = path.where[worst].replace("_", " ")
    clearance.set_title(
        f"smallest clearance {path.smallest_clearance / um:.3g} µm ({where})",
        fontsize="medium",
    )
    clearance.grid(alpha=0.3)
    figure.suptitle(f"{design.drive.name}: passage of a rigid tooth")
    return png(figure, dpi=110)

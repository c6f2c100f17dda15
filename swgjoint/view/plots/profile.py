"""Pictures of tooth profiles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from swgjoint.pictures import png
from swgjoint.units import mm

if TYPE_CHECKING:
    from swgjoint.gear.design.design import Design
    from swgjoint.gear.teeth.profile import ToothProfile

_COLOURS = {"flexspline": "tab:blue", "circular_spline": "tab:red"}


def profile_picture(design: Design, profiles: Mapping[str, ToothProfile]) -> bytes:
    """Draw one tooth of each member as PNG, with the pitch circles at the same height.

    The left panel shows both teeth and marks the junctions of their segments. The right
    panel shows the flexspline tooth in a tooth space of the circular spline.

    Args:
        design: The design.
        profiles: Tooth profiles by member.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.9), layout="constrained")
    axes = figure.subplots(1, 2)
    for member, profile in profiles.items():
        colour, label = _COLOURS[member], member.replace("_", " ")
        stations = profile.stations
        line, _, _ = profile.evaluate(np.linspace(0.0, stations[-1], 600))
        marks, _, _ = profile.evaluate(stations)
        shift = np.array([0.0, profile.pitch_radius])
        for k, ax in enumerate(axes):
            # the right panel is centred on a space, half a pitch from the tooth
            turn = profile.half_pitch if k == 1 and profile.internal else 0.0
            c, s = np.cos(turn), np.sin(turn)
            for side in (1.0, -1.0):
                mirror = np.array([side, 1.0])
                rotation = np.array([[c, s], [-s, c]])
                # the mirrored flank of the next tooth is on the other side of the space
                points = (line * mirror) @ (rotation if side < 0 else rotation.T).T
                x, y = (points - shift).T / mm
                name = label if side > 0 else None
                ax.plot(x, y, color=colour, lw=1.5, label=name)
                if k == 0:
                    x, y = (marks * mirror - shift).T / mm
                    ax.plot(x, y, ".", color=colour, ms=5)
    axes[0].set_title("one tooth of each member, dots at segment junctions")
    axes[1].set_title("flexspline tooth in a tooth space, pitch circles touching")
    for ax in axes:
        ax.title.set_fontsize("medium")
        ax.set_aspect("equal")
        ax.axhline(0.0, color="0.7", lw=0.8, ls="--")
        ax.set_xlabel("across the tooth [mm]")
        ax.set_ylabel("above the pitch circle [mm]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    figure.suptitle(f"{design.drive.name}: tooth profiles")
    return png(figure, dpi=130)

"""Pictures of the report: one per joint, with all runs in every panel."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swgjoint.pictures import png
from swgjoint.units import arcmin
from swgjoint.view.plots.runs import draw_ripple
from swgjoint.view.recording.blueprint import is_rigid
from swgjoint.view.recording.entities import COLORS
from swgjoint.view.words import short

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

_COLUMNS = 1500
"""Number of minimum-maximum pairs per line; the picture cannot resolve more."""


def joint_png(runs: Mapping[str, Run], joint: str) -> bytes:
    """Draw the torque, torsion, error and ripple of one joint.

    The upper panels show the output torque, the torsion and the transmission error over
    time. The lower panels show the torque ripple, its order spectrum, and the torque
    over the torsion. Next to other runs, a rigid run appears only in the torque panel.

    Args:
        runs: Runs of one motion by name.
        joint: Name of the joint.

    Returns:
        The PNG file.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 6.2), layout="constrained")
    axes = figure.subplots(2, 3)
    first = next(iter(runs.values()))
    j = first.joints.index(joint)
    for k, (label, run) in enumerate(runs.items()):
        color = tuple(c / 255 for c in COLORS[k % len(COLORS)])
        dash = "-" if k < len(COLORS) else "--"
        style: dict[str, Any] = {"color": color, "ls": dash, "lw": 0.9, "label": label}
        plot_over_time(axes[0, 0], run.time, run.output_torque[:, j], **style)
        if is_rigid(run) and len(runs) > 1:
            continue  # its lines at zero would only widen the axes
        plot_over_time(axes[0, 1], run.time, run.torsion[:, j] / arcmin, **style)
        error = run.transmission_error[:, j] / arcmin
        plot_over_time(axes[0, 2], run.time, error, **style)
        draw_ripple(axes[1, 0], axes[1, 1], run, j, style, line=plot_over_time)
        window = run.steady
        axes[1, 2].plot(
            run.torsion[window, j] / arcmin, run.output_torque[window, j], **style
        )
    steady = first.time[first.steady][[0, -1]]
    for axis in axes[0]:
        axis.axvspan(*steady, color="0.94", zorder=0)
        axis.set_xlabel("time [s]   (shaded: used for the figures)")
        axis.margins(x=0)
    _label(axes[0, 0], "output torque", "output torque [N·m]")
    _label(axes[0, 1], "torsion", "torsion [arcmin]")
    _label(axes[0, 2], "transmission error", "output − ideal output [arcmin]")
    title = "torque ripple, last half turn of the input"
    _label(axes[1, 0], title, "ripple [% of rated torque]")
    axes[1, 0].set_xlabel("input turns")
    _label(axes[1, 1], "order spectrum of the ripple", "amplitude [% of rated torque]")
    axes[1, 1].set_xlabel("order [cycles per input turn]")
    _label(axes[1, 2], "torque over torsion (shaded part)", "output torque [N·m]")
    axes[1, 2].set_xlabel("torsion [arcmin]")
    handles, names = axes[0, 0].get_legend_handles_labels()
    if any(names):
        figure.legend(
            handles, names, loc="outside upper right", ncols=min(6, len(names))
        )
    figure.suptitle(short(joint), x=0.01, ha="left", fontsize=12)
    return png(figure, dpi=95)


def plot_over_time(
    axis: Any, time: NDArray[np.float64], values: NDArray[np.float64], **style: Any
) -> None:
    """Draw a line with all its peaks, but no more points than the picture can show.

    Args:
        axis: Axes to draw on.
        time: Increasing times [s]. Shape (n,).
        values: Values of the line. Shape (n,).
        style: Keyword arguments of ``axis.plot``.
    """
    axis.plot(*envelope(time, values), **style)


def envelope(
    x: NDArray[np.float64], y: NDArray[np.float64], columns: int = _COLUMNS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reduce a signal to the minimum and maximum of each of its pieces.

    The first and the last sample are kept as well.

    Args:
        x: Increasing abscissas. Shape (n,).
        y: Values. Shape (n,).
        columns: Number of pieces of equal length; a signal of up to twice as many
            samples is returned unchanged.

    Returns:
        Abscissas and values of the kept samples in their original sequence.
    """
    if y.size <= 2 * columns:
        return x, y
    edges = np.linspace(0, y.size, columns + 1).astype(np.intp)
    keep = [0, y.size - 1]
    for low, high in pairwise(edges):
        piece = y[low:high]
        keep += [int(low + piece.argmin()), int(low + piece.argmax())]
    rows = np.unique(keep)
    return x[rows], y[rows]


def _label(axis: Any, title: str, y: str) -> None:
    axis.set_title(title, fontsize=10)
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)

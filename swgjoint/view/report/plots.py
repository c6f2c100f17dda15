"""Pictures of the report: one per joint, with all runs in every panel."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
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
_MARGINS = {"left": 0.068, "right": 0.988, "bottom": 0.085}
_LEGEND_COLUMNS, _LEGEND_ROW = 6, 0.035
"""Names per row of the legend, and the height of a row as a part of the figure."""


def joint_pngs(runs: Mapping[str, Run], joints: Iterable[str]) -> Iterator[bytes]:
    """Draw the torque, torsion, error and ripple of joints, one picture per joint.

    The upper panels show the output torque, the torsion and the transmission error over
    time. The lower panels show the torque ripple, its order spectrum, and the torque
    over the torsion. Next to other runs, a rigid run appears only in the torque panel.

    Args:
        runs: Runs of one motion by name.
        joints: Names of the joints.

    Yields:
        The PNG files in the order of the joints.
    """
    styles = _styles(runs)
    first = next(iter(runs.values()))
    figure, axes = _panels(styles, first.time[first.steady][[0, -1]])
    for joint in joints:
        # the panels and their ticks are drawn again with other lines, because making
        # them takes a quarter of the time of a picture
        for axis in axes.flat:
            for line in axis.get_lines():
                line.remove()
            axis.relim()
            axis.autoscale()
        _draw_joint(axes, runs, first.joints.index(joint), styles)
        for axis in axes.flat:
            if not axis.get_lines():
                axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
        figure.suptitle(short(joint), x=0.01, y=0.99, ha="left", fontsize=12)
        yield png(figure, dpi=95)


def _styles(runs: Mapping[str, Run]) -> dict[str, dict[str, Any]]:
    styles = {}
    for k, label in enumerate(runs):
        color = tuple(c / 255 for c in COLORS[k % len(COLORS)])
        dash = "-" if k < len(COLORS) else "--"
        styles[label] = {"color": color, "ls": dash, "lw": 0.9, "label": label}
    return styles


def _panels(
    styles: Mapping[str, dict[str, Any]], steady: NDArray[np.float64]
) -> tuple[Any, Any]:
    """Figure and panels with everything but the lines.

    The panels have fixed positions, with space for labels of up to seven characters:
    they are aligned from joint to joint, and a layout that measures the labels takes a
    third of the time of a picture.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(13.0, 6.2))
    rows = -(-len(styles) // _LEGEND_COLUMNS)
    top = 0.94 - _LEGEND_ROW * rows
    axes = figure.subplots(
        2, 3, gridspec_kw={**_MARGINS, "top": top, "wspace": 0.25, "hspace": 0.33}
    )
    for axis in axes.flat:
        axis.ticklabel_format(scilimits=(-2, 4))
    for axis in axes[0]:
        axis.axvspan(*steady, color="0.94", zorder=0)
        axis.set_xlabel("time [s]   (shaded: used for the figures)")
        axis.margins(x=0)
    _label(axes[0, 0], "output torque", "output torque [N·m]")
    _label(axes[0, 1], "torsion", "torsion [arcmin]")
    _label(axes[0, 2], "transmission error", "output − ideal output [arcmin]")
    title = "torque ripple, last half input turn"
    _label(axes[1, 0], title, "ripple [% of rated torque]")
    axes[1, 0].set_xlabel("input turns")
    _label(axes[1, 1], "order spectrum of the ripple", "amplitude [% of rated torque]")
    axes[1, 1].set_xlabel("order [cycles per input turn]")
    _label(axes[1, 2], "torque over torsion (shaded part)", "output torque [N·m]")
    axes[1, 2].set_xlabel("torsion [arcmin]")
    if any(styles):
        handles = [Line2D([], [], **style) for style in styles.values()]
        columns = min(_LEGEND_COLUMNS, len(styles))
        figure.legend(handles=handles, loc="upper right", ncols=columns)
    return figure, axes


def _draw_joint(
    axes: Any, runs: Mapping[str, Run], j: int, styles: Mapping[str, dict[str, Any]]
) -> None:
    """Draw the lines of one joint, given by its index."""
    for label, run in runs.items():
        style = styles[label]
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
    low, high = edges[:-1], edges[1:]
    # all pieces as rows; the last sample of a shorter one is repeated
    samples = low[:, None] + np.arange((high - low).max())
    pieces = y[np.minimum(samples, high[:, None] - 1)]
    extremes = [low + pieces.argmin(axis=1), low + pieces.argmax(axis=1)]
    rows = np.unique(np.concatenate([[0, y.size - 1], *extremes]))
    return x[rows], y[rows]


def _label(axis: Any, title: str, y: str) -> None:
    axis.set_title(title, fontsize=10, y=1.0)  # not placed by measuring
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)

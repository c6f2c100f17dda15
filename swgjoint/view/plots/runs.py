"""Picture that compares runs of the same motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.files import write_whole
from swgjoint.pictures import png
from swgjoint.sim.figures.metrics import (
    highest_resolved_order,
    strongest_left_out,
    torque_ripple,
)
from swgjoint.sim.figures.orders import order_spectrum
from swgjoint.units import arcmin, mm
from swgjoint.view.recording.blueprint import is_rigid, joints_by_interest
from swgjoint.view.recording.entities import COLORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swgjoint.sim.run import Run


def comparison_png(
    runs: Mapping[str, Run], path: str | Path, *, rigid: Run | None = None
) -> Path:
    """Write the picture of :func:`comparison_figure` as a PNG file.

    Args:
        runs: Runs by name.
        path: PNG file to write.
        rigid: Run of the rigid arm to which tool errors refer; None for the commanded
            path.

    Returns:
        The path.
    """
    return write_whole(path, png(comparison_figure(runs, rigid=rigid), dpi=110))


def comparison_figure(runs: Mapping[str, Run], *, rigid: Run | None = None) -> Figure:
    """Draw torsion, transmission error, ripple with its orders, and tool error of runs.

    Torsion, error and ripple are those of the joint with the largest torque deviation
    [N·m] among those whose strongest order is resolved. The bars show all joints.
    Rigid runs are omitted if another run is not rigid.

    Args:
        runs: Runs by name.
        rigid: Run of the rigid arm to which tool errors refer; None for the commanded
            path.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    first = next(iter(runs.values()))
    joint = joints_by_interest(runs)[0]
    j = first.joints.index(joint)
    shown = {label: run for label, run in runs.items() if not is_rigid(run)} or runs
    colors = {
        label: tuple(c / 255 for c in COLORS[k % len(COLORS)])
        for k, label in enumerate(runs)
    }
    figure = Figure(figsize=(13.0, 10.5), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 2)
    for label, run in shown.items():
        style: dict[str, Any] = {"color": colors[label], "label": label, "lw": 1.0}
        axes[0, 0].plot(run.time, run.torsion[:, j] / arcmin, **style)
        axes[0, 1].plot(run.time, run.transmission_error[:, j] / arcmin, **style)
        draw_ripple(axes[1, 0], axes[1, 1], run, j, style)
        if run.tool_position.shape[1]:
            axes[2, 0].plot(run.time, run.tool_error(rigid) / mm, **style)
    _bars(axes[2, 1], shown, colors)

    name = joint.removesuffix("_joint")
    steady = first.time[first.steady][[0, -1]]
    for axis in (axes[0, 0], axes[0, 1], axes[2, 0]):
        axis.axvspan(*steady, color="0.94", zorder=0)
        axis.set_xlabel("time [s]   (shaded: used for the figures)")
        axis.margins(x=0)
    _label(axes[0, 0], f"{name}: torsion", "torsion [arcmin]")
    _label(axes[0, 1], f"{name}: transmission error", "output − ideal output [arcmin]")
    _label(axes[1, 0], f"{name}: torque ripple", "ripple [% of rated torque]")
    axes[1, 0].set_xlabel("input turns")
    _label(
        axes[1, 1],
        f"{name}: order spectrum of the ripple",
        "amplitude [% of rated torque]",
    )
    axes[1, 1].set_xlabel("order [cycles per input turn]")
    against = "that of the rigid arm" if rigid is not None else "the commanded path"
    _label(axes[2, 0], f"tool: distance from {against}", "distance [mm]")
    _label(axes[2, 1], "all joints: torque ripple", "peak to peak [% of rated torque]")
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper right", ncols=len(names))
    figure.suptitle(f"scene {first.assembly.scene.name}", fontsize=13)
    return figure


def draw_ripple(
    over_turns: Any,
    over_order: Any,
    run: Run,
    j: int,
    style: Mapping[str, Any],
    *,
    line: Callable[..., Any] | None = None,
) -> None:
    """Draw the ripple over the last half turn of the input, and its order spectrum.

    No spectrum is drawn for a joint without constant speed or with less than half an
    input turn.

    Args:
        over_turns: Axes of the ripple, in percent of rated torque.
        over_order: Axes of the spectrum, in percent of rated torque.
        run: The run.
        j: Index of the joint.
        style: Keyword arguments of the lines.
        line: Function that draws the spectrum; it takes the axes and then the arguments
            of their ``plot`` method, which is the default.
    """
    transmission = run.assembly.transmissions[j]
    scale = 100.0 / transmission.drive.ratings.rated_torque
    angle = run.motor_position[run.steady, j]
    ripple = scale * torque_ripple(run, j)
    turns = np.abs(angle - angle[0]) / (2.0 * np.pi)
    part = turns >= turns[-1] - 0.5  # half a turn is short enough to show single teeth
    over_turns.plot(turns[part], ripple[part], **style)
    over_turns.margins(x=0)
    draw_orders(over_order, run, j, style, line=line)


def draw_orders(
    axis: Any,
    run: Run,
    j: int,
    style: Mapping[str, Any],
    *,
    line: Callable[..., Any] | None = None,
) -> None:
    """Draw the order spectrum of the ripple up to the highest order that is resolved.

    Nothing is drawn for a joint without constant speed or with less than half an input
    turn.

    Args:
        axis: Axes of the spectrum, in percent of rated torque.
        run: The run.
        j: Index of the joint.
        style: Keyword arguments of the line.
        line: Function that draws the spectrum; it takes the axes and then the arguments
            of their ``plot`` method, which is the default.
    """
    scale = 100.0 / run.assembly.transmissions[j].drive.ratings.rated_torque
    angle = run.motor_position[run.steady, j]
    spectrum = order_spectrum(angle, scale * torque_ripple(run, j))
    highest = highest_resolved_order(run, j)
    if spectrum is None or highest is None:
        return
    inside = (spectrum.order >= 0.5) & (spectrum.order <= highest)
    draw = axis.plot if line is None else partial(line, axis)
    axis.autoscale(axis="y")  # after the limit of another run
    draw(spectrum.order[inside], spectrum.amplitude[inside], **style)
    axis.set_xlim(0.0, highest)
    axis.set_ylim(bottom=0.0)


def _bars(axis: Any, runs: Mapping[str, Run], colors: Mapping[str, Any]) -> None:
    """Draw the peak-to-peak torque ripple of all joints, one bar per run."""
    first = next(iter(runs.values()))
    width = 0.8 / len(runs)
    ticks = []
    for j, joint in enumerate(first.joints):
        left_out = any(
            strongest_left_out(run.assembly.transmissions[j]) for run in runs.values()
        )
        name = joint.removesuffix("_joint").replace("_", " ")
        ticks.append(f"{name} *" if left_out else name)
    for k, (label, run) in enumerate(runs.items()):
        heights = [
            100.0
            * float(np.ptp(torque_ripple(run, j)))
            / run.assembly.transmissions[j].drive.ratings.rated_torque
            for j in range(len(run.joints))
        ]
        places = np.arange(len(heights)) + (k - 0.5 * (len(runs) - 1)) * width
        axis.bar(places, heights, width, color=colors[label], label=label)
    axis.set_xticks(range(len(ticks)), ticks, fontsize=8)
    if any(tick.endswith("*") for tick in ticks):
        why = "the joint turns too fast for the step"
        axis.set_xlabel(f"* strongest order left out: {why}")


def _label(axis: Any, title: str, y: str) -> None:
    axis.set_title(title, fontsize=10, y=1.0)  # not placed by measuring
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)

"""Overview of one run as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.maps.sheet.validity_marks import NOT_VALID, UNCERTAIN, joint_mark
from swgjoint.pictures import png
from swgjoint.units import arcmin, mm
from swgjoint.view.plots.runs import draw_orders
from swgjoint.view.recording.blueprint import joints_by_interest
from swgjoint.view.report.plots import plot_over_time
from swgjoint.view.words import short

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

MOST = 8
"""Largest number of joints with a line of their own; more lines could not be told
apart."""
ROW = 80
"""Number of characters of the names below the bars of all joints that fit in a line."""
FINEST = 1e-3
"""Smallest height of an axis in its own unit (%, arcmin, mm): a finer one would show
rounding errors as if they were results."""


def run_png(run: Run) -> bytes:
    """Draw torque, torsion, errors and torque ripple of all joints of a run.

    Torque, torsion and transmission error are drawn for the :data:`MOST` joints with
    the largest torque deviation, and the spectrum for that with the largest ripple. The
    bars repeat the figures of the printed table, with the same marks.

    Args:
        run: The run.

    Returns:
        The PNG file.
    """
    from matplotlib.figure import Figure

    order = joints_by_interest({"": run})
    shown = [name for name in run.joints if name in order[:MOST]]
    figure = Figure(figsize=(13.0, 10.0), layout="constrained")
    axes = figure.subplots(3, 2)
    colors = {name: f"C{k}" for k, name in enumerate(shown)}
    for name, color in colors.items():
        j = run.joints.index(name)
        rated = run.assembly.transmissions[j].drive.ratings.rated_torque
        style: dict[str, Any] = {"color": color, "lw": 0.9, "label": short(name)}
        torque = 100.0 * run.output_torque[:, j] / rated
        plot_over_time(axes[0, 0], run.time, torque, **style)
        plot_over_time(axes[0, 1], run.time, run.torsion[:, j] / arcmin, **style)
        error = run.transmission_error[:, j] / arcmin
        plot_over_time(axes[1, 0], run.time, error, **style)
    if run.tool_position.shape[1]:
        style = {"color": "0.2", "lw": 0.9}
        plot_over_time(axes[1, 1], run.time, run.tool_error() / mm, **style)
    else:
        _absent(axes[1, 1], "the arm has no tool")
    _label(axes[0, 0], "output torque", "output torque [% of rated torque]")
    _label(axes[0, 1], "torsion", "torsion [arcmin]")
    _label(axes[1, 0], "transmission error", "output − ideal output [arcmin]")
    _label(axes[1, 1], "tool: distance from the commanded path", "distance [mm]")
    low, high = run.time[run.steady][[0, -1]]
    for axis in axes[:2].flat:
        bottom, top = axis.get_ylim()
        if top - bottom < FINEST:
            middle = 0.5 * (bottom + top)
            axis.set_ylim(middle - 0.5 * FINEST, middle + 0.5 * FINEST)
        axis.ticklabel_format(axis="y", useOffset=False)
        axis.axvspan(low, high, color="0.94", zorder=0)
        axis.set_xlabel("time [s]   (shaded: used for the figures)")
        axis.margins(x=0)
    _ripple_bars(axes[2, 0], run)
    metrics = run.figures
    _spectrum(axes[2, 1], run, metrics["joints"], colors)
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper right", ncols=min(4, len(names)))
    title = f"scene {run.name}: {metrics['verdict']}{_rest(run)}"
    figure.suptitle(title, x=0.01, ha="left")
    return png(figure, dpi=95)


def _ripple_bars(axis: Any, run: Run) -> None:
    """Draw the ripple of every joint, peak to peak and rms, with marks above the bars.

    A joint without a value gets a dash.
    """
    joints = run.figures["joints"]
    places = np.arange(len(joints))
    kinds = {"ripple_pp_percent": "peak to peak", "ripple_rms_percent": "rms"}
    heights = [
        [0.0 if joint["ripple_missing"] else joint[key] for joint in joints.values()]
        for key in kinds
    ]
    for values, label, offset, color in zip(
        heights, kinds.values(), (-0.2, 0.2), ("0.35", "0.7"), strict=True
    ):
        axis.bar(places + offset, values, 0.4, color=color, label=label)
    marks = {joint_mark(joint) for joint in joints.values()}
    for place, joint, height in zip(places, joints.values(), heights[0], strict=True):
        bound = ">" if joint["ripple_is_lower_bound"] else ""
        text = "-" if joint["ripple_missing"] else f"{joint_mark(joint)}{bound}"
        axis.annotate(
            text, (place, height), (0, 2), textcoords="offset points", ha="center"
        )
    many = len(joints) > MOST
    names = [short(name) for name in joints]
    if not many:
        # long names take several lines, so that they do not overlap
        width = ROW // max(len(joints), 1)
        names = [fill(name, width, break_long_words=False) for name in names]
    if not any(heights[0]):
        axis.set_ylim(top=1.0)
    axis.set_xticks(places, names, fontsize=8, rotation=90 if many else 0)
    axis.margins(y=0.12)
    axis.set_ylim(bottom=0.0)
    axis.legend(fontsize="small")
    _label(axis, "output torque ripple", "ripple [% of rated torque]")
    meanings = {">": "lower bound", UNCERTAIN: "uncertain", NOT_VALID: "not valid"}
    if any(joint["ripple_is_lower_bound"] for joint in joints.values()):
        marks.add(">")
    axis.set_xlabel(
        "   ".join(f"{sign} {text}" for sign, text in meanings.items() if sign in marks)
    )


def _spectrum(
    axis: Any, run: Run, joints: Mapping[str, Any], colors: Mapping[str, str]
) -> None:
    """Draw the order spectrum of the joint with the largest ripple in % of rated."""
    ripples = {
        name: joint["ripple_pp_percent"]
        for name, joint in joints.items()
        if not joint["ripple_missing"]
    }
    title = "orders of the output torque ripple"
    if not ripples:
        _absent(axis, "no joint has a ripple: the run names the reason")
    else:
        worst = max(ripples, key=lambda name: float(ripples[name]))
        title += f": {short(worst)}"
        style = {"color": colors.get(worst, "0.2"), "lw": 0.9}
        draw_orders(axis, run, run.joints.index(worst), style)
        if not axis.lines:
            _absent(axis, "no half turn of the input at constant speed")
    _label(axis, title, "amplitude [% of rated torque]")
    axis.set_xlabel("order [cycles per input turn]")


def _absent(axis: Any, reason: str) -> None:
    """Show the reason why a panel has no line."""
    axis.text(0.5, 0.5, reason, ha="center", va="center", transform=axis.transAxes)


def _rest(run: Run) -> str:
    """Say how many joints have no line, if any."""
    count = len(run.joints)
    return f" ({MOST} of {count} joints have lines)" if count > MOST else ""


def _label(axis: Any, title: str, y: str) -> None:
    axis.set_title(title, fontsize=10)
    axis.set_ylabel(y)
    axis.grid(alpha=0.3)

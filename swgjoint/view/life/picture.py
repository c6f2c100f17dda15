"""Picture of the loads and the life over a duty cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import png
from swgjoint.units import rpm
from swgjoint.view.words import LASTING, short

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


SHOWN = 1e3
"""Largest shown life, relative to the shortest [-]."""


def life_picture(run: Run) -> bytes:
    """Draw torque and input speed over one cycle, and the life of every drive.

    Every task is drawn once, and rests are left out.

    Args:
        run: A run with a duty cycle.

    Returns:
        The PNG file.
    """
    from matplotlib.figure import Figure

    metrics = run.figures
    figure = Figure(figsize=(13.0, 6.0), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(2.2, 1.0))
    torque = figure.add_subplot(grid[0, 0])
    speed = figure.add_subplot(grid[1, 0], sharex=torque)
    for j, joint in enumerate(run.joints):
        rated = metrics["joints"][joint]["ratings"]["rated_Nm"]
        style: dict[str, Any] = {"color": f"C{j % 10}", "lw": 0.9}
        begin = 0.0
        for task in (task for task in run.cycle if not task.rest):
            time = begin + np.linspace(0.0, task.duration, len(task.torque))
            label = short(joint) if not begin else None
            torque.plot(time, task.torque[:, j] / rated, label=label, **style)
            rate = np.abs(task.input_speed[:, j]) / rpm
            speed.plot(time, rate, **style)
            begin += task.duration
    _mark_tasks(torque, run)
    torque.set_ylabel("output torque / rated torque")
    torque.axhline(1.0, color="0.5", ls=":", lw=0.8)
    torque.legend(fontsize=8, ncols=3, loc="lower right")
    speed.set_ylabel("input speed [rpm]")
    speed.set_xlabel("time, every task once, without rests [s]")
    _draw_lives(figure.add_subplot(grid[:, 1]), metrics["joints"])
    return png(figure, dpi=110)


def _mark_tasks(axis: Any, run: Run) -> None:
    """Name the tasks along the top, with their number of occurrences."""
    begin = 0.0
    for task in (task for task in run.cycle if not task.rest):
        times = f" ×{task.times}" if task.times > 1 else ""
        axis.axvline(begin, color="0.8", lw=0.8, zorder=0)
        axis.text(
            begin + 0.5 * task.duration,
            1.01,
            f"{task.name}{times}",
            transform=axis.get_xaxis_transform(),
            ha="center",
            fontsize=8,
        )
        begin += task.duration
    axis.set_xlim(0.0, begin)


def _draw_lives(axis: Any, joints: dict[str, Any]) -> None:
    """Bars of L50, L10 and the life of the flexspline by joint."""
    names = list(joints)
    lives = [joints[name]["life"] for name in names]
    series = (
        ("bearing, L50", [life["bearing"]["L50_h"] for life in lives]),
        ("bearing, L10", [life["bearing"]["L10_h"] for life in lives]),
        ("flexspline", [life["flexspline"]["life_h"] for life in lives]),
    )
    known = [one for one in series if any(value is not None for value in one[1])]
    height = 0.8 / max(len(known), 1)
    for k, (label, values) in enumerate(known):
        at = [n + (k - 0.5 * (len(known) - 1)) * height for n in range(len(names))]
        shown = [(y, value) for y, value in zip(at, values, strict=True) if value]
        axis.barh(
            [y for y, _ in shown],
            [value for _, value in shown],
            height,
            label=label,
            color=f"C{k}",
        )
    axis.set_yticks(range(len(names)), [short(name) for name in names])
    axis.invert_yaxis()
    axis.set_xlabel("life [h]")
    lasting = [value for _, values in known for value in values if value]
    if lasting:
        shortest, longest = min(*lasting, LASTING), max(lasting)
        last = min(3.0 * longest, SHOWN * shortest, 3.0 * LASTING)
        axis.set_xscale("log")
        axis.set_xlim(0.3 * shortest, last)
        axis.legend(fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
        if longest > last:
            axis.set_xlabel("life [h], the longest bars are cut off")

"""Picture of a search for designs: Pareto front, course of the search, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import png
from swgjoint.view.plots.sweep import label_of

if TYPE_CHECKING:
    from swgjoint.explore.optimise.front import Candidate
    from swgjoint.explore.optimise.optimise import Optimum
    from swgjoint.explore.sweep.plan import Parameter

Axes = Any  # matplotlib is imported only when a picture is drawn


def optimum_picture(optimum: Optimum) -> bytes:
    """Draw the Pareto front, the best values so far, and front parameters as PNG."""
    from matplotlib.figure import Figure

    canvas = Figure(figsize=(16.0, 5.4), layout="constrained")
    front, course, values = canvas.subplots(1, 3)
    _front(front, optimum)
    _course(course, optimum)
    _values(values, optimum)
    canvas.suptitle(optimum.file.description or "search", fontsize=11)
    return png(canvas, dpi=100)


def _figures(candidates: Sequence[Candidate], name: str, *, confirmed: bool) -> Any:
    """Values of one figure for several designs; NaN if a design has no value."""
    values = []
    for candidate in candidates:
        record = candidate.confirmed if confirmed else candidate.record
        value = None if record is None else record.figures.get(name)
        values.append(np.nan if value is None else value)
    return np.array(values)


def _front(axis: Axes, optimum: Optimum) -> None:
    """Draw the first two objectives, or a single one over the number of the design."""
    names = [o.figure for o in optimum.file.objectives]

    def places(candidates: Sequence[Candidate], *, confirmed: bool) -> tuple[Any, Any]:
        first = _figures(candidates, names[0], confirmed=confirmed)
        if len(names) == 1:
            return np.arange(len(candidates)), first
        return first, _figures(candidates, names[1], confirmed=confirmed)

    x, y = places(optimum.tried, confirmed=False)
    axis.plot(x, y, ".", color="0.75", ms=4, label="evaluated designs")
    if len(names) > 1:
        x, y = places(optimum.front, confirmed=False)
        axis.plot(x, y, "o-", color="tab:blue", ms=5, lw=1.0, label="Pareto front")
        axis.plot(
            *places(optimum.front, confirmed=True),
            "o",
            mfc="none",
            color="tab:red",
            ms=9,
            label="Pareto front, confirmed",
        )
        rivals = (optimum.start, *optimum.beside)
        for rival, mark in zip(rivals, cycle("sD^vP*X"), strict=False):
            name = rival.values["design"]
            there = places([rival], confirmed=False)
            axis.plot(*there, mark, color="black", ms=8, label=name)
            there = places([rival], confirmed=True)
            axis.plot(*there, mark, mfc="none", color="tab:red", ms=11)
        _view(axis, optimum, names)
    axis.set_xlabel(label_of(names[0]) if len(names) > 1 else "evaluated designs")
    axis.set_ylabel(label_of(names[min(1, len(names) - 1)]))
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    goals = ", ".join(
        f"{label_of(o.figure)}: {o.goal}" for o in optimum.file.objectives
    )
    axis.set_title(goals, fontsize=9)


def _view(axis: Axes, optimum: Optimum, names: Sequence[str]) -> None:
    """Limit the axes to the front, the start design and the compared designs."""
    near = [*optimum.front, optimum.start, *optimum.beside]
    for name, limit in zip(names[:2], (axis.set_xlim, axis.set_ylim), strict=True):
        values = np.concatenate(
            [_figures(near, name, confirmed=c) for c in (False, True)]
        )
        low, high = np.nanmin(values), np.nanmax(values)
        margin = 0.15 * (high - low) or 0.05 * abs(high) or 1.0
        limit(low - margin, high + margin)


def _course(axis: Axes, optimum: Optimum) -> None:
    """Draw the best value so far of every objective, relative to the start design."""
    for objective in optimum.file.objectives:
        values = _figures(optimum.tried, objective.figure, confirmed=False)
        kept = [
            c.record.ok and not any(optimum.file.violations(c.record.figures).values())
            for c in optimum.tried
        ]
        signed = np.where(kept, objective.sign * values, np.inf)
        best = objective.sign * np.fmin.accumulate(signed)
        first = optimum.start.record.figures.get(objective.figure)
        there = np.isfinite(best)
        if first:
            best = best / first
        axis.step(
            1 + np.flatnonzero(there),
            best[there],
            where="post",
            label=label_of(objective.figure),
        )
    axis.axhline(1.0, color="black", lw=0.8)
    axis.set_xlabel("number of evaluated designs")
    axis.set_ylabel("best value so far / value of the start design")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)


def _values(axis: Axes, optimum: Optimum) -> None:
    """Draw the parameters of the front designs, relative to their ranges.

    The colour shows the first objective.
    """
    import matplotlib

    parameters = optimum.file.plan.parameters
    first = optimum.file.objectives[0]
    height = first.sign * _figures(optimum.front, first.figure, confirmed=False)
    scale = matplotlib.colors.Normalize(height.min(), height.max())
    colours = matplotlib.colormaps["viridis"]
    places = range(len(parameters))
    for candidate, value in zip(optimum.front, height, strict=True):
        parts = [_part(p, candidate.values[p.column]) for p in parameters]
        axis.plot(parts, places, "o-", color=colours(scale(value)), lw=0.9, ms=4)
    labels = []
    for parameter in parameters:
        if parameter.values is None:
            labels.append(
                f"{label_of(parameter.column)}\n{parameter.low:g} to {parameter.high:g}"
            )
        else:
            labels.append(label_of(parameter.column))
    axis.set_yticks(range(len(labels)), labels, fontsize=8)
    axis.set_xlim(-0.05, 1.05)
    axis.set_xlabel("position in the range (dark: best first objective)")
    axis.grid(alpha=0.3)


def _part(parameter: Parameter, value: Any) -> float:
    """Position of a value in its range or list, from 0 to 1."""
    if parameter.values is not None:
        return parameter.values.index(value) / max(len(parameter.values) - 1, 1)
    assert parameter.low is not None and parameter.high is not None
    return float((value - parameter.low) / (parameter.high - parameter.low))

"""Result of a tuning run as a picture, as text and as an HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.files import Outputs
from swgjoint.json_text import json_text
from swgjoint.pictures import png
from swgjoint.view.report.report import write_tables
from swgjoint.view.report.tables import Cell, Table
from swgjoint.view.words import format_figure

if TYPE_CHECKING:
    from swgjoint.explore.tune.result import GainCandidate, Tuned

COLORS = ("0.45", "C1", "C2", "C0")
"""Colours of the candidates; the baseline has the first one, the tuned controller the
last one."""
_SAME = 0.05  # percentage that one decimal shows as zero
_FACTOR = 2.0  # from here on a ratio is shown as a factor
_ROOM = 1.25  # smallest ratio of the ends of an axis to the costs it shows


def claims(tuned: Tuned) -> list[str]:
    """Findings of a tuning run, one line each; costs are mean ± standard deviation."""
    baseline, best, unit = tuned.baseline, tuned.best, tuned.unit
    better = int((best.held_out < baseline.held_out).sum())
    count = best.held_out.size
    lines = [
        f"{best.name}: cost {_cost(tuned, best)} on {count} held-out seeds,"
        f" {_compared(tuned, best)} {baseline.name} ({_cost(tuned, baseline)}),"
        f" lower on {better} of them"
    ]
    for one in tuned.candidates[1:-1]:
        if one.tuned:
            lines.append(
                f"tuning the two gains of PD alone: {_cost(tuned, one)},"
                f" {_compared(tuned, one)} {baseline.name}"
            )
            continue
        lines.append(
            f"{one.name}: {_cost(tuned, one)}, {_compared(tuned, one)} {baseline.name};"
            f" after tuning {_ratio(best.held_out.mean() / one.held_out.mean())} this"
        )
    wide = best.held_out.mean() / best.training.mean() - 1.0
    lines.append(
        f"{best.name}: cost {best.training.mean() / tuned.unit_size:.3g} {unit} on the"
        f" training seeds, {abs(100 * wide):.0f} % {'higher' if wide > 0 else 'lower'}"
        " on the held-out seeds"
    )
    for one in tuned.candidates:
        if one.broken:
            lines.append(
                f"{one.name}: exceeds a limit in {one.broken} of {count} held-out"
                " episodes"
            )
    if search := tuned.searches.get("named"):
        costs = np.concatenate(search.costs)
        if np.ptp(costs, axis=0).max() == 0.0:
            lines.append(f"{best.controller}: no parameter changes any cost")
    at_bound = [
        p.key for p in tuned.parameters if not 0.01 < p.place(best.values[p.key]) < 0.99
    ]
    if at_bound:
        lines.append(f"parameters at a bound of the search: {', '.join(at_bound)}")
    return lines


def write_files(tuned: Tuned, folder: Path) -> list[str]:
    """Write ``tune.png``, ``tune.json`` and ``report.html``.

    Args:
        tuned: Result of the tuning run.
        folder: Folder of the files.

    Returns:
        Paths of the written files.
    """
    outputs, pictures = Outputs(folder), {}

    def drawn() -> bytes:
        png = picture(tuned)
        pictures["Search, held-out seeds and one episode"] = png
        return png

    outputs.write("tune.png", drawn)
    outputs.write("tune.json", lambda: json_text(tuned.to_json()) + "\n")
    outputs.hand_over(
        "report.html",
        lambda path: write_tables(
            path,
            title=f"Tuning of {tuned.best.controller} in {tuned.environment}",
            description="; ".join(claims(tuned)) + ".",
            tables=[_summary(tuned), _gains(tuned), _by_seed(tuned)],
            pictures=pictures,
            settings={
                "Run": json_text(
                    {k: v for k, v in tuned.to_json().items() if k != "candidates"}
                )
            },
        ),
    )
    return outputs.files


def picture(tuned: Tuned) -> bytes:
    """Draw the searches, the cost of every held-out seed and one episode as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 7.5), layout="constrained")
    axes = figure.subplots(2, 2)
    _draw_search(axes[0, 0], tuned)
    _draw_seeds(axes[0, 1], tuned)
    _draw_episode(axes[1], tuned)
    return png(figure, dpi=110)


def _draw_search(ax: Any, tuned: Tuned) -> None:
    colored = _colored(tuned)
    searched = [pair for pair in colored if pair[0].tuned]
    for (one, color), search in zip(searched, tuned.searches.values(), strict=True):
        best = search.progress() / tuned.unit_size
        ax.step(np.arange(1, best.size + 1), best, where="post", color=color)
        ax.plot([], [], color=color, label=f"{one.controller}, best so far")
    for one, color in colored:
        if not one.tuned:
            level = one.training.mean() / tuned.unit_size
            ax.axhline(level, color=color, ls="--", lw=1.0, label=one.name)
    ax.set(
        yscale="log",
        xlabel="number of evaluated candidates",
        ylabel=f"mean cost [{tuned.unit}]",
        title=f"search on {tuned.settings.training} training seeds",
    )
    # an axis fitted to equal costs would show their rounding errors
    low, high = ax.get_ylim()
    if high < _ROOM * low:
        ax.set_ylim(low / _ROOM, high * _ROOM)
    _plain_ticks(ax)
    ax.legend()


def _draw_seeds(ax: Any, tuned: Tuned) -> None:
    seeds = tuned.settings.seeds[1]
    for one, color in _colored(tuned):
        cost = one.held_out / tuned.unit_size
        ax.plot(seeds, cost, "o", ms=5, color=color, label=one.name)
        ax.axhline(cost.mean(), color=color, lw=1.0)
    ax.set(
        yscale="log",
        xlabel="seed",
        ylabel=f"cost [{tuned.unit}]",
        title="cost on held-out seeds (lines: means)",
    )
    costs = np.concatenate([one.held_out for one in tuned.candidates])
    low, high = np.array([costs.min(), costs.max()]) / tuned.unit_size
    # leave a share of the height for the legend above the points
    ax.set_ylim(low / _ROOM, high * _ROOM * (high / low) ** 0.3 * _ROOM)
    ax.ticklabel_format(axis="x", useOffset=False)
    _plain_ticks(ax)
    ax.legend(loc="upper center", ncols=2)


def _draw_episode(axes: Any, tuned: Tuned) -> None:
    """Draw the held-out episode in which the baseline has its median cost."""
    order = np.argsort(tuned.baseline.held_out)
    k = int(order[order.size // 2])
    seed = tuned.settings.seeds[1][k]
    for one, color in ((tuned.baseline, COLORS[0]), (tuned.best, COLORS[3])):
        trace = one.trace
        style = {"color": color, "lw": 1.0, "label": one.name}
        axes[0].plot(trace.time, trace.error[:, k] / tuned.unit_size, **style)
        axes[1].plot(trace.time, trace.torque[:, k], **style)
    what = "tool error" if tuned.unit == "mm" else "link angle minus reference"
    axes[0].set(ylabel=f"{what} [{tuned.unit}]", title=f"seed {seed}: error")
    first = " of the first joint" if tuned.unit == "mm" else ""
    axes[1].set(
        ylabel="motor torque [N·m]",
        title=f"seed {seed}: motor torque and reference{first}",
    )
    other = axes[1].twinx()
    trace = tuned.best.trace
    other.plot(trace.time, np.degrees(trace.reference[:, k]), color="0.75", lw=1.0)
    other.set_ylabel("reference of the link angle [deg] (grey)")
    for ax in axes:
        ax.set_xlabel("time [s]")
        ax.margins(x=0)
        ax.legend()


def _plain_ticks(ax: Any) -> None:
    """Label a short logarithmic axis with plain numbers instead of powers of ten."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid(axis="y", color="0.92")


def _colored(tuned: Tuned) -> list[tuple[GainCandidate, str]]:
    colors = (COLORS[0], *COLORS[1:-1][-(len(tuned.candidates) - 2) :], COLORS[-1])
    if len(tuned.candidates) == 2:
        colors = (COLORS[0], COLORS[-1])
    return list(zip(tuned.candidates, colors, strict=True))


def _summary(tuned: Tuned) -> Table:
    rows = []
    for one in tuned.candidates:
        costs = [one.held_out.mean(), one.held_out.std(ddof=1), one.training.mean()]
        saved = 100.0 * tuned.improvement(one)
        rows.append(
            [
                Cell(one.name, "text"),
                *[Cell(format_figure(float(x / tuned.unit_size))) for x in costs],
                Cell("-" if one is tuned.baseline else f"{saved:.1f}"),
                Cell(str(one.broken)),
            ]
        )
    s = tuned.settings
    plant = ", ".join(f"{k} {v}" for k, v in tuned.to_json()["arguments"].items())
    return Table(
        header=[
            ("controller", ""),
            ("cost, held-out seeds", tuned.unit),
            ("standard deviation", tuned.unit),
            ("cost, training seeds", tuned.unit),
            (f"reduction relative to {tuned.baseline.name}", "%"),
            ("held-out episodes that exceed a limit", f"of {s.held_out}"),
        ],
        rows=rows,
        notes=[
            "The cost of an episode is s times the square root of the mean of q + w u,"
            " where 1/(1 + q) - w u is the reward, with"
            f" s = {tuned.error_scale / tuned.unit_size:g} {tuned.unit} and"
            f" w = {tuned.effort_weight:g}. It is at most"
            f" {tuned.worst / tuned.unit_size:.0f} {tuned.unit}.",
            _on_baseline(tuned),
            f"Settings of the environment: {plant}."
            f" Optimiser {s.optimiser}, seed {s.seed},"
            f" {sum(x.evaluations for x in tuned.searches.values())} candidates,"
            f" {tuned.wall:.0f} s.",
        ],
    )


def _on_baseline(tuned: Tuned) -> str:
    """What the baseline is, as text."""
    if not tuned.baseline.values:
        return (
            "The baseline is the motor loop of the environment alone. The torques of"
            " the controllers are added to it."
        )
    return (
        "The textbook rule sets the natural frequency to one third of the"
        " anti-resonance of the nominal link on its drive"
        f" ({tuned.anti_resonance:.3g} Hz) and the damping ratio to 0.7."
    )


def _gains(tuned: Tuned) -> Table:
    keys = [*tuned.best.values, *tuned.best.gains]
    bounds = {p.key: (p.low, p.high) for p in tuned.parameters}
    rows = []
    for key in keys:
        cells = [
            Cell(format_figure(value) if np.isfinite(value) else "none")
            if (value := (one.values | one.gains).get(key)) is not None
            else Cell("-")
            for one in tuned.candidates
        ]
        low, high = bounds.get(key, (None, None))
        searched = (
            "-" if low is None else f"{format_figure(low)} to {format_figure(high)}"
        )
        rows.append([Cell(key, "text"), *cells, Cell(searched)])
    return Table(
        title="Gains",
        header=[
            ("gain", ""),
            *((one.name, "") for one in tuned.candidates),
            ("bounds of the search", ""),
        ],
        rows=rows,
    )


def _by_seed(tuned: Tuned) -> Table:
    rows = []
    for k, seed in enumerate(tuned.settings.seeds[1]):
        costs = [float(x.held_out[k] / tuned.unit_size) for x in tuned.candidates]
        better = costs[-1] < costs[0]
        rows.append(
            [
                Cell(str(seed), "text"),
                *[Cell(format_figure(x)) for x in costs],
                Cell(
                    f"{100.0 * (1.0 - costs[-1] / costs[0]):.1f}",
                    "" if better else "bad",
                ),
            ]
        )
    names = [(one.name, tuned.unit) for one in tuned.candidates]
    return Table(
        title="Cost by held-out seed",
        header=[
            ("seed", ""),
            *names,
            (f"reduction relative to {tuned.baseline.name}", "%"),
        ],
        rows=rows,
    )


def _cost(tuned: Tuned, one: GainCandidate) -> str:
    """Mean and standard deviation of the held-out costs as text."""
    mean, spread = one.held_out.mean(), one.held_out.std(ddof=1)
    size = tuned.unit_size
    return f"{mean / size:.3g} ± {spread / size:.2g} {tuned.unit}"


def _compared(tuned: Tuned, one: GainCandidate) -> str:
    """Cost compared with that of the baseline, whose name follows, as text."""
    return _ratio(1.0 - tuned.improvement(one))


def _ratio(ratio: float) -> str:
    """Words before the second of two costs, for the first over the second.

    >>> _ratio(0.7), _ratio(1.2), _ratio(1.0), _ratio(356.0)
    ('30.0 % less than', '20.0 % more than', 'the same as', '356 times')
    """
    percent = 100.0 * (ratio - 1.0)
    if abs(percent) < _SAME:
        return "the same as"
    if ratio >= _FACTOR:
        return f"{ratio:.3g} times"
    return f"{abs(percent):.1f} % {'less' if percent < 0.0 else 'more'} than"

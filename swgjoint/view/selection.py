"""Selected drives as tables and as a picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from swgjoint.pictures import png
from swgjoint.sim.figures.keys import LOWER
from swgjoint.view.plots.compare import HEADER
from swgjoint.view.ratings_text import rule_lines
from swgjoint.view.report.tables import Cell, Table
from swgjoint.view.words import format_figure, format_named, short, words

SHOWN = 12
"""Largest number of simulated sets in the table: the last ones that are not dearer than
the selected set."""
MASS = "mass_kg"
"""Column of the mass of drives."""
_USES = {
    "peak_torque_of_rating": "peak torque",
    "cubed_mean_torque_of_rating": "mean torque",
    "max_input_speed_rpm": "top input speed",
    "average_input_speed_rpm": "mean input speed",
    "L10_h": "life",
}
"""Names of the checks in the picture."""

Result = Mapping[str, Any]
"""JSON object of the command ``select``."""


def selection_tables(result: Result) -> list[Table]:
    """Selected drives, or what is left at each joint, and the simulated sets.

    Args:
        result: JSON object of the command.
    """
    tables = [_selected(result) if result["passed"] else _left(result)]
    return [*tables, _sets(result)] if result["simulated"] else tables


def limit_lines(result: Result) -> list[str]:
    """Tool figures of the selected set with their limits, one line each.

    Args:
        result: JSON object of the command.
    """
    winner = _winner(result)
    if winner is None:
        return []
    return [
        f"{key} = {format_figure(value)}; limit {result['spec'][key]:g}"
        for key, value in winner["tool"].items()
    ]


def _title(key: str) -> tuple[str, str]:
    """Displayed name and unit of a figure or of a column."""
    for unit in ("mm", "kg"):
        if key.endswith(f"_{unit}"):
            return key.removesuffix(f"_{unit}").replace("_", " "), unit
    return HEADER.get(key) or words(key)


def _labelled(key: str) -> str:
    """Name of a figure or of a column, with its unit."""
    name, unit = _title(key)
    return f"{name} [{unit}]" if unit else name


def _winner(result: Result) -> Mapping[str, Any] | None:
    met = (one for one in result["simulated"] if one["drives"] == result["drives"])
    return next(met, None)


def _selected(result: Result) -> Table:
    """Drive and figures of every joint."""
    winner = _winner(result)
    assert winner is not None
    keys = [*next(iter(winner["joints"].values()))]
    rows = []
    for name, drives in result["joints"].items():
        chosen = next(one for one in drives if one["selected"])
        figures = winner["joints"][name]
        rows.append(
            [
                Cell(short(name), "text"),
                Cell(chosen["drive"], "text"),
                Cell(format_figure(chosen["cost"])),
                *(Cell(format_named(key, figures[key]), "good") for key in keys),
                Cell(_cheaper(drives, chosen), "text"),
            ]
        )
    limits = [
        f"{key} at {'least' if key in LOWER else 'most'} {result['spec'][key]:g}"
        for key in keys
    ]
    return Table(
        header=[
            ("joint", ""),
            ("drive", ""),
            _title(result["by"]),
            *map(_title, keys),
            ("next cheaper drive", ""),
        ],
        rows=rows,
        notes=[f"limits: {', '.join(limits)}", *_remarks(result)],
    )


def _remarks(result: Result) -> list[str]:
    """What the selection assumes about ratings, encoders and masses."""
    chosen = [
        (one["drive"], one["ratings"])
        for drives in result["joints"].values()
        for one in drives
        if one["selected"]
    ]
    remarks = rule_lines(chosen)
    if result["motor_feedback_failure"] is not None:
        remarks.append(
            "the controller holds the link angles, which needs an encoder at every link"
        )
    if result["by"] == MASS:
        remarks.append(
            "the mass of the drives is a cost and does not load the arm, whose file"
            " includes the drives of its maker"
        )
    return remarks


def _cheaper(drives: Sequence[Mapping[str, Any]], chosen: Mapping[str, Any]) -> str:
    """The dearest drive that is cheaper than the chosen one, and what it misses."""
    below = [one for one in drives if one["cost"] < chosen["cost"]]
    if not below:
        return "none"

    def excess(one: Mapping[str, Any]) -> float:
        uses = [check["use"] for check in one["checks"]]
        return max((inf if use is None else use for use in uses), default=0.0)

    last = min(below, key=lambda one: (-one["cost"], excess(one)))
    why = last["dropped"] or "carries the loads, but its sets miss a limit"
    return f"{last['drive']}: {_brief(why)}"


def _brief(reason: str) -> str:
    """First part of a reason, without the name of the scene."""
    return reason.partition("; ")[0].rpartition("': ")[2]


def _left(result: Result) -> Table:
    """Number of drives that carry the loads of each joint, without a set."""
    rows = []
    for name, drives in result["joints"].items():
        first = [one for one in drives if one["dropped"] and not one["simulated"]]
        later = [one for one in drives if one["simulated"]]
        rows.append(
            [
                Cell(short(name), "text"),
                Cell(str(len(drives))),
                Cell(str(len(first))),
                Cell(str(len(later))),
                Cell(str(len(drives) - len(first) - len(later))),
            ]
        )
    return Table(
        header=[
            ("joint", ""),
            ("drives", ""),
            ("dropped for the loads", ""),
            ("dropped in simulations", ""),
            ("left", ""),
        ],
        rows=rows,
    )


def _sets(result: Result) -> Table:
    """The last simulated sets, see :data:`SHOWN`."""
    sets = result["simulated"]
    keys = [*dict.fromkeys(key for one in sets for key in one["tool"])]
    base, rows = result["drives"] or sets[-1]["drives"], []
    dearest = result["cost"] if result["passed"] else inf
    for one in [one for one in sets if one["cost"] <= dearest][-SHOWN:]:
        missed = [
            f"{short(miss['joint']) + ': ' if miss['joint'] else ''}{miss['figure']}"
            f" = {format_figure(miss['value'])}"
            for miss in one["missed"]
        ]
        verdict = ", ".join([*missed, *map(_brief, one["reasons"])]) or "met"
        rows.append(
            [
                Cell(_difference(one["drives"], base), "text"),
                Cell(format_figure(one["cost"])),
                *(Cell(format_figure(one["tool"].get(key))) for key in keys),
                Cell(verdict, "good" if one["met"] else "bad"),
            ]
        )
    left_out = len(sets) - len(rows)
    which = "selected" if result["passed"] else "last simulated"
    return Table(
        title="Simulated sets",
        header=[
            (f"changes of the {which} set", ""),
            _title(result["by"]),
            *map(_title, keys),
            ("limits", ""),
        ],
        rows=rows,
        notes=[f"{left_out} other sets are not shown"] if left_out else [],
    )


def _difference(drives: Mapping[str, str], base: Mapping[str, str]) -> str:
    """Joints whose drive differs from that of another set, with their drive."""
    changes = [
        f"{short(name)} {drive.rpartition('/')[2]}"
        for name, drive in drives.items()
        if drive != base[name]
    ]
    if len(changes) > 3:
        return f"{len(changes)} other drives"
    return ", ".join(changes) or "none"


def selection_picture(result: Result) -> bytes:
    """Draw the drives of each joint over their cost, and the simulated sets, as PNG.

    Args:
        result: JSON object of the command, with a selected set.
    """
    from matplotlib.figure import Figure

    winner = _winner(result)
    assert winner is not None
    keys = [*winner["tool"]]
    column, unit = _title(result["by"])
    height = 1.8 + 0.62 * len(result["joints"])
    figure = Figure(figsize=(9.5 + 4.2 * bool(keys), height), layout="constrained")
    axes = figure.subplots(
        1, 2 + bool(keys), width_ratios=[1.5, 1.1, *[1.1] * bool(keys)]
    )
    _draw_drives(axes[0], result)
    _draw_uses(axes[1], result)
    if keys:
        _draw_sets(axes[2], result, keys[0])
    cost = f"{column} {format_figure(result['cost'])} {unit}".strip()
    figure.suptitle(f"{result['scene']}: cheapest set, {cost}", fontsize="medium")
    return png(figure, dpi=110)


def _draw_drives(ax: Any, result: Result) -> None:
    """Draw one marker per drive and joint; drives of equal cost above each other."""
    styles = {
        "dropped for its loads": {"marker": "x", "color": "0.6"},
        "dropped in simulations": {"marker": "x", "color": "tab:red"},
        "carries the loads": {"marker": "o", "color": "tab:blue", "mfc": "none"},
        "selected": {"marker": "o", "color": "tab:green"},
    }
    points: dict[str, list[tuple[float, float]]] = {kind: [] for kind in styles}
    for j, drives in enumerate(result["joints"].values()):
        sizes = Counter(one["cost"] for one in drives)
        seen: Counter[float] = Counter()
        for one in drives:
            cost = one["cost"]
            y = j + 0.6 * ((seen[cost] + 0.5) / sizes[cost] - 0.5)
            seen[cost] += 1
            kind = "carries the loads"
            if one["selected"]:
                kind = "selected"
            elif one["dropped"]:
                kind = list(styles)[int(one["simulated"])]
            points[kind].append((cost, y))
    for kind, style in styles.items():
        if points[kind]:
            ax.plot(*zip(*points[kind], strict=True), ls="", ms=5, label=kind, **style)
    names = [
        f"{short(name)}\n{drive.rpartition('/')[2]}"
        for name, drive in result["drives"].items()
    ]
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(result["joints"]) - 0.4, -0.6)
    costs = [one["cost"] for drives in result["joints"].values() for one in drives]
    if min(costs) > 0.0 and max(costs) > 4.0 * min(costs):
        ax.set_xscale("log")
        ticks = sorted(set(costs))
        if len(ticks) <= 8:
            ax.set_xticks(ticks, [format_figure(tick) for tick in ticks])
            ax.minorticks_off()
    ax.set_xlabel(_labelled(result["by"]))
    ax.set_title("drives at each joint", fontsize="medium")
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize="small"
    )
    ax.grid(axis="x", alpha=0.3)


def _draw_uses(ax: Any, result: Result) -> None:
    """Draw how much of each limit the selected drives use under the loads."""
    names = [*result["joints"]]
    keys = [
        check["figure"]
        for check in next(iter(result["joints"].values()))[0]["checks"]
        if check["figure"] in _USES
    ]
    height = 0.8 / len(keys)
    for k, key in enumerate(keys):
        values = []
        for name in names:
            chosen = next(one for one in result["joints"][name] if one["selected"])
            check = next(c for c in chosen["checks"] if c["figure"] == key)
            values.append(check["use"] or 0.0)
        places = [j - 0.4 + (k + 0.5) * height for j in range(len(names))]
        ax.barh(places, values, height=0.9 * height, label=_USES[key], color=f"C{k}")
    ax.axvline(1.0, color="tab:red", ls="--", lw=1.2)
    ax.set_yticks(range(len(names)), [""] * len(names))
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_xlabel("share of the limit")
    ax.set_title("selected drives, loads of the rigid arm", fontsize="medium")
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize="small"
    )


def _draw_sets(ax: Any, result: Result, key: str) -> None:
    """Draw a tool figure of the simulated sets over their cost."""
    runs = [one for one in result["simulated"] if one["tool"].get(key) is not None]
    for met, color, label in (
        (False, "tab:red", "misses a limit"),
        (True, "tab:green", "meets all limits"),
    ):
        some = [one for one in runs if one["met"] == met]
        if some:
            ax.plot(
                [one["cost"] for one in some],
                [one["tool"][key] for one in some],
                "o",
                ms=4,
                color=color,
                label=label,
            )
    ax.axhline(result["spec"][key], color="tab:red", ls="--", lw=1.2, label="limit")
    ax.set_ylim(bottom=0.0)
    column, unit = _title(result["by"])
    ax.set_xlabel(f"{column} of the set{f' [{unit}]' if unit else ''}")
    ax.set_ylabel(_labelled(key))
    ax.set_title("simulated sets", fontsize="medium")
    ax.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize="small"
    )
    ax.grid(alpha=0.3)

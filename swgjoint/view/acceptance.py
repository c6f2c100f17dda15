"""Acceptance tests as a picture and as a table of the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.pictures import png
from swgjoint.units import arcmin, deg
from swgjoint.view.report.tables import Cell, Table
from swgjoint.view.words import format_figure, words

if TYPE_CHECKING:
    from swgjoint.explore.accept.accept import Acceptance

HEADER = ("test", "figure", "at", "simulated", "measured", "limit", "unit", "verdict")
"""Columns of the table."""
TURNS = 3.0
"""Input turns of the error of the output that the picture shows in either direction."""
_COLORS = {"simulated": "tab:blue", "measured": "tab:orange"}
_VERDICTS = {None: "-", True: "met", False: "MISSED"}


def cells(row: Mapping[str, Any], *, both: bool) -> list[str]:
    """Cells of one figure in the order of :data:`HEADER`.

    Args:
        row: JSON object of the row.
        both: Whether the table has a column of measured values.
    """
    name, unit = words(row["figure"])
    values = [row["simulated"], *([row["measured"]] if both else []), row["limit"]]
    return [
        row["test"],
        name,
        row["condition"],
        *map(format_figure, values),
        unit,
        _VERDICTS[row["passed"]],
    ]


def acceptance_table(accepted: Acceptance) -> Table:
    """Table with one row per figure; colours show which limits are met."""
    both = bool(accepted.logs["measured"])
    marks = {None: "", True: "good", False: "bad"}
    lines = []
    for row in accepted.rows:
        texts = cells(asdict(row), both=both)
        last = Cell(texts[-1], marks[row.passed])
        lines.append([Cell(texts[0], "text"), *map(Cell, texts[1:-1]), last])
    names = [name for name in HEADER if both or name != "measured"]
    missing = dict.fromkeys(row.reason for row in accepted.rows if row.reason)
    invalid = [
        f"{k}: not valid: {why}" for k, v in accepted.invalid.items() for why in v
    ]
    return Table(
        header=[(name, "") for name in names],
        rows=lines,
        notes=[*(f"No value: {reason}." for reason in missing), *invalid],
    )


def acceptance_picture(accepted: Acceptance, drive: str) -> bytes:
    """Draw the figures relative to their limits, the loop and the output turn as PNG.

    Args:
        accepted: Results of the tests.
        drive: Name of the drive.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.5, 5.2), layout="constrained")
    bars, loop, turn = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 1.2))
    _draw_bars(bars, accepted)
    _draw_logs(loop, accepted, "stiffness")
    loop.set(xlabel="output torque [N·m]", ylabel="torsion [arcmin]")
    loop.set_title("torque loop, input held", fontsize="medium")
    _draw_logs(turn, accepted, "kinematic-error")
    turn.set(xlabel="output angle [deg]", ylabel="error of the output [arcmin]")
    turn.set_title(f"unloaded, {TURNS:g} input turns forth and back", fontsize="medium")
    verdict = "passed" if accepted.passed else "not passed"
    figure.suptitle(f"acceptance of {drive}: {verdict}", fontsize="medium")
    return png(figure, dpi=110)


def _draw_bars(ax: Any, accepted: Acceptance) -> None:
    """Draw every limited figure as a bar relative to its limit."""
    rows = [row for row in accepted.rows if row.limit is not None]
    both = bool(accepted.logs["measured"])
    for k, row in enumerate(rows):
        for offset, which in enumerate(_COLORS if both else ("simulated",)):
            value = getattr(row, which)
            if value is None:
                ax.text(0.02, k, "no value", va="center", fontsize="x-small")
                continue
            missed = row.passed is False and (which == "measured" or not both)
            share = row.share_of_limit(value)
            height = 0.38 if both else 0.7
            y = k + (offset - 0.5) * height if both else k
            color = "tab:red" if missed else _COLORS[which]
            ax.barh(y, share, height=height, color=color)
            text = f"{format_figure(value)} {words(row.figure)[1]}"
            ax.annotate(
                text,
                (share, y),
                (4, 0),
                textcoords="offset points",
                va="center",
                fontsize="x-small",
                annotation_clip=True,
                bbox={"fc": "white", "ec": "none", "pad": 0.8},  # above the limit line
            )
    names = [
        f"{words(row.figure)[0]}{f', {row.condition}' if row.condition else ''}"
        for row in rows
    ]
    ax.set_yticks(range(len(rows)), names, fontsize="small")
    ax.set_ylim(len(rows) - 0.5, -0.5)  # rows without a value have no bar
    ax.axvline(1.0, color="tab:red", ls="--", lw=1.2)
    ax.set_xlim(0.0, max(1.5, min(4.0, 1.4 * ax.get_xlim()[1])))
    ax.set_xlabel("share of the limit; above 1 it is missed")
    ax.set_title("figures and limits", fontsize="medium")


def _draw_logs(ax: Any, accepted: Acceptance, test: str) -> None:
    """Draw the loop or the error of the output of all logs of a test."""
    for which, color in _COLORS.items():
        log = accepted.logs[which].get(test)
        if log is None:
            continue
        error = log.link_angle - log.motor_angle / accepted.ratio
        error = (error - 0.5 * (error.max() + error.min())) / arcmin
        style = {"color": color, "lw": 0.8, "label": which, "alpha": 0.8}
        if test == "stiffness":
            ax.plot(log.output_torque, -error, **style)
        else:
            angle = log.link_angle / deg
            shown = (angle > 180.0) & (
                angle < 180.0 + TURNS * 360.0 / abs(accepted.ratio)
            )
            ahead = np.gradient(log.link_angle) > 0.0
            for forth, dash in ((True, "-"), (False, "--")):
                part = np.where(shown & (ahead == forth), error, np.nan)
                way = "forth" if forth else "back"
                ax.plot(angle, part, **style | {"label": f"{which}, {way}", "ls": dash})
    if ax.lines:
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.12 * (high - low))  # room for the legend
        ax.legend(fontsize="small", loc="upper left", ncols=2)
    else:
        ax.text(0.5, 0.5, "not tested", ha="center", transform=ax.transAxes)
    ax.grid(alpha=0.3)

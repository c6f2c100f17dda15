"""A comparison as a picture and as a table of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from swgjoint.maps.sheet.map_validity import QUANTITIES
from swgjoint.maps.sheet.validity_marks import error_mark, joint_mark, mark_legend
from swgjoint.pictures import png
from swgjoint.sim.figures.keys import LOWER, RIPPLE
from swgjoint.view.recording.entities import COLORS
from swgjoint.view.report.tables import Cell, Table
from swgjoint.view.words import format_figure

if TYPE_CHECKING:
    from swgjoint.explore.compare.compare import Compared

HEADER = {
    "ripple_rms_percent": ("ripple rms", "% of rated"),
    "ripple_pp_percent": ("ripple", "% of rated, pp"),
    "transmission_error_ripple_arcmin": ("error ripple", "arcmin, pp"),
    "transmission_error_arcmin": ("transm. error", "arcmin, pp"),
    "torsion_arcmin": ("torsion", "arcmin, mean"),
    "tool_path_rms_mm": ("tool off path", "mm, rms"),
    "K1_Nm_rad": ("K1", "N·m/rad"),
    "von_mises_MPa": ("von Mises", "MPa"),
    "fatigue_safety_factor": ("fatigue safety", ""),
    "peak_torque_of_rating": ("peak", "of rating"),
    "wall_s": ("computed in", "s"),
}
"""Figures of a row as people read them: name and unit."""
JUDGED_BY = {
    "ripple_rms_percent": tuple(QUANTITIES),
    "ripple_pp_percent": tuple(QUANTITIES),
    "transmission_error_ripple_arcmin": ("output_error",),
}
"""Quantities of the validation of a map that a figure depends on."""
_ERROR = "transmission_error_arcmin"
PANELS = (
    "ripple_rms_percent",
    "transmission_error_ripple_arcmin",
    "K1_Nm_rad",
    "torsion_arcmin",
    "tool_path_rms_mm",
    "von_mises_MPa",
    "peak_torque_of_rating",
)
_WIDE = 30.0
"""From this ratio of the largest to the smallest an axis is logarithmic."""


def cell(row: Mapping[str, Any], key: str) -> str:
    """A figure as text: a dash for none, > before a ripple that lacks orders.

    ~ and ! where the map differs from unseen solves.
    """
    if key in RIPPLE and row["ripple_missing"]:
        return "-"
    bound = "> " if key in RIPPLE and row["ripple_is_lower_bound"] else ""
    if key in JUDGED_BY:
        sign = joint_mark(row, JUDGED_BY[key])
    else:
        sign = error_mark(row, row[key]) if key == _ERROR else ""
    return f"{sign} {bound}{format_figure(row[key])}".strip()


def columns(rows: Sequence[Compared]) -> dict[str, tuple[str, str]]:
    """The figures that at least one row knows."""
    return {
        key: title
        for key, title in HEADER.items()
        if any(row.figure(key) is not None for row in rows)
    }


def comparison_table(
    rows: Sequence[Compared], spec: Mapping[str, float] | None = None
) -> Table:
    """One line an argument; what misses its limit is marked."""
    shown_keys = columns(rows)
    verdict = [("spec", "")] if spec else []
    lines = []
    for row in rows:
        cells = [Cell(row.argument, "text"), Cell(row.level)]
        for key in shown_keys:
            mark = "bad" if key in row.missed else "good" if key in (spec or {}) else ""
            cells.append(Cell(cell(row.to_json(), key), mark))
        if spec:
            kept = not row.missed
            cells.append(Cell("kept" if kept else "missed", "good" if kept else "bad"))
        lines.append(cells)
    limits = [
        f"{key} at {'least' if key in LOWER else 'most'} {limit:g}"
        for key, limit in (spec or {}).items()
    ]
    return Table(
        header=[("", ""), ("level", ""), *shown_keys.values(), *verdict],
        rows=lines,
        notes=[
            "Worst joint of the scene; K1 and von Mises stress (mean over a pitch of"
            " the largest, at rated torque) are those of the drive, no K1 at a level"
            " without compliance.",
            *([f"Spec: {', '.join(limits)}."] if limits else []),
            *left_out_notes(rows),
        ],
    )


def left_out_notes(rows: Sequence[Compared]) -> list[str]:
    """Where ripple says less than it seems: orders beyond the step, doubtful maps."""
    found: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        found.setdefault(row.strongest_order_left_out, []).append(row.argument)
    notes = [
        f"too fast for the step, strongest order left out: {', '.join(joints)}"
        + ("" if len(names) == len(rows) else f" ({', '.join(names)})")
        for joints, names in found.items()
        if joints
    ]
    marks = set()
    for row in rows:
        told = row.to_json()
        marks |= {joint_mark(told), error_mark(told, row.transmission_error_arcmin)}
    return [*notes, mark_legend(marks)] if marks - {""} else notes


def comparison_picture(
    rows: Sequence[Compared], scene: str, spec: Mapping[str, float] | None = None
) -> bytes:
    """PNG: bars of every figure, one panel each, limits of the spec as lines."""
    from matplotlib.figure import Figure

    panels = [
        key for key in PANELS if any((row.figure(key) or 0.0) > 0.0 for row in rows)
    ]
    across = min(4, len(panels))
    down = -(-len(panels) // across)
    figure = Figure(figsize=(12.5, 0.7 + down * (1.0 + 0.34 * len(rows))))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(down, across, sharey=True, squeeze=False)
    colors = [
        tuple(part / 255 for part in COLORS[k % len(COLORS)]) for k in range(len(rows))
    ]
    for ax, key in zip(axes.flat, panels, strict=False):
        _bars(ax, rows, key, colors, (spec or {}).get(key))
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
    axes[0, 0].set_yticks(range(len(rows)), [row.argument for row in rows])
    axes[0, 0].invert_yaxis()
    figure.suptitle(f"scene {scene}, worst joint", fontsize="medium")
    return png(figure, dpi=110)


def _bars(
    ax: Any,
    rows: Sequence[Compared],
    key: str,
    colors: Sequence[tuple[float, ...]],
    limit: float | None,
) -> None:
    """One figure of all rows, each bar with its value."""
    values = [row.figure(key) for row in rows]
    heights = [value or 0.0 for value in values]
    seen = [value for value in heights if value > 0.0]
    wide = max(seen) > _WIDE * min(seen)
    ax.barh(range(len(rows)), heights, color=colors, height=0.7)
    if wide:
        ax.set_xscale("log")
        ax.set_xlim(0.4 * min(seen), 25.0 * max(seen))
    else:
        ax.set_xlim(0.0, 1.35 * max(seen))
    left = ax.get_xlim()[0]
    for k, row in enumerate(rows):
        text = f" {cell(row.to_json(), key)}"
        color = "tab:red" if key in row.missed else "black"
        ax.text(
            max(heights[k], left), k, text, va="center", fontsize="small", color=color
        )
    if limit is not None:
        ax.axvline(limit, color="tab:red", ls="--", lw=1.2)
    name, unit = HEADER[key]
    better = "more" if key in LOWER else "less"
    ax.set_title(f"{name}{f' [{unit}]' if unit else ''}", fontsize="small")
    ax.set_xlabel(f"{better} is better{', log' if wide else ''}", fontsize="x-small")
    ax.tick_params(labelsize="small")
    ax.tick_params(axis="x", which="minor", labelbottom=False)

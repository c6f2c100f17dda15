"""Comparison of drives as a picture and as a table of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from swgjoint.maps.sheet.map_validity import QUANTITIES
from swgjoint.maps.sheet.validity_marks import error_mark, joint_mark, mark_legend
from swgjoint.pictures import png
from swgjoint.sim.figures.keys import ERROR, LOWER, RIPPLE, is_lower_bound
from swgjoint.view.recording.entities import COLORS
from swgjoint.view.report.tables import Cell, Table
from swgjoint.view.words import NOISE_NOTE, format_named

if TYPE_CHECKING:
    from swgjoint.explore.compare.compare import Compared

HEADER = {
    "ripple_rms_percent": ("output torque ripple", "% of rated, rms"),
    "ripple_pp_percent": ("output torque ripple", "% of rated, pp"),
    "transmission_error_ripple_arcmin": (
        "transmission error, strongest order",
        "arcmin, pp",
    ),
    "transmission_error_arcmin": ("transmission error", "arcmin, pp"),
    "torsion_arcmin": ("torsion", "arcmin, mean"),
    "tool_path_rms_mm": ("tool path error", "mm, rms"),
    "K1_Nm_rad": ("K1", "N·m/rad"),
    "resonance_Hz": ("lowest resonance", "Hz"),
    "von_mises_MPa": ("von Mises stress", "MPa"),
    "fatigue_safety_factor": ("fatigue safety factor", ""),
    "peak_torque_of_rating": ("peak torque", "of repeated peak"),
    "L10_h": ("bearing life L10", "h"),
    "goodman_safety": ("Goodman safety of the flexspline", ""),
    "wall_s": ("computing time", "s"),
}
"""Displayed name and unit of the figures of a row, by key."""
JUDGED_BY = {
    "ripple_rms_percent": tuple(QUANTITIES),
    "ripple_pp_percent": tuple(QUANTITIES),
    "transmission_error_ripple_arcmin": ("output_error",),
}
"""Quantities of the map validation on which a figure depends, by key of the figure."""
PANELS = (
    "ripple_rms_percent",
    "transmission_error_ripple_arcmin",
    "K1_Nm_rad",
    "torsion_arcmin",
    "tool_path_rms_mm",
    "von_mises_MPa",
    "peak_torque_of_rating",
)
"""Keys of the figures that the picture shows, one panel each."""
_WIDE = 30.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""


def cell(row: Mapping[str, Any], key: str) -> str:
    """Format a figure with its marks.

    The text is a dash if the run reports no ripple. ``>`` marks a lower bound, ``~`` an
    uncertain and ``!`` an invalid figure, see
    :mod:`swgjoint.maps.sheet.validity_marks`.

    Args:
        row: JSON object of a row.
        key: Key of the figure.
    """
    if key in RIPPLE and row["ripple_missing"]:
        return "-"
    text = format_named(key, row[key])
    bound = "> " if text != "-" and is_lower_bound(row, key) else ""
    if key in JUDGED_BY:
        sign = joint_mark(row, JUDGED_BY[key])
    else:
        sign = error_mark(row, row[key]) if key == ERROR else ""
    return f"{sign} {bound}{text}".strip()


def columns(rows: Sequence[Compared]) -> dict[str, tuple[str, str]]:
    """Displayed name and unit of the figures that at least one row has, by key."""
    return {
        key: title
        for key, title in HEADER.items()
        if any(row.figure(key) is not None for row in rows)
    }


def comparison_table(
    rows: Sequence[Compared], spec: Mapping[str, float] | None = None
) -> Table:
    """Table with one row per argument; colours show which limits are met.

    Args:
        rows: Results of the comparison.
        spec: Limits by figure; None without a spec.
    """
    shown_keys = columns(rows)
    verdict = [("spec", "")] if spec else []
    lines = []
    for row in rows:
        cells = [Cell(row.argument, "text"), Cell(row.level)]
        for key in shown_keys:
            mark = "bad" if key in row.missed else "good" if key in (spec or {}) else ""
            cells.append(Cell(cell(row.to_json(), key), mark))
        if spec:
            met = not row.missed
            cells.append(Cell("met" if met else "missed", "good" if met else "bad"))
        lines.append(cells)
    limits = [
        f"{key} at {'least' if key in LOWER else 'most'} {limit:g}"
        for key, limit in (spec or {}).items()
    ]
    return Table(
        header=[("argument", ""), ("level", ""), *shown_keys.values(), *verdict],
        rows=lines,
        notes=[
            "Joint figures are those of the worst joint of the scene. The torque ripple"
            " is that of the output torque of the moving arm. K1 and the"
            " von Mises stress (largest stress at rated torque, averaged over a pitch)"
            " are those of the drive. Levels without compliance have no K1.",
            *([f"Limits of the spec: {', '.join(limits)}."] if limits else []),
            *left_out_notes(rows),
        ],
    )


def left_out_notes(rows: Sequence[Compared]) -> list[str]:
    """Notes on orders that the step leaves out, and the legend of ``~`` and ``!``."""
    by_joints: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        by_joints.setdefault(row.strongest_order_left_out, []).append(row.argument)
    notes = [
        "strongest order left out, because the joint turns too fast for the step:"
        f" {', '.join(joints)}"
        + ("" if len(names) == len(rows) else f" ({', '.join(names)})")
        for joints, names in by_joints.items()
        if joints
    ]
    marks = set()
    for row in rows:
        figures = row.to_json()
        error = row.transmission_error_arcmin
        marks |= {joint_mark(figures), error_mark(figures, error)}
    if marks - {""}:
        notes.append(mark_legend(marks))
    figures_of_run = (ERROR, "torsion_arcmin", "tool_path_rms_mm")
    if any(_is_noise(row, key) for row in rows for key in figures_of_run):
        notes.append(NOISE_NOTE)
    return notes


def comparison_picture(
    rows: Sequence[Compared], scene: str, spec: Mapping[str, float] | None = None
) -> bytes:
    """Draw one bar chart per figure, with the limits of the spec as lines, as PNG.

    Args:
        rows: Results of the comparison.
        scene: Name of the scene.
        spec: Limits by figure; None without a spec.
    """
    from matplotlib.figure import Figure

    panels = [key for key in PANELS if any(_height(row, key) > 0.0 for row in rows)]
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


def _is_noise(row: Compared, key: str) -> bool:
    value = row.figure(key)
    return value is not None and format_named(key, value) == "-"


def _height(row: Compared, key: str) -> float:
    """Value of a bar; zero for a figure that is shown as a dash."""
    value = row.figure(key)
    return 0.0 if value is None or _is_noise(row, key) else float(value)


def _bars(
    ax: Any,
    rows: Sequence[Compared],
    key: str,
    colors: Sequence[tuple[float, ...]],
    limit: float | None,
) -> None:
    """Draw one figure of all rows as bars, with its value next to each bar."""
    heights = [_height(row, key) for row in rows]
    seen = [value for value in heights if value > 0.0]
    wide = max(seen) > _WIDE * min(seen)
    ax.barh(range(len(rows)), heights, color=colors, height=0.7)
    if wide:
        ax.set_xscale("log")
        ax.set_xlim(0.4 * min(seen), 25.0 * max(seen))
    else:
        ax.set_xlim(0.0, 1.35 * max(seen))
        ax.locator_params(axis="x", nbins=3)  # more labels may overlap
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
    better = "higher" if key in LOWER else "lower"
    ax.set_title(f"{name}{f' [{unit}]' if unit else ''}", fontsize="small")
    ax.set_xlabel(
        f"{better} is better{', log scale' if wide else ''}", fontsize="x-small"
    )
    ax.tick_params(labelsize="small")
    ax.tick_params(axis="x", which="minor", labelbottom=False)

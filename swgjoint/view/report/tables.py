"""Tables of the HTML report."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from typing import TYPE_CHECKING, Any

from swgjoint import __version__
from swgjoint.json_text import plain
from swgjoint.maps.sheet.map_validity import (
    NOT_VALIDATED,
    map_validation,
    validation_summary,
)
from swgjoint.maps.sheet.spec_sheet import measure_spec, validity
from swgjoint.maps.sheet.validity_marks import (
    error_mark,
    joint_mark,
    mark,
    mark_legend,
    worst,
)
from swgjoint.pictures import inline_picture
from swgjoint.sim.figures.verdict import NOT_VALID, VALID
from swgjoint.view.plots.spec import spec_picture
from swgjoint.view.ratings_text import sheet_words
from swgjoint.view.validity import left_out_share, limits_of, map_error, warnings_of
from swgjoint.view.words import above_noise, format_figure, short

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.sim.run import Run

PACKAGES = ("mujoco", "numpy", "scipy", "scikit-fem", "rerun-sdk", "matplotlib")


@dataclass(frozen=True)
class Cell:
    """One cell of a table."""

    text: str
    mark: str = ""
    """``good`` or ``bad`` for the colour, ``text`` for left alignment, or empty."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of the report."""

    header: Sequence[tuple[str, str]]
    """Name and unit of every column; the unit may be empty."""
    rows: Sequence[Sequence[Cell]]
    title: str = ""
    notes: Sequence[str] = ()
    """Remarks below the table."""


def cells_of(rows: Sequence[Sequence[str]]) -> list[list[Cell]]:
    """Cells of rows of text; the first column is left-aligned."""
    return [
        [Cell(text, "" if k else "text") for k, text in enumerate(row)] for row in rows
    ]


WINDOWS = {
    "constant speed": "the constant-speed part of the motion",
    "motion": "the whole motion",
}
"""Part of the motion from which the figures are computed, by ``window_of``."""


def alerts(runs: Mapping[str, Run]) -> list[str]:
    """Reasons why runs are not valid, one line per reason."""
    return [
        f"{label}: {NOT_VALID}: {reason}"
        for label, run in runs.items()
        for reason in run.figures["reasons"]
    ]


def summary_table(runs: Mapping[str, Run]) -> Table:
    """Figures of the worst joints and of the tool, one row per run."""
    rows, window = [], ""
    for label, run in runs.items():
        metrics = run.figures
        window = metrics["window_of"]
        joints = metrics["joints"].values()
        peaks = [
            joint["ratings"]["peak_Nm"] / joint["ratings"]["repeated_peak_Nm"]
            for joint in joints
        ]
        within = all(joint["ratings"]["within"] for joint in joints)
        torsion = [abs(j["torsion_arcmin"]["mean"]) for j in joints]
        error = [j["transmission_error_arcmin"]["pp"] for j in joints]
        valid = metrics["verdict"] == VALID
        rows.append(
            [
                Cell(label, "text"),
                Cell(metrics["verdict"], "good" if valid else "bad"),
                ripple_cell(joints, "ripple_rms_percent"),
                ripple_cell(joints, "ripple_pp_percent"),
                *_cells(above_noise(max(torsion))),
                error_cell(joints, max(error)),
                *_cells(above_noise(metrics["tool"]["path_rms_mm"]), max(peaks)),
                Cell(format_figure(within), "good" if within else "bad"),
                *_cells(run.time[-1] / run.wall),
            ]
        )
    return Table(
        header=[
            ("run", ""),
            ("verdict", ""),
            ("output torque ripple", "% of rated, rms"),
            ("output torque ripple", "% of rated, pp"),
            ("torsion", "arcmin, mean"),
            ("transmission error", "arcmin, pp"),
            ("tool path error", "mm, rms"),
            ("peak torque", "of repeated peak"),
            ("within ratings", ""),
            ("simulation speed", "times real time"),
        ],
        rows=rows,
        notes=[
            "Joint figures are the largest of all joints. Ripple, torsion and"
            f" transmission error refer to {WINDOWS[window]}, tool path error and peak"
            " torque to the whole run.",
            *_legend(
                joint
                for run in runs.values()
                for joint in run.figures["joints"].values()
            ),
        ],
    )


def ripple_cell(joints: Iterable[Mapping[str, Any]], key: str) -> Cell:
    """Largest ripple of several joints, with its marks.

    The text is a dash if no joint has a ripple figure. ``>`` marks a lower bound, ``~``
    an uncertain and ``!`` an invalid figure.

    Args:
        joints: Figures of the joints.
        key: Key of the ripple figure.
    """
    known = [joint for joint in joints if joint["ripple_missing"] is None]
    if not known:
        return Cell("-")
    most = max(known, key=lambda joint: float(joint[key]))
    bound = "> " if most["ripple_is_lower_bound"] else ""
    sign = worst([joint_mark(joint) for joint in known])
    text = f"{sign} {bound}{format_figure(most[key])}".strip()
    return Cell(text, "bad" if bound or sign else "")


def error_cell(joints: Iterable[Mapping[str, Any]], value: float) -> Cell:
    """Peak-to-peak transmission error with the marks ``~`` and ``!``.

    Args:
        joints: Figures of the joints whose maps determine the mark.
        value: Peak-to-peak transmission error [arcmin].
    """
    sign = worst([error_mark(joint, value) for joint in joints])
    shown = format_figure(above_noise(value))
    return Cell(f"{sign} {shown}".strip(), "bad" if sign else "")


def _legend(joints: Iterable[Mapping[str, Any]]) -> list[str]:
    """Legend of the marks ``~`` and ``!`` of these joints; empty if there are none."""
    marks = set()
    for joint in joints:
        error = joint["transmission_error_arcmin"]["pp"]
        marks |= {joint_mark(joint), error_mark(joint, error)}
    return [f"{mark_legend(marks)}."] if marks - {""} else []


def label_table(label: str, run: Run, step: dict[str, Any] | None) -> dict[str, Any]:
    """Template section: limits of the figures of a run, their change at half the step.

    Args:
        label: Name of the run.
        run: The run.
        step: Result of ``swgjoint.view.validity.step_error``; None if not computed.
    """
    simulation = run.assembly.scene.simulation
    metrics = run.figures
    limits = [*metrics["reasons"], *warnings_of(metrics["joints"])]
    lines = [Cell(text, "bad") for text in limits]
    lines.append(
        Cell(
            f"{simulation.integrator} at {1e3 * run.assembly.step:g} ms; figures from"
            f" {metrics['window_s'][0]:.3g} to {metrics['window_s'][1]:.3g} s;"
            f" ripple: {metrics['ripple_of']}"
        )
    )
    if step is not None and "reason" in step:
        lines.append(Cell(f"change at half the step: {step['reason']}"))
    lines += [Cell(text) for text in limits_of(run, metrics["joints"])]
    changes = (step or {}).get("joints", {})
    rows = []
    for j, joint in enumerate(run.joints):
        figures, transmission = metrics["joints"][joint], run.assembly.transmissions[j]
        ends = figures["ratings"]["map_range_Nm"] or ()
        left = [f"{item['order']:.4g}" for item in figures["unresolved"]]
        orders = f"{' '.join(left[:3])}{' ...' if left[3:] else ''}" or "none"
        change = changes.get(joint, {})
        rows.append(
            [
                Cell(short(joint), "text"),
                Cell(figures["level"]),
                Cell(f"{transmission.drive.name} ({figures['source']})"),
                Cell("\u00a0to\u00a0".join(f"{t:.3g}" for t in ends) or "-"),
                *_cells(figures["highest_resolved_order"]),
                Cell(orders),
                *_cells(left_out_share(run, j)),
                *[
                    Cell("-" if key not in change else f"{change[key]:.1g}")
                    for key in (
                        "ripple_rms_percent",
                        "transmission_error_arcmin",
                        "torsion_arcmin",
                    )
                ],
            ]
        )
    table = Table(
        header=[
            ("joint", ""),
            ("level", ""),
            ("drive (source)", ""),
            ("torque range of the map", "N·m"),
            ("highest resolved order", "per input turn"),
            ("orders left out", "per input turn"),
            ("amplitude of these orders", "N·m, at rated torque"),
            ("output torque ripple ±", "% of rated, rms"),
            ("transmission error ±", "arcmin, pp"),
            ("torsion ±", "arcmin, mean"),
        ],
        rows=rows,
        notes=[
            "± is the change of a figure when the step is halved and the orders remain"
            " the same. The error due to the step is at most twice this change."
        ],
    )
    return {"title": label, "lines": lines, "table": table}


def _joint_table(runs: Mapping[str, Run], joint: str) -> Table:
    """Figures of one joint in every run."""
    rows, loads = [], ("peak_Nm", "cubed_mean_Nm", "input_speed_rpm")
    for label, run in runs.items():
        figures = run.figures["joints"][joint]
        ratings = figures["ratings"]
        torsion, error = figures["torsion_arcmin"], figures["transmission_error_arcmin"]
        shown = map(above_noise, (torsion["mean"], torsion["pp"], error["mean"]))
        orders = ", ".join(
            f"{line['order']:.1f}{'' if line['drive_order'] else '*'}"
            f" ({line['amplitude_percent']:.3f} %)"
            for line in figures["orders"]
        )
        rows.append(
            [
                Cell(label, "text"),
                *_cells(*shown),
                error_cell([figures], error["pp"]),
                ripple_cell([figures], "ripple_rms_percent"),
                ripple_cell([figures], "ripple_pp_percent"),
                Cell(f"{joint_mark(figures)} {orders}".strip() if orders else "-"),
                *_cells(*map(ratings.get, loads)),
                Cell(
                    format_figure(ratings["within"]),
                    "good" if ratings["within"] else "bad",
                ),
            ]
        )
    return Table(
        header=[
            ("run", ""),
            ("torsion", "arcmin, mean"),
            ("torsion", "arcmin, pp"),
            ("transmission error", "arcmin, mean"),
            ("transmission error", "arcmin, pp"),
            ("output torque ripple", "% of rated, rms"),
            ("output torque ripple", "% of rated, pp"),
            ("strongest orders", "per input turn (% of rated torque)"),
            ("peak torque", "N·m"),
            ("cubic mean torque", "N·m"),
            ("largest input speed", "rpm"),
            ("within ratings", ""),
        ],
        rows=rows,
        notes=[
            "* not an order of this drive: vibration, modulation or another joint.",
            *_legend(run.figures["joints"][joint] for run in runs.values()),
        ],
    )


def sheet_table(drive: DriveMap) -> dict[str, Any]:
    """Template section: spec sheet of a drive, with the manufacturer's known values."""
    sheet = measure_spec(drive)
    stated = drive.info.get("stated")
    stated = stated if isinstance(stated, Mapping) else {}
    rows = []
    for key, value in sheet.figures.items():
        if key == "orders":
            continue
        name, unit = sheet_words(key, drive.ratings.source)
        doubt = sheet.uncertain.get(key) if value is not None else None
        sign = "" if doubt is None else mark(doubt.largest)
        why = "" if doubt is None else f"the map {doubt}"
        rows.append(
            [
                Cell(name, "text"),
                Cell(
                    f"{sign} {format_figure(plain(value))}".strip(),
                    "bad" if sign else "",
                ),
                *(_cells(stated.get(key)) if stated else []),
                Cell(unit, "text"),
                Cell(sheet.missing.get(key, why), "text"),
            ]
        )
    label = validity(drive)
    low, high = label["torque_range_Nm"]
    source = (
        f"Level {label['level']}, {low:.4g} to {high:.4g} N·m"
        f"{'; the loop exceeds this range' if label['beyond_range'] else ''}; ratings:"
        f" {label['ratings']}; hysteresis: {label['hysteresis']}; friction:"
        f" {label['friction']}; {_validated(drive)}."
    )
    return {
        "title": drive.name,
        "source": source,
        "picture": inline_picture(spec_picture(drive.name, sheet)),
        "table": Table(
            header=[
                ("figure", ""),
                ("map", ""),
                *([("manufacturer", "")] if stated else []),
                ("unit", ""),
                ("remark", ""),
            ],
            rows=rows,
        ),
    }


def _validated(drive: DriveMap) -> str:
    """Result of the validation of a map in one phrase."""
    validation, _ = map_validation(drive)
    return NOT_VALIDATED if validation is None else validation_summary(validation)


def provenance_table(drives: Sequence[DriveMap]) -> Table:
    """Origin and known errors of every map."""
    rows = []
    for drive in drives:
        info = drive.info
        label = info.get("label")
        method = (
            ", ".join(
                f"{key.replace('_', ' ')}: {value}"
                for key, value in label.items()
                if value is not None
            )
            if isinstance(label, Mapping)
            else str(info.get("source", drive.level))
        )
        rows.append(
            [
                Cell(drive.name, "text"),
                Cell(drive.level, "text"),
                Cell(method, "text"),
                Cell(str(info.get("design_hash", "-"))[:16], "text"),
                Cell(str(info.get("ratings_source", drive.ratings.source)), "text"),
                Cell("; ".join(map_error(drive)), "text"),
            ]
        )
    names = ("drive", "level", "origin", "design hash", "ratings", "known errors")
    return Table(title="Maps", header=[(name, "") for name in names], rows=rows)


def versions_table() -> Table:
    """Versions of Python, swgjoint and the packages in :data:`PACKAGES`."""
    versions = {"python": platform.python_version(), "swgjoint": __version__}
    versions |= {name: metadata.version(name) for name in PACKAGES}
    return Table(
        title="Versions",
        header=[(name, "") for name in versions],
        rows=[[Cell(value, "text") for value in versions.values()]],
    )


def _cells(*values: Any) -> list[Cell]:
    return [Cell(format_figure(plain(value))) for value in values]

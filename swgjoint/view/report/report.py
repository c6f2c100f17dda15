"""Write results as one HTML page that has no scripts and loads no other files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint import __version__
from swgjoint.files import write_whole
from swgjoint.json_text import json_text
from swgjoint.pictures import inline_picture
from swgjoint.progress import Progress, silent
from swgjoint.toml_text import toml_text
from swgjoint.view.gauges import gauge_picture, gauge_tables
from swgjoint.view.life.picture import life_picture
from swgjoint.view.recording.blueprint import joints_by_interest
from swgjoint.view.report.life import bearing_tables, life_tables
from swgjoint.view.report.plots import joint_pngs
from swgjoint.view.report.tables import (
    Table,
    _joint_table,
    alerts,
    label_table,
    provenance_table,
    sheet_table,
    summary_table,
    versions_table,
)
from swgjoint.view.thermal import thermal_picture, thermal_tables
from swgjoint.view.validity import step_error
from swgjoint.view.words import short

if TYPE_CHECKING:
    from swgjoint.maps.drive_map import DriveMap
    from swgjoint.sim.run import Run


def write_report(
    runs: Mapping[str, Run],
    path: str | Path,
    *,
    summary: Table | None = None,
    pictures: Mapping[str, bytes] | None = None,
    check_step: bool = True,
    progress: Progress = silent,
) -> Path:
    """Write runs of one motion as a self-contained page; the write is atomic.

    The page contains a comparison of the runs, the validity of every run with an error
    estimate of its figures, plots of every joint, the spec sheet of every drive, the
    settings of the scenes, and the provenance of the results.

    Args:
        runs: Runs by displayed name; an empty name is replaced by that of the run.
        path: File to write; its folder must exist.
        summary: Table at the top; None for :func:`summary_table` of the runs.
        pictures: PNG images below that table, by title.
        check_step: Whether to repeat every run at half its step.
        progress: Called with the stage, the number of finished sections and their
            total.

    Returns:
        The path.

    Raises:
        InputError: If the file cannot be written.
    """
    runs = {label or run.name: run for label, run in runs.items()}
    first = next(iter(runs.values()))
    scene = first.assembly.scene
    joints = joints_by_interest(runs)
    drives = _drives(runs)
    total = len(runs) + len(joints) + len(drives)
    done = 0

    def count() -> None:
        nonlocal done
        done += 1
        progress("report", done, total)

    labels = []
    for label, run in runs.items():
        labels.append(label_table(label, run, step_error(run) if check_step else None))
        count()
    panels = []
    for joint, picture in zip(joints, joint_pngs(runs, joints), strict=True):
        panels.append(
            {
                "title": short(joint),
                "picture": inline_picture(picture),
                "table": _joint_table(runs, joint),
            }
        )
        count()
    sheets = []
    for drive in drives:
        sheets.append(sheet_table(drive))
        count()
    return _write_page(
        path,
        title=f"Scene {scene.name}",
        description=scene.description,
        alerts=alerts(runs),
        summary=summary or summary_table(runs),
        tables=[
            *life_tables(runs),
            *bearing_tables(runs),
            *gauge_tables(runs),
            *thermal_tables(runs),
        ],
        pictures={
            **(pictures or {}),
            **{
                f"Duty cycle of {label}": life_picture(run)
                for label, run in runs.items()
                if run.cycle
            },
            **{
                f"Strain gauges of {label}": gauge_picture(run)
                for label, run in runs.items()
                if run.assembly.gauges
            },
            **{
                f"Temperatures of {label}": thermal_picture(run)
                for label, run in runs.items()
                if run.heat
            },
        },
        labels=labels,
        joints=panels,
        sheets=sheets,
        settings=[
            {
                "title": f"Scene of {label}",
                "text": toml_text(
                    run.assembly.scene.model_dump(exclude_unset=True, exclude_none=True)
                ),
            }
            for label, run in runs.items()
        ]
        + [
            {"title": f"Model of {label}", "text": json_text(run.contains)}
            for label, run in runs.items()
        ],
        provenance=provenance_table(drives),
    )


def write_tables(
    path: str | Path,
    *,
    title: str,
    description: str,
    tables: Sequence[Table],
    pictures: Mapping[str, bytes],
    settings: Mapping[str, str],
) -> Path:
    """Write results other than scene runs as a page with the same layout.

    Args:
        path: File to write; its folder must exist.
        title: Title of the page.
        description: Text below the title.
        tables: Summary table, followed by the tables that appear below the pictures.
        pictures: PNG images by title.
        settings: Preformatted texts of the settings section, by title.

    Returns:
        The path.

    Raises:
        InputError: If the file cannot be written.
    """
    return _write_page(
        path,
        title=title,
        description=description,
        summary=tables[0],
        tables=tables[1:],
        pictures=pictures,
        settings=[{"title": name, "text": text} for name, text in settings.items()],
    )


def _write_page(
    path: str | Path, *, pictures: Mapping[str, bytes], **sections: Any
) -> Path:
    """Fill the template; sections without content are omitted."""
    lists = ("alerts", "tables", "labels", "joints", "sheets")
    none: dict[str, Any] = dict.fromkeys(lists, ())
    page = _template().render(
        **(none | {"provenance": None} | sections),
        version=__version__,
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        pictures=[
            {"title": title, "data": inline_picture(data)}
            for title, data in pictures.items()
        ],
        versions=versions_table(),
    )
    return write_whole(path, page)


def _drives(runs: Mapping[str, Run]) -> list[DriveMap]:
    """Drives of all runs; drives of equal name, level and design hash appear once."""
    drives: dict[tuple[str, str, str], DriveMap] = {}
    for run in runs.values():
        for transmission in run.assembly.transmissions:
            drive = transmission.drive
            key = (drive.name, drive.level, str(drive.info.get("design_hash")))
            drives.setdefault(key, drive)
    return list(drives.values())


def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("swgjoint.view.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=False,
    )
    return environment.get_template("report.html")

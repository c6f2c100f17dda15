"""Runs as one HTML file that needs nothing else: no script, no address, no font."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swgjoint import __version__
from swgjoint.files import write_whole
from swgjoint.json_text import json_text
from swgjoint.progress import Progress, silent
from swgjoint.toml_text import toml_text
from swgjoint.view.recording.blueprint import joints_by_interest
from swgjoint.view.report.plots import joint_png
from swgjoint.view.report.tables import (
    Table,
    _joint_table,
    alerts,
    inline_picture,
    label_table,
    provenance_table,
    sheet_table,
    summary_table,
    versions_table,
)
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
    """Write runs of one motion as a self-contained page, whole or not at all.

    Comparison, validity with an error estimate of every result, plots of every joint,
    spec sheet of every drive, settings of the scene and provenance.

    Args:
        runs: Runs by the name that the report shows; a lone run may be called ``""``.
        path: File to write; its folder must exist.
        summary: Table on top; that of the runs if None.
        pictures: PNG below it by title.
        check_step: Whether every run is repeated at half its step.
        progress: Called with what is done.
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
    for joint in joints:
        panels.append(
            {
                "title": short(joint),
                "picture": inline_picture(joint_png(runs, joint)),
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
        pictures=pictures or {},
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
    """Write results that are no runs of a scene as a page of the same kind.

    Args:
        path: File to write; its folder must exist.
        title: Of the page.
        description: Below the title.
        tables: The first is the summary, the others follow the pictures.
        pictures: PNG by title.
        settings: Texts by title.
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
    """Fill the template; sections that are not given are left out."""
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
    """Drives of all runs, each once."""
    found: dict[tuple[str, str, str], DriveMap] = {}
    for run in runs.values():
        for transmission in run.assembly.transmissions:
            drive = transmission.drive
            key = (drive.name, drive.level, str(drive.info.get("design_hash")))
            found.setdefault(key, drive)
    return list(found.values())


def _template() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("swgjoint.view.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=False,
    )
    return environment.get_template("report.html")

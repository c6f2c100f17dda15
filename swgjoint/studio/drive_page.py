"""Page of the drive: fields of the design, its teeth, figures and comparison."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nicegui import events, ui

from swgjoint.errors import DesignError
from swgjoint.files import file_name
from swgjoint.models_path import bundled_names
from swgjoint.studio.draft import differences, open_bundled, open_file
from swgjoint.studio.fields import list_fields, text_of
from swgjoint.studio.form import Form
from swgjoint.studio.parts import Downloads, PlacedPicture, progress_bar, show_progress
from swgjoint.studio.session import Session
from swgjoint.studio.work import figure_rows
from swgjoint.toml_text import toml_text

REQUESTS = {
    "sheet ring": "map and data sheet, thin rings on a ball bearing (a minute)",
    "sheet 2d": "map and data sheet, 2D (minutes)",
    "sheet 3d": "map and data sheet, 3D (a quarter of an hour)",
    "meshing 2d": "meshing over half a turn, 2D (seconds)",
    "meshing 3d": "meshing over half a turn, 3D (minutes)",
}
"""Computations on request: what and fidelity."""


class DrivePage:
    """Elements of the page of the drive, updated in place.

    Args:
        session: State of the tab.
        tab: Identifier of the tab.
    """

    def __init__(self, session: Session, tab: str) -> None:
        self._session, self._tab = session, tab
        with ui.row().classes("w-full no-wrap gap-0"):
            with (
                ui.column()
                .classes("pane bg-white q-pa-sm gap-1")
                .style("width:410px; flex:none")
            ):
                self._source()
                self._loose = ui.label().classes("fault")
                self._form = Form(session)
            with ui.column().classes("pane q-pa-md gap-3").style("flex:1; min-width:0"):
                self._results()

    def _source(self) -> None:
        with ui.row().classes("w-full no-wrap items-center gap-2"):
            ui.select(
                bundled_names("drives", ".toml"),
                label="start from a bundled design",
                on_change=self._open_bundled,
                with_input=True,
            ).props("dense outlined data-key=source").style("flex:1")
            upload = ui.upload(
                auto_upload=True, max_file_size=2_000_000, on_upload=self._open_file
            ).classes("hidden")
            upload.props("accept=.toml")
            ui.button(
                "open TOML", on_click=lambda: upload.run_method("pickFiles")
            ).props("outline dense no-caps").classes("q-px-sm")

    def _results(self) -> None:
        session = self._session
        with ui.row().classes("w-full items-center gap-2"):
            self._keep = ui.button("keep as A", on_click=session.keep)
            self._keep.props("dense no-caps data-key=keep").classes("q-px-sm")
            self._swap = ui.button("edit A instead", on_click=session.swap)
            self._drop = ui.button("drop A", on_click=session.drop)
            save = ui.button("save TOML", on_click=self._save)
            for button, key in (
                (self._swap, "swap"),
                (self._drop, "drop"),
                (save, "save"),
            ):
                button.props(f"dense no-caps outline data-key={key}").classes("q-px-sm")
            self._bar = progress_bar("drive-progress")
        with ui.row().classes("w-full no-wrap gap-3"):
            self._kept_card = ui.card().classes("q-pa-sm").style("flex:1; min-width:0")
            with self._kept_card:
                ui.label("A (kept)").classes("text-weight-medium")
                self._kept_teeth = PlacedPicture("kept-teeth")
            with ui.card().classes("q-pa-sm").style("flex:1; min-width:0"):
                self._title = ui.label().classes("text-weight-medium")
                self._teeth = PlacedPicture("teeth")
        with ui.row().classes("w-full no-wrap gap-3 items-start"):
            with ui.card().classes("q-pa-sm gap-1").style("flex:none; width:420px"):
                self._figures = (
                    ui.table(rows=[], columns=_columns([""]))
                    .props("dense flat data-key=figures")
                    .classes("w-full")
                )
                self._note = ui.label().classes("text-caption text-grey-8")
                self._changes = (
                    ui.label().classes("text-caption").style("white-space: pre-wrap")
                )
            with ui.card().classes("q-pa-sm").style("flex:1; min-width:0"):
                self._looks = PlacedPicture("looks")
        with ui.card().classes("q-pa-sm w-full gap-1"):
            with ui.expansion("checks of the teeth").classes("w-full"):
                self._checks = (
                    ui.table(
                        rows=[],
                        columns=[
                            {"name": n, "label": n, "field": n, "align": "left"}
                            for n in ("check", "value")
                        ],
                    )
                    .props("dense flat")
                    .classes("w-full")
                )
        with ui.card().classes("q-pa-sm w-full gap-2"):
            with ui.row().classes("items-center gap-2 w-full"):
                ui.select(
                    REQUESTS,
                    label="finer computation",
                    value=session.request,
                    on_change=lambda e: setattr(session, "request", e.value),
                ).props("dense outlined data-key=request").style("width:340px")
                ui.button("compute", on_click=session.compute).props(
                    "dense no-caps data-key=compute"
                )
                ui.button("stop", on_click=lambda: session.stop("request")).props(
                    "dense no-caps outline"
                )
                self._request_bar = progress_bar("request-progress")
            self._request_fault = ui.label().classes("fault")
            self._files = Downloads(self._tab)

    def update(self) -> None:
        """Show the state of the session."""
        session, current, kept = (
            self._session,
            self._session.current,
            self._session.kept,
        )
        verdict = current.shown.verdict if current.shown else None
        beside = verdict.faults_by_key(current.draft) if verdict else {}
        self._form.update(beside)
        loose = (
            [f for f in verdict.faults if not any(f in b for b in beside.values())]
            if verdict
            else []
        )
        self._loose.text = "\n".join([*loose, current.fault])
        self._title.text = "B (edited)" if kept else "teeth in mesh"
        if current.shown and current.shown.teeth:
            self._teeth.show(current.shown.teeth)
        self._teeth.dim(current.design is None)
        self._kept_card.visible = kept is not None
        if kept and kept.shown and kept.shown.teeth:
            self._kept_teeth.show(kept.shown.teeth)
        self._keep.set_enabled(current.design is not None)
        for button in (self._swap, self._drop):
            button.set_enabled(kept is not None)
        self._figure_table()
        self._looks.show(session.picture)
        self._looks.dim(current.look is None)
        self._changes.text = _change_text(session)
        rows = current.shown.checks if current.shown else ()
        self._checks.rows = [{"check": a, "value": b} for a, b in rows]
        show_progress(self._bar, session.jobs, ("show", "look", "draw"))
        show_progress(self._request_bar, session.jobs, ("request",))
        old = "computed before the last change of the design"
        self._request_fault.text = session.fault or (
            old if session.files_are_old else ""
        )
        self._files.show(session.files, session.version)
        self._files.dim(session.files_are_old)

    def _figure_table(self) -> None:
        looks = self._session.looks()
        current = self._session.current.look
        self._figures.style(f"opacity: {1.0 if current else 0.35}")
        if current is None:
            return
        self._figures.columns = _columns(list(looks))
        self._figures.rows = figure_rows(looks)
        errors = (
            f"errors at {current.angle.size} angles of an output turn (peak to peak: a"
            " lower bound), superposed on a rigid wave generator"
            if current.superposed
            else "errors over one tooth pitch"
        )
        left = f"; left out: {current.left_out}" if current.left_out else ""
        self._note.text = (
            f"coarse 2D at {current.rated:.4g} N·m, no friction; {errors}{left};"
            f" {current.wall_s:.1f} s. Not validated: a data sheet is."
        )

    def _open_bundled(self, event: events.ValueChangeEventArguments) -> None:
        if event.value:
            self._session.replace(open_bundled(event.value))

    async def _open_file(self, event: events.UploadEventArguments) -> None:
        try:
            draft = open_file(await event.file.read(), self._session.folder)
        except DesignError as error:
            ui.notify(f"{event.file.name}: {error}", type="negative", multi_line=True)
            return
        self._session.replace(draft)

    def _save(self) -> None:
        design = self._session.current.design
        if design is None:
            ui.notify("the design has faults", type="negative")
            return
        text = toml_text(design.model_dump(exclude_unset=True, exclude_none=True))
        ui.download.content(text, f"{file_name(design.drive.name)}.toml")


def _columns(labels: Sequence[str]) -> list[dict[str, Any]]:
    """Columns of the table of figures, one for each label."""
    left = {"name": "figure", "label": "figure", "field": "figure", "align": "left"}
    values = [
        {"name": f"v{k}", "label": label or "value", "field": f"v{k}", "align": "right"}
        for k, label in enumerate(labels)
    ]
    return [left, *values]


def _change_text(session: Session) -> str:
    """Keys in which the two variants differ, one line each."""
    if session.kept is None:
        return ""
    units = {f.key: f.unit for f in list_fields(session.current.draft)}
    lines = [
        f"{key}: {text_of(a) or '-'} → {text_of(b) or '-'} {units.get(key, '')}".strip()
        for key, a, b in differences(session.kept.draft, session.current.draft)
    ]
    return "\n".join(["A → B", *lines]) if lines else "A and B are the same design"

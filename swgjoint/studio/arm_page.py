"""Page of the arm: scene, drives of its joints, run, figures and report."""

from __future__ import annotations

from functools import partial
from typing import Any, get_args
from urllib.parse import quote

from nicegui import ui

from swgjoint.drives.sections import Level
from swgjoint.maps.from_catalogue import catalogue_names
from swgjoint.models_path import bundled_names
from swgjoint.studio.parts import Downloads, progress_bar, show_frame, show_progress
from swgjoint.studio.session import THIS_DESIGN, Session
from swgjoint.view.report.tables import ripple_cell
from swgjoint.view.words import above_noise, format_figure

_COLUMNS = {
    "joint": "joint",
    "ripple_rms_percent": "torque ripple rms [% of rated]",
    "ripple_pp_percent": "torque ripple pp [% of rated]",
    "transmission": "transmission error pp [arcmin]",
    "torsion": "torsion [arcmin]",
    "peak": "peak torque [N·m]",
    "limit": "repeated peak [N·m]",
    "within": "within ratings",
}
"""Columns of the table of joints."""


class ArmPage:
    """Elements of the page of the arm, updated in place.

    Args:
        session: State of the tab.
        tab: Identifier of the tab.
        address: Address of the studio, which ends with a slash.
    """

    def __init__(self, session: Session, tab: str, address: str) -> None:
        self._session = session
        self._recording = f"{address}files/{tab}/run.rrd"
        self._drives: dict[str, str] | None = None
        self._metrics: dict[str, Any] | None = None
        names = [*bundled_names("scenes", ".toml"), *bundled_names("arms", ".xml")]
        with ui.row().classes("w-full no-wrap gap-0"):
            with (
                ui.column()
                .classes("pane bg-white q-pa-sm gap-2")
                .style("width:410px; flex:none")
            ):
                ui.select(
                    list(dict.fromkeys([*names, session.source])),
                    label="scene or arm, or path of a file (TOML, MJCF, URDF)",
                    value=session.source,
                    with_input=True,
                    new_value_mode="add-unique",
                    on_change=lambda e: session.choose(e.value) if e.value else None,
                ).props("dense outlined data-key=scene").classes("w-full")
                ui.select(
                    {"": "level of the scene", **{one: one for one in get_args(Level)}},
                    label="level of the joints",
                    value=session.level,
                    on_change=lambda e: session.choose_level(e.value),
                ).props("dense outlined").classes("w-full")
                ui.label("drives").classes("text-weight-medium")
                self._joints = ui.column().classes("w-full gap-1")
                with ui.row().classes("items-center gap-2"):
                    ui.button("run", on_click=session.run).props(
                        "dense no-caps data-key=run"
                    )
                    ui.button("stop", on_click=lambda: session.stop("arm")).props(
                        "dense no-caps outline"
                    )
                self._bar = progress_bar("arm-progress")
                self._fault = (
                    ui.label()
                    .classes("fault")
                    .props("data-key=arm-fault")
                    .style("white-space: pre-wrap")
                )
            with ui.column().classes("pane q-pa-md gap-3").style("flex:1; min-width:0"):
                with ui.card().classes("q-pa-sm w-full gap-1") as self._card:
                    self._verdict = (
                        ui.label()
                        .classes("text-weight-medium")
                        .props("data-key=verdict")
                        .style("white-space: pre-wrap")
                    )
                    self._tool = ui.label()
                    self._table = (
                        ui.table(
                            rows=[],
                            columns=[
                                {
                                    "name": key,
                                    "label": label,
                                    "field": key,
                                    "align": "left" if key == "joint" else "right",
                                }
                                for key, label in _COLUMNS.items()
                            ],
                        )
                        .props("dense flat data-key=joints")
                        .classes("w-full")
                    )
                self._play = ui.button("play the recording", on_click=self._show_viewer)
                self._play.props("dense no-caps outline data-key=play")
                self._viewer = ui.column().classes("w-full")
                self._files = Downloads(tab)

    def update(self) -> None:
        """Show the state of the session."""
        session = self._session
        if self._drives is not session.drives:
            self._drives = session.drives
            self._build_joints()
        show_progress(self._bar, session.jobs, ("arm", "joints"))
        old = "run before the last change of drives, level or design"
        self._fault.text = session.arm_fault or (old if session.run_is_old else "")
        self._card.visible = self._play.visible = session.metrics is not None
        if session.metrics is not self._metrics:
            self._metrics = session.metrics
            self._viewer.clear()
            if self._metrics is not None:
                self._show(self._metrics)
        self._files.show(session.arm_files, session.version)
        self._files.dim(session.run_is_old)
        self._card.style(f"opacity: {0.35 if session.run_is_old else 1.0}")

    def _build_joints(self) -> None:
        self._joints.clear()
        others = [*catalogue_names(), *bundled_names("drives", ".toml")]
        with self._joints:
            for joint, drive in self._session.drives.items():
                with ui.row().classes("w-full no-wrap items-center gap-2"):
                    ui.label(joint).classes("field-label").style("flex:1")
                    chosen = self._session.chosen.get(joint, drive)
                    ui.select(
                        list(dict.fromkeys([drive, THIS_DESIGN, *others, chosen])),
                        value=chosen,
                        with_input=True,
                        on_change=partial(self._chosen, joint),
                    ).props(f'dense outlined data-key="drive-{joint}"').style(
                        "width:220px; flex:none"
                    )

    def _chosen(self, joint: str, event: Any) -> None:
        if event.value:
            self._session.choose_drive(joint, event.value)

    def _show_viewer(self) -> None:
        """Show the recording of the last run in the rerun viewer."""
        self._viewer.clear()
        url = quote(f"{self._recording}?v={self._session.version}", safe="")
        with self._viewer:
            show_frame(f"/viewer/?url={url}")

    def _show(self, metrics: dict[str, Any]) -> None:
        self._verdict.text = "\n".join([metrics["verdict"], *metrics["reasons"]])
        tool = metrics["tool"]
        parts = [
            f"{text} {format_figure(tool[key])} mm"
            for key, text in (
                ("path_rms_mm", "deviation from the path, rms"),
                ("path_max_mm", "largest"),
                ("ap_mm", "AP"),
                ("rp_mm", "RP"),
            )
            if tool.get(key) is not None
        ]
        self._tool.text = f"tool: {', '.join(parts)}" if parts else ""
        self._table.rows = [
            {
                "joint": name,
                **{
                    key: ripple_cell([one], key).text
                    for key in ("ripple_rms_percent", "ripple_pp_percent")
                },
                "transmission": _shown(one["transmission_error_arcmin"]["pp"]),
                "torsion": _shown(one["torsion_arcmin"]["mean"]),
                "peak": format_figure(one["ratings"]["peak_Nm"]),
                "limit": format_figure(one["ratings"]["repeated_peak_Nm"]),
                "within": "yes" if one["ratings"]["within"] else "no",
            }
            for name, one in metrics["joints"].items()
        ]


def _shown(value: float) -> str:
    """Text of a torsion or an error [arcmin]; a dash below the noise."""
    return format_figure(above_noise(value))

"""Small elements that both pages use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from nicegui import ui

from swgjoint.pictures import inline_picture
from swgjoint.studio.jobs import Job


class PlacedPicture:
    """A PNG picture that is replaced in place.

    Args:
        key: Name of the picture in the page.
    """

    def __init__(self, key: str) -> None:
        self._image = (
            ui.html("", sanitize=False).classes("w-full").props(f"data-key={key}")
        )
        self._data: bytes | None = None

    def show(self, data: bytes | None) -> None:
        """Show another picture, unless it is the same."""
        if data is not self._data:
            self._data = data
            source = f"data:image/png;base64,{inline_picture(data)}" if data else ""
            self._image.set_content(
                f'<img src="{source}" style="width:100%">' if data else ""
            )

    def dim(self, out_of_date: bool) -> None:
        """Draw a picture that belongs to an earlier state in grey."""
        self._image.style(f"opacity: {0.35 if out_of_date else 1.0}")


def progress_bar(key: str) -> ui.label:
    """Place a line of text for the progress of computations."""
    return ui.label().classes("text-caption text-blue-9").props(f"data-key={key}")


def show_progress(
    label: ui.label, jobs: Mapping[str, Job], purposes: Sequence[str]
) -> None:
    """Show the stage of the first running computation of some purposes.

    Args:
        label: Text that is replaced.
        jobs: Computations by purpose.
        purposes: Purposes, the most important first.
    """
    running = [jobs[p] for p in purposes if p in jobs]
    label.text = f"⏳ {running[0].stage or 'computing'}" if running else ""


def show_frame(address: str) -> None:
    """Show another page inside this one."""
    ui.element("iframe").props(f'src="{address}"').style(
        "width:100%; height:75vh; border:1px solid #ddd; background:white"
    )


class Downloads:
    """Links to result files, and the first of them, a page, in a frame.

    Args:
        tab: Identifier of the tab.
    """

    def __init__(self, tab: str) -> None:
        self._tab = tab
        self._box = ui.column().classes("w-full gap-1")
        self._shown: list[str] = []

    def show(self, files: list[str], version: int) -> None:
        """Show other files, unless they are the same list.

        Args:
            files: Names of the files, the page first.
            version: Number that changes with the content of the page.
        """
        if files is self._shown:
            return
        self._shown = files
        self._box.clear()
        if not files:
            return
        with self._box:
            with ui.row().classes("gap-4"):
                for name in files:
                    ui.link(f"save {name}", f"/files/{self._tab}/{name}").props(
                        f"download={name}"
                    )
            address = f"/files/{self._tab}/{files[0]}?v={version}"
            show_frame(address)

    def dim(self, out_of_date: bool) -> None:
        """Draw files that belong to an earlier state in grey."""
        self._box.style(f"opacity: {0.35 if out_of_date else 1.0}")

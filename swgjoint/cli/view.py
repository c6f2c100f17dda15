"""``swgjoint view``: open a recording in the native viewer or a web page."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any
from urllib.parse import quote

from swgjoint.errors import InputError

RRD_MAGIC = (b"RRF", b"RRIO")
"""First bytes of a recording, compressed or uncompressed."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: recording, kind of viewer."""
    parser.add_argument("file", metavar="FILE.rrd", help="recording to open")
    parser.add_argument(
        "--web",
        action="store_true",
        help="serve the viewer as a web page on the loopback interface; default: on a"
        " machine without display",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Start the viewer in the background.

    Returns:
        ``file``, ``url`` (None for the native viewer) and ``pid``, the process ID of
        the viewer. Ending that process ends the viewer.

    Raises:
        InputError: If the file cannot be read or is not a recording.
    """
    path = _recording(args.file)
    from swgjoint.view.recording.viewer import (
        LOOPBACK,
        free_port,
        start_viewer,
        wait_for,
    )

    display = sys.platform in ("darwin", "win32") or any(
        os.environ.get(key) for key in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if display and not args.web:
        process, _ = start_viewer(str(path))
        return {"file": str(path), "url": None, "pid": process.pid}
    page = free_port()
    process, stream = start_viewer(
        str(path), "--serve-web", "--web-viewer-port", str(page)
    )
    wait_for(page, process)
    url = f"http://{LOOPBACK}:{page}/?url={quote(stream, safe='')}"
    return {"file": str(path), "url": url, "pid": process.pid}


def report(result: dict[str, Any]) -> str:
    """Format where the recording is shown and how to end the viewer."""
    where = result["url"] or "the rerun viewer"
    return f"{result['file']}: {where}\nto end the viewer: kill {result['pid']}"


def _recording(name: str) -> Path:
    """Path of a recording that exists and has the right format."""
    path = Path(name)
    try:
        with path.open("rb") as file:
            head = file.read(4)
    except OSError as exc:
        raise InputError(
            f"recording {name!r}: cannot be read: {exc.strerror}"
        ) from None
    if not head.startswith(RRD_MAGIC):
        raise InputError(f"{name!r} is not a recording; accepted: a rerun file (.rrd)")
    return path

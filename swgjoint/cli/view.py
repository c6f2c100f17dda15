"""``swgjoint view``: open a recording, native or as a page on this machine."""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import quote

from swgjoint.errors import ComputationError, InputError

_VIEWERS: list[subprocess.Popen[bytes]] = []

RRD_MAGIC = (b"RRF", b"RRIO")
"""First bytes of a recording, compressed or not."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Recording, and where to show it."""
    parser.add_argument("file", metavar="FILE.rrd", help="recording")
    parser.add_argument(
        "--web",
        action="store_true",
        help="serve a page on loopback; default where there is no display",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Start the viewer in the background.

    Returns:
        ``url`` (None for the native viewer) and ``pid`` of the viewer; ending that
        process ends the page.
    """
    path = _recording(args.file)
    viewer = _viewer()
    display = sys.platform in ("darwin", "win32") or any(
        os.environ.get(key) for key in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if display and not args.web:
        process = _start([str(viewer), str(path)])
        return {"file": str(path), "url": None, "pid": process.pid}
    stream, page = _free_port(), _free_port()
    process = _start(
        [
            str(viewer),
            str(path),
            "--serve-web",
            "--bind",
            "127.0.0.1",
            "--port",
            str(stream),
            "--web-viewer-port",
            str(page),
        ]
    )
    _wait_for(process, page)
    source = quote(f"rerun+http://127.0.0.1:{stream}/proxy", safe="")
    url = f"http://127.0.0.1:{page}/?url={source}"
    return {"file": str(path), "url": url, "pid": process.pid}


def report(result: dict[str, Any]) -> str:
    """Where to look, and how to end it."""
    where = result["url"] or "the rerun viewer"
    return f"{result['file']}: {where}\nend it with: kill {result['pid']}"


def _recording(name: str) -> Path:
    path = Path(name)
    try:
        with path.open("rb") as file:
            head = file.read(4)
    except OSError as exc:
        raise InputError(f"recording {name!r}: {exc.strerror}") from None
    if not head.startswith(RRD_MAGIC):
        raise InputError(f"recording {name!r}: not a rerun recording (.rrd)")
    return path


def _viewer() -> Path:
    """The viewer's own program inside the rerun package."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise ComputationError("the rerun viewer is missing: pip install rerun-sdk")
    folder = Path(found.origin).parent
    for name in ("rerun", "rerun.exe"):
        if (folder / name).is_file():
            return folder / name
    raise ComputationError(
        f"the rerun viewer is missing in {folder}: pip install --force-reinstall"
        " rerun-sdk"
    )


def _start(command: list[str]) -> subprocess.Popen[bytes]:
    """Start a viewer that outlives this command."""
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    _VIEWERS.append(process)  # Python would complain about one that it forgets
    return process


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait_for(process: subprocess.Popen[bytes], port: int, limit: float = 15.0) -> None:
    """Return when the page answers."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if process.poll() is not None:
            raise ComputationError(
                f"the rerun viewer ended at once with status {process.returncode}"
            )
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    process.terminate()
    raise ComputationError(f"the rerun viewer did not answer within {limit:.0f} s")

"""Pages of the rerun viewer, which show recordings without leaving this machine."""

from __future__ import annotations

import subprocess
import threading
from functools import cache
from urllib.error import HTTPError
from urllib.parse import quote
from urllib.request import urlopen

from fastapi import HTTPException
from fastapi.responses import Response

from swgjoint.errors import ComputationError
from swgjoint.view.recording.viewer import LOOPBACK, free_port, start_viewer, wait_for

POLICY = "default-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob: data:"
"""Content security policy of the viewer: its telemetry, its fonts and its search for
updates would otherwise reach other machines."""

_STARTING = threading.Lock()
"""Held while the server starts, so that two pages do not start two of them."""


def viewer_file(name: str = "") -> Response:
    """Page, script or program of the viewer, whose server starts with the first one.

    Args:
        name: Name of the file; empty for the page.
    """
    try:
        with _STARTING:
            end_viewer(ended=True)  # another one starts if it was killed
            address = _viewer()[1]
        with urlopen(f"{address}{quote(name)}") as answer:
            kind, content = answer.headers["content-type"], answer.read()
    except HTTPError as error:
        error.close()
        raise HTTPException(status_code=error.code) from None
    except ComputationError as error:  # the viewer is not installed
        raise HTTPException(status_code=503, detail=str(error)) from None
    return Response(
        content, media_type=kind, headers={"Content-Security-Policy": POLICY}
    )


def end_viewer(*, ended: bool = False) -> None:
    """End the server of the viewer, if it has been started.

    Args:
        ended: Whether to forget a server that has ended, and to leave others alone.
    """
    if not _viewer.cache_info().currsize:
        return
    process = _viewer()[0]
    if ended and process.poll() is None:
        return
    process.terminate()
    process.wait()
    _viewer.cache_clear()


@cache
def _viewer() -> tuple[subprocess.Popen[bytes], str]:
    """Process and address of the server of the viewer."""
    port = free_port()
    process, _ = start_viewer("--serve-web", "--web-viewer-port", str(port))
    wait_for(port, process)
    return process, f"http://{LOOPBACK}:{port}/"

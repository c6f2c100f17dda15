"""The rerun viewer as a process of this machine that listens on loopback only."""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from swgjoint.errors import ComputationError

LOOPBACK = "127.0.0.1"
STARTED: list[subprocess.Popen[bytes]] = []
"""Python would complain about a process that it forgets."""


def start_viewer(
    *options: str, port: int | None = None
) -> tuple[subprocess.Popen[bytes], str]:
    """Start a viewer, or a server of it, that outlives this process.

    Args:
        *options: Of the viewer's program: files, ``--serve-web``, ``--serve-grpc``.
        port: At which it takes streams; a free one if None.

    Returns:
        The process and the address for streams.
    """
    port = free_port() if port is None else port
    # without --bind it would listen on every interface
    command = [str(viewer_program()), "--bind", LOOPBACK, "--port", str(port)]
    return _start([*command, *options]), f"rerun+http://{LOOPBACK}:{port}/proxy"


def viewer_program() -> Path:
    """The viewer's own program inside the rerun package.

    Raises:
        ComputationError: If it is not there.
    """
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


def free_port() -> int:
    """A port of loopback on which nothing listens now."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def wait_for(
    port: int,
    process: subprocess.Popen[bytes] | None = None,
    *,
    limit: float = 60.0,
) -> None:
    """Return when something listens at a port of loopback.

    Args:
        port: Of loopback.
        process: Who should listen there; ended where it does not in time.
        limit: Of the wait [s].

    Raises:
        ComputationError: If nothing does, or the process ends.
    """
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if process is not None and process.poll() is not None:
            raise ComputationError(
                f"the rerun viewer ended at once with status {process.returncode}"
            )
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.1)
    if process is not None:
        process.terminate()
    raise ComputationError(
        f"no rerun viewer answers at port {port} of this machine within {limit:.0f} s"
    )


def _start(command: Sequence[str]) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    STARTED.append(process)
    return process

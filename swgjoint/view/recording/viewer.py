"""Start the rerun viewer as a process that listens on the loopback interface only."""

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
"""Started processes; Python would warn if a running one were garbage-collected."""


def start_viewer(*options: str) -> tuple[subprocess.Popen[bytes], str]:
    """Start a viewer or its server; it continues to run after this process ends.

    Args:
        *options: Command-line arguments of the viewer, such as files,
            ``--serve-web`` or ``--serve-grpc``.

    Returns:
        The process and the address to which streams are sent, on a free port.

    Raises:
        ComputationError: If the viewer is not installed.
    """
    port = free_port()
    # without --bind it would listen on all network interfaces
    command = [str(viewer_program()), "--bind", LOOPBACK, "--port", str(port)]
    return _start([*command, *options]), f"rerun+http://{LOOPBACK}:{port}/proxy"


def viewer_program() -> Path:
    """Path of the viewer's executable in the rerun package.

    Raises:
        ComputationError: If the executable is missing.
    """
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ComputationError("the rerun viewer is missing: pip install rerun-sdk")
    folder = Path(package.origin).parent
    for name in ("rerun", "rerun.exe"):
        if (folder / name).is_file():
            return folder / name
    raise ComputationError(
        f"the rerun viewer is missing in {folder}: pip install --force-reinstall"
        " rerun-sdk"
    )


def free_port() -> int:
    """Return a loopback port on which no process currently listens."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def wait_for(
    port: int,
    process: subprocess.Popen[bytes] | None = None,
    *,
    limit: float = 60.0,
) -> None:
    """Wait until a process listens on a loopback port.

    Args:
        port: Loopback port.
        process: Process that should listen; it is terminated if nothing listens in
            time. None if another program started it.
        limit: Longest waiting time [s].

    Raises:
        ComputationError: If nothing listens in time, or the process ends.
    """
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if process is not None and process.poll() is not None:
            raise ComputationError(
                "the rerun viewer exited during startup with status"
                f" {process.returncode}"
            )
        with socket.socket() as probe:
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return
        time.sleep(0.1)
    if process is not None:
        process.terminate()
    raise ComputationError(
        f"no rerun viewer answered on port {port} of this machine within {limit:.0f} s"
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

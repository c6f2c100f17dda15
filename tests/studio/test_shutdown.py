"""Ctrl+C ends the server with one line, whatever its tasks do."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys

import pytest

from swgjoint.view.recording.viewer import free_port, wait_for

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not importlib.util.find_spec("nicegui"), reason="needs the extra studio"
    ),
]
STUBBORN = """
import asyncio, sys
from nicegui import app, background_tasks
from swgjoint.studio.server import serve_studio

async def lose_one_cancellation():
    try:
        await asyncio.sleep(3600)
    except asyncio.CancelledError:
        await asyncio.sleep(3600)

app.on_startup(lambda: background_tasks.create(lose_one_cancellation()))
try:
    serve_studio(int(sys.argv[1]), show=False)
except KeyboardInterrupt:
    pass
"""


def test_a_task_that_loses_its_cancellation_ends_in_silence():
    """NiceGUI's complaint of such a task does not reach the user."""
    port = free_port()
    # NiceGUI behaves differently in processes that know of a test
    known = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    process = subprocess.Popen(
        [sys.executable, "-Pc", STUBBORN, str(port)],
        stderr=subprocess.PIPE,
        text=True,
        env=known,
    )
    wait_for(port, process, limit=120.0)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 0

"""Ctrl-C reaches all processes of a command, which ends with one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest
from solved import few_teeth

from swgjoint.cli.main import INTERRUPTED

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs process groups")

POOL = """
import sys, time
import joblib  # takes longer than starting the processes
from swgjoint.cli.main import INTERRUPTED
from swgjoint.pool import run_all

try:
    print(file=sys.stderr, flush=True)
    run_all(time.sleep, [0.1] * 400, jobs=2)
except KeyboardInterrupt:
    sys.exit(INTERRUPTED)
"""


def start(*arguments, **variables):
    """A command in a process group of its own, as a shell starts it."""
    return subprocess.Popen(
        [sys.executable, "-P", *map(str, arguments)],
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # the tests may run in the background, where shells ignore the signal
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )


def interrupt(process):
    """Send the signal of Ctrl-C to the group; exit status and what is printed since."""
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    with pytest.raises(ProcessLookupError):  # no process is left, not even a zombie
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            os.killpg(process.pid, 0)
            time.sleep(0.05)
    return process.returncode, out, err


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2, 0.35])
def test_starting_processes_print_nothing(delay):
    """While they are started, import modules, and run tasks."""
    process = start("-c", POOL)
    process.stderr.readline()
    time.sleep(delay)
    assert interrupt(process) == (INTERRUPTED, "", "")


@pytest.mark.fe
@pytest.mark.parametrize("delay", [0.2, None])
def test_a_lot_ends_with_one_line_and_keeps_its_drives(delay, tmp_path):
    """While its processes start, and once drives are finished."""
    design, cache = tmp_path / "drive.toml", tmp_path / "cache"
    text = few_teeth("reference-2d-tolerances").to_toml()
    design.write_text(text, encoding="utf-8")
    lot = ("lot", design, "--drives", 200, "--verbose")
    process = start("-m", "swgjoint", *lot, SWGJOINT_CACHE=str(cache))
    shown = "0/200" if delay is not None else "10/200"
    while f": drives: {shown}" not in process.stderr.readline():
        assert process.poll() is None
    time.sleep(delay or 0.0)
    status, out, err = interrupt(process)
    assert (status, out) == (INTERRUPTED, "")
    lines = [line for line in err.splitlines() if ": drives: " not in line]
    assert lines == ["swgjoint: interrupted"]
    if delay is None:
        assert len(list((cache / "lots").iterdir())) > 10

"""A recording that cannot be written whole."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (20480, 20480))
from swgjoint.cli.main import main
sys.exit(main("run bench --quiet --out out".split()))
"""


@pytest.mark.slow  # builds a map
def test_a_full_disk_ends_the_recording(tmp_path):
    """The first block that cannot be written ends the run with status 1, not in a wait.

    A limit of the file size, which the blueprint exceeds, stands for the full disk: the
    writer of the recording ended, and the program waited for it forever.
    """
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 1 and "disk may be full" in done.stderr
    assert not (tmp_path / "out" / "run.rrd").exists()

"""The table of changes that the tests must notice."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_every_change_can_be_applied():
    """Each text occurs once in the code of today."""
    table = [sys.executable, str(Path(__file__).parent / "mutations.py"), "--check"]
    done = subprocess.run(table, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

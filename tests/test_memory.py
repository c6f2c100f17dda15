"""Memory that a process keeps for its next arrays."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys
import numpy as np
from swgjoint.memory import keep_freed_memory

if sys.argv[1] == "keep":
    keep_freed_memory()

def add_arrays():
    one = np.ones(300_000)
    return sum(float((one + k)[0]) for k in range(20))

add_arrays()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
add_arrays()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a setting of glibc")
def test_arrays_reuse_the_pages_of_freed_ones():
    """Twenty arrays of 2.4 MB cause no page faults, but do so by default."""
    faults = [
        int(subprocess.check_output([sys.executable, "-c", PROGRAM, what], text=True))
        for what in ("default", "keep")
    ]
    pages = 300_000 * 8 // 4096
    assert faults[0] > pages and faults[1] < 0.1 * pages

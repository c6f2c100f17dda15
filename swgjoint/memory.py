"""Memory of this process: what fits in, and what it keeps for reuse."""

from __future__ import annotations

import os
from pathlib import Path

from swgjoint.errors import ComputationError

INTERPRETER = 0.25e9
"""Memory of the Python process with its libraries [B]."""

KEPT = 256 << 20
"""Freed memory at the end of the heap that the process keeps [B]."""
IN_HEAP = 32 << 20
"""Size from which on an array gets pages of its own [B]; the largest that glibc takes.
"""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h of glibc


def keep_freed_memory() -> None:
    """Keep freed memory for the next arrays of this process.

    By default, glibc returns the memory of arrays of a megabyte to the kernel as soon
    as they are freed, and the kernel clears all pages of the next array. The function
    does nothing with other C libraries.
    """
    import ctypes

    if os.name != "posix":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_TRIM_THRESHOLD, KEPT)
        mallopt(_M_MMAP_THRESHOLD, IN_HEAP)


def available_memory() -> float | None:
    """Free memory of this machine or container [B]; None if it is unknown."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024.0 * float(line.split()[1]))
        limit = Path("/sys/fs/cgroup/memory.max").read_text().strip()
        used = float(Path("/sys/fs/cgroup/memory.current").read_text())
        if limit != "max":
            found.append(float(limit) - used)
    except (OSError, ValueError, IndexError):
        pass
    if not found and hasattr(os, "sysconf") and "SC_AVPHYS_PAGES" in os.sysconf_names:
        found.append(float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")))
    return min(found) if found else None


def require_memory(what: str, required: float, *, less: str) -> None:
    """Reject a computation that would not fit in memory.

    Args:
        what: Name of the computation, for the message.
        required: Estimated peak memory [B].
        less: Suggestion that reduces the required memory, for the message.

    Raises:
        ComputationError: If less than ``required`` is free.
    """
    free = available_memory()
    if free is not None and required > free:
        raise ComputationError(
            f"{what} needs about {required / 1e9:.1f} GB; {free / 1e9:.1f} GB are free;"
            f" try {less}"
        )

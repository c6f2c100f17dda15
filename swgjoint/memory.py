"""Check that a computation fits in memory before it starts."""

from __future__ import annotations

import os
from pathlib import Path

from swgjoint.errors import ComputationError

INTERPRETER = 0.25e9
"""Memory of the Python process with its libraries [B]."""


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

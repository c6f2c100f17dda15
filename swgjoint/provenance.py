"""Provenance of benchmark results."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from swgjoint import __version__

PACKAGES = ("mujoco", "numpy", "scipy", "scikit-fem")
"""Packages whose versions are recorded."""


def provenance(*, seed: int | None = None) -> dict[str, Any]:
    """Collect commit, package versions, machine and date of a result.

    Args:
        seed: Seed of the random numbers; None if there are no random numbers.

    Returns:
        A mapping for JSON. Its ``commit`` is None outside a checkout and ends with
        ``+`` if files of the package have changed since that commit.
    """
    versions: dict[str, str | None] = {
        "swgjoint": __version__,
        "python": platform.python_version(),
    }
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    return {
        "commit": _commit(),
        "versions": versions,
        "machine": {
            "system": f"{platform.system()} {platform.machine()}",
            "processor": _processor(),
            "cores": os.cpu_count(),
        },
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
    }


def _commit() -> str | None:
    here = Path(__file__).parent

    def git(*arguments: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", *arguments],
                cwd=here,
                capture_output=True,
                text=True,
                timeout=10,
                check=True,
            )
        except (OSError, subprocess.SubprocessError):
            return None
        return done.stdout.strip()

    # an installed package may be inside the checkout of another project
    if not git("ls-files", "errors.py"):
        return None
    commit = git("rev-parse", "--short=12", "HEAD")
    changed = git("status", "--porcelain", "--untracked-files=no", ".")
    return commit and commit + ("+" if changed else "")


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor()

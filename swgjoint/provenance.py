"""Where the figures of a benchmark come from."""

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


def provenance(*, seed: int | None = None) -> dict[str, Any]:
    """Commit, versions, machine, date.

    Args:
        seed: Of whatever was drawn; None where nothing was.

    Returns:
        ``commit`` is None outside a checkout, and ends ``+`` where files of the
        package differ from it.
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

    # a checkout of something else may lie above an installed package
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

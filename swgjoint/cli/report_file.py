"""The HTML report beside the other files of a command."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from swgjoint.errors import MissingExtraError


def report_file(runs: Mapping[str, Any], folder: Path, **options: Any) -> list[str]:
    """Write ``report.html``; a warning and nothing where its extra is missing.

    Args:
        runs: Runs of one motion by name.
        folder: An existing folder.
        **options: Of :func:`swgjoint.view.report.write_report`.

    Returns:
        The path, or nothing.
    """
    from swgjoint.view.report import write_report

    try:
        return [str(write_report(runs, folder / "report.html", **options))]
    except MissingExtraError as exc:
        warnings.warn(str(exc), stacklevel=2)
        return []

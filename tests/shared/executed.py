"""Notebooks of the guide, executed once in a run, by the first test that needs them."""

from __future__ import annotations

import importlib.util
import os
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from filelock import FileLock

GUIDE = Path(__file__).parents[2] / "notebooks" / "guide"


@cache
def executed_pages() -> ModuleType:
    """The module that Sphinx calls."""
    path = GUIDE / "executed_pages.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pages_folder() -> Path:
    """Folder of the executed notebooks of this run."""
    folder = Path(os.environ["SWGJOINT_TEST_CACHE"]) / "examples"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def executed(source: Path) -> Any:
    """The executed notebook; another process that executes it is waited for."""
    page = pages_folder() / f"{source.stem}.ipynb"
    with FileLock(page.with_suffix(".lock")):
        return executed_pages().write_page(source, page)

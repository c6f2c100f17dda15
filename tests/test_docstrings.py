"""Examples in docstrings run, and give what they show."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import swgjoint

PACKAGE = Path(swgjoint.__file__).parent
FILES = [
    path
    for path in sorted(PACKAGE.rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_examples_run(path):
    """Every example of a module, as a reader would type it."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    found = doctest.testmod(import_module(".".join(("swgjoint", *parts))))
    assert found.attempted > 0
    assert found.failed == 0


def test_there_are_examples():
    """At least twenty functions show how they are called."""
    finder = doctest.DocTestFinder()
    names = set()
    for path in FILES:
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        module = import_module(".".join(("swgjoint", *parts)))
        names |= {test.name for test in finder.find(module) if test.examples}
    assert len(names) >= 20

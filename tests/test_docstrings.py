"""Examples in docstrings run, and give what they show."""

from __future__ import annotations

import ast
import doctest
from collections.abc import Iterator
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


def public_functions(node: ast.AST) -> Iterator[ast.FunctionDef]:
    """Functions and methods whose name, like that of their class, is public."""
    for child in ast.iter_child_nodes(node):
        if getattr(child, "name", "_").startswith("_"):
            continue
        if isinstance(child, ast.ClassDef):
            yield from public_functions(child)
        elif isinstance(child, ast.FunctionDef):
            yield child


def test_arguments_are_described():
    """Public functions with two or more arguments say what each means."""
    silent = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for function in public_functions(ast.parse(path.read_text(encoding="utf-8"))):
            if any(ast.unparse(one) == "overload" for one in function.decorator_list):
                continue
            given = function.args
            names = [one.arg for one in [*given.posonlyargs, *given.args]]
            names += [one.arg for one in given.kwonlyargs]
            text = ast.get_docstring(function) or ""
            if len(set(names) - {"self", "cls"}) > 1 and "Args:" not in text:
                silent.append(f"{path.relative_to(PACKAGE)}: {function.name}")
    assert silent == []

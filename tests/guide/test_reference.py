"""The reference pages are what the code gives, and leave nothing without text."""

from __future__ import annotations

import ast
import importlib.util
import inspect
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import swgjoint
from swgjoint.cli.main import COMMANDS, command_parser
from swgjoint.explore.schema import KINDS, described_keys, file_schema

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def reference():
    """The script that writes the pages."""
    path = ROOT / "notebooks" / "guide" / "write_reference.py"
    spec = importlib.util.spec_from_file_location("write_reference", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_pages_are_current(reference):
    """If this fails: python notebooks/guide/write_reference.py writes them again."""
    old = [
        path.relative_to(ROOT).as_posix()
        for path, text in reference.pages().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    assert old == []


def is_plain(row):
    """Whether a key accepts numbers or texts only."""
    types = {form.get("type") for form in row["forms"]}
    return types <= {"number", "integer", "string", "boolean"} and types != {None}


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_has_a_meaning_and_a_valid_example(kind, reference):
    """The schema accepts every example; tables have keys with examples instead."""
    bundled, written = reference.examples(kind), reference.written_examples(kind)
    root = file_schema(kind)
    silent, wrong = [], []
    for row in reference.rows_of(kind):
        if not row["meaning"]:
            silent.append(row["key"])
        if row["table"]:
            continue
        value = reference.example(row, bundled, written)
        forms = {"anyOf": row["forms"], "$defs": root.get("$defs", {})}
        if value is None or not Draft202012Validator(forms).is_valid(value):
            wrong.append((row["key"], row["of_kind"], value))
    assert silent == [] and wrong == []
    assert not any(row["table"] for row in reference.rows_of(kind) if is_plain(row))
    keys = {row["key"] for row in described_keys(root)}
    keys |= {key.rpartition(".")[2] for key in keys}
    assert set(written) <= keys


def test_a_key_without_text_is_noticed(reference, monkeypatch):
    """A field without a docstring has no meaning in the schema."""
    from swgjoint.explore import schema

    kept = schema.meanings
    without = {"arm"}
    monkeypatch.setattr(
        schema,
        "meanings",
        lambda cls: {k: v for k, v in kept(cls).items() if k not in without},
    )
    silent = [row["key"] for row in reference.rows_of("scene") if not row["meaning"]]
    assert silent == ["arm"]


def test_every_option_has_a_meaning(reference):
    """Arguments of all commands, and the keys of their JSON objects."""
    page = reference.command_page()
    for name in COMMANDS:
        actions = command_parser(name)._actions
        assert [a.dest for a in actions if not (a.help or "").strip()] == []
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        assert "JSON object: " in section
        for action in actions:
            row = reference._option(action)
            assert row in section or row in page.partition("\n## ")[0], (name, row)


def test_every_public_name_is_described():
    """Classes and functions of the top level, and the public methods of the classes."""
    silent = []
    for name in swgjoint.__all__:
        found = getattr(swgjoint, name)
        if name.startswith("_"):
            continue
        if not inspect.getdoc(found):
            silent.append(name)
        tree = ast.parse(inspect.getsource(found).lstrip()).body[0]
        for node in getattr(tree, "body", []) if isinstance(found, type) else []:
            public = isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
            if public and not ast.get_docstring(node):
                silent.append(f"{name}.{node.name}")
    assert silent == []

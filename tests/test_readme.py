"""What the README tells to type is there."""

from __future__ import annotations

import ast
import re
import shlex
from importlib import import_module
from pathlib import Path

import pytest

import swgjoint
from swgjoint.cli.main import COMMANDS, Parser
from swgjoint.models_path import bundled_names

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def shown_commands() -> list[str]:
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    parts = [part.strip() for line in lines for part in line.split("&&")]
    return [part for part in parts if part.startswith("swgjoint")]


def test_the_two_commands():
    """Install and demo, install and test: verbatim, each in a line of its own."""
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    assert "python3 -m pip install . && swgjoint demo" in lines
    assert "python3 -m pip install '.[test]' && pytest -n 2" in lines


@pytest.mark.parametrize("shown", shown_commands())
def test_shown_commands_parse(shown):
    """Each command line of the README is accepted by that command's parser."""
    _, name, *arguments = shlex.split(shown, comments=True)
    assert name in COMMANDS
    parser = Parser(prog=name, allow_abbrev=False)
    import_module(f"swgjoint.cli.{name}").configure(parser)
    args = parser.parse_args(arguments)
    if getattr(args, "design", None) is not None:
        assert args.design in bundled_names("drives", ".toml")
    if hasattr(args, "scene"):
        arms = bundled_names("arms", ".xml") if name == "run" else []
        assert args.scene in (*bundled_names("scenes", ".toml"), *arms)


def test_shown_python_uses_public_names():
    """The Python examples compile and use names that the package has."""
    assert blocks("python")
    for block in blocks("python"):
        for node in ast.walk(ast.parse(block)):
            if (
                isinstance(node, ast.Attribute)
                and ast.unparse(node.value) == "swgjoint"
            ):
                assert hasattr(swgjoint, node.attr), node.attr


def test_named_files_exist():
    """Paths that the README names in the repository exist."""
    root = Path(__file__).parents[1]
    named = re.findall(r"`((?:models|notebooks|tests|swgjoint)/[\w./-]+)`", README)
    assert named
    assert [path for path in named if not (root / path).exists()] == []

"""The first figures of the quick start are those that its commands print."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from swgjoint.cli.main import main

PAGE = Path(__file__).parents[2] / "notebooks" / "guide" / "quick-start.md"
SECTION = PAGE.read_text(encoding="utf-8").partition("## First figures in seconds")[2]
COMMANDS = re.findall(r"^swgjoint (run .*)$", SECTION, re.MULTILINE)
RIPPLES = re.findall(r"([\d.]+) %", SECTION.partition("\n## ")[0])


def check(command, stated, capsys):
    assert main([*shlex.split(command), "--json", "--quiet"]) == 0
    result = json.loads(capsys.readouterr().out)
    (joint,) = result["joints"].values()
    assert result["verdict"] == "VALID"
    assert joint["ripple_valid"] is not False
    assert not joint["ripple_is_lower_bound"]
    assert f"{joint['ripple_pp_percent']:.3f}" == stated


def test_ripple_of_a_catalogue_drive(capsys):
    """Valid without a mark, and printed as stated."""
    assert len(COMMANDS) == len(RIPPLES) == 2
    check(COMMANDS[0], RIPPLES[0], capsys)


@pytest.mark.slow
@pytest.mark.fe
def test_ripple_of_a_bundled_design(capsys):
    """Valid without a mark, and printed as stated."""
    check(COMMANDS[1], RIPPLES[1], capsys)

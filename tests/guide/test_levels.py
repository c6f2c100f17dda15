"""The errors in the table of the levels are those that its command measures."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from swgjoint.cli.main import main
from swgjoint.joint.attach import LEVELS

PAGE = Path(__file__).parents[2] / "notebooks" / "guide" / "levels.md"
TEXT = PAGE.read_text(encoding="utf-8")
ROW = re.compile(r"^\| `(\w+)` \|.*", re.MULTILINE)
ERROR = re.compile(r"([\d.]+) at ([\d.]+) ms")


def stated_errors():
    """Errors of the table by level and step [arcmin]."""
    table = TEXT.partition("## Levels of a joint")[2].partition("\n## ")[0]
    return {
        (row[1], float(step)): text
        for row in ROW.finditer(table)
        for text, step in ERROR.findall(row[0])
    }


def test_every_level_has_an_error():
    """Rigid and linear too."""
    assert {level for level, _ in stated_errors()} == set(LEVELS)


@pytest.mark.slow
def test_errors_are_measured_by_the_command(capsys):
    """Printed to the digits of the table, which rounding may change by one."""
    command = next(line for line in TEXT.splitlines() if line.startswith("swgjoint "))
    assert main([*shlex.split(command)[1:], "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    measured = {
        (row["level"], 1e3 * row["step_s"]): row["error"]
        for row in rows
        if row["error"] is not None
    }
    for place, text in stated_errors().items():
        last = 10.0 ** -len(text.partition(".")[2])
        assert measured[place] == pytest.approx(float(text), abs=last), place

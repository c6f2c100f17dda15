"""Results of the commands are those that were frozen, within round-off."""

from __future__ import annotations

import json

import guide_tables
import pytest
from golden import CASES, design_hashes, differences, load, result_of, run


def check(name, found):
    """The places that differ, which is where to look."""
    found = json.loads(json.dumps(found))
    assert list(differences(result_of(load(name)), found)) == []


def test_hashes_of_designs():
    """Kept results of all bundled designs stay valid."""
    assert design_hashes() == load("designs")


@pytest.mark.parametrize("name", CASES["quick"])
def test_quick_commands(name, tmp_path):
    """Tables, checks, catalogue drives, a bench run."""
    check(name, run(name, CASES["quick"][name], tmp_path))


@pytest.mark.slow
@pytest.mark.fe
@pytest.mark.parametrize("name", CASES["slow"])
def test_slow_commands(name, tmp_path):
    """Finite elements, arms, searches, studies."""
    check(name, run(name, CASES["slow"][name], tmp_path))


@pytest.mark.parametrize("name", guide_tables.TABLES)
def test_tables_of_the_guide_are_those_of_frozen_results(name):
    """Caption, date, commit and every cell are as the command writes them."""
    path, content = guide_tables.page_text(name)
    assert path.read_text(encoding="utf-8") == content

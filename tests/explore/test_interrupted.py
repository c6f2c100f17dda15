"""A command that was killed goes on when it is given again."""

from __future__ import annotations

from pathlib import Path

import pytest
from interrupted import Case, finished, interrupted, prepared, stored
from solved import few_teeth

SWEEP = """
design = "few.toml"
[meshing]
figures = ["von_mises_MPa"]
positions = 1
[plan]
kind = "latin_hypercube"
designs = 5
seed = 1
[[plan.parameters]]
keys = ["flexspline.rim_mm"]
low = 0.9
high = 1.3
"""
KEPT = stored("out/results/*/*.json")


@pytest.mark.fe
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
def test_a_killed_sweep_goes_on(tmp_path):
    """Same rows, only designs in flight are computed again, nothing is left behind.

    ``tests/benchmarks/interruptions.py`` kills other commands at random times.
    """
    case = Case(
        name="sweep",
        arguments=("sweep", "sweep.toml", "--out", "out", "--jobs", "2"),
        inputs={"few.toml": few_teeth().to_toml(), "sweep.toml": SWEEP},
        unit="designs",
        begins="swgjoint.explore.sweep.figures:compute",
        kept=KEPT,
    )
    whole = prepared(case, tmp_path / "whole")
    printed = finished(case, whole)
    folder = prepared(case, tmp_path / "killed")
    found = interrupted(case, folder, lambda: len(KEPT(folder)) > 1, (whole, printed))
    assert found is not None and 2 <= found.kept < 5
    assert found.same and found.again == 0
    # one task in each of two processes, of the designs that fill about two seconds
    assert found.begun >= found.kept and 0 <= found.twice <= 5 - found.kept
    assert found.litter == found.left == ()

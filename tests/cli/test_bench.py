"""``swgjoint bench``."""

from __future__ import annotations

import json

import pytest

from swgjoint.cli.main import main
from swgjoint.study import fe_cost
from swgjoint.study.fe_cost import Setting


@pytest.mark.fe
def test_bench_fe(monkeypatch, capsys):
    """One JSON object with a row for every setting and quantity, then as a table."""
    settings = tuple(Setting(model="2d", refinement=n) for n in (0.5, 1.0))
    monkeypatch.setattr(
        fe_cost.run_fe_cost,
        "__kwdefaults__",
        {**fe_cost.run_fe_cost.__kwdefaults__, "settings": settings},
    )
    assert main(["bench", "fe", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert len(result["rows"]) == 6
    keys = {"bench", "model", "setting", "error", "unit", "wall_s", "reference"}
    for row in result["rows"]:
        assert keys | {"outcome"} <= set(row)
        assert row["reference"] == "2d, refinement 1"
    assert main(["bench"]) == 0
    text = capsys.readouterr().out
    assert "refinement 0.5" in text
    assert "torsional_stiffness_Nm_rad" in text


def test_bench_refuses_a_plane_design(capsys):
    """One line, exit status 2."""
    assert main(["bench", "fe", "--design", "reference-2d"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert "reference-2d: bench fe goes by the model in space" in lines[0]
    assert "accepted: a design with one" in lines[0] and "--model" not in lines[0]

"""``swgjoint bench``."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from messages import names
from solved import small_cup

from swgjoint.bench.fe import cost as fe_cost
from swgjoint.bench.fe.setting import FeSetting
from swgjoint.bench.scaling import scaling
from swgjoint.cli import bench
from swgjoint.cli.bench import fe_text, scaling_text
from swgjoint.cli.main import main

SMALL = small_cup()


@pytest.mark.fe
def test_bench_fe(monkeypatch, capsys, tmp_path):
    """One JSON object with a row for every setting and quantity, then as a table."""
    settings = (
        FeSetting(model="ring", refinement=0),
        *(FeSetting(model="2d", refinement=n) for n in (0.5, 0.6)),
    )
    monkeypatch.setattr(
        fe_cost.run_fe_cost,
        "__kwdefaults__",
        {**fe_cost.run_fe_cost.__kwdefaults__, "settings": settings},
    )
    out = tmp_path / "out"
    path = tmp_path / "small.toml"
    path.write_text(SMALL.to_toml(), encoding="utf-8")
    arguments = ["bench", "fe", "--design", str(path)]
    assert main([*arguments, "--json", "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert len(result["rows"]) == 12
    keys = {"bench", "model", "setting", "error", "unit", "wall_s", "reference"}
    for row in result["rows"]:
        assert keys | {"outcome", "peak_MB", "cores", "pareto"} <= set(row)
        assert row["reference"] == "2d, refinement 0.6"
        assert row["peak_MB"] > 50.0  # of a process of its own
    names = {path.name for path in out.iterdir()}
    table = {f"bench-fe.{suffix}" for suffix in ("json", "csv", "png")}
    assert names == table
    text = fe_text.report(result)
    assert "refinement 0.5" in text
    assert "torsional_stiffness_Nm_rad" in text
    assert "cheapest within" in text and "15 %" in text


def test_bench_refuses_a_plane_design(capsys):
    """One line, exit status 2."""
    assert main(["bench", "fe", "--design", "reference-2d"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert names(lines[0], "reference-2d", "bench fe", "[cup]", "reference-3d-modified")
    assert "--model" not in lines[0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            ["all", "--only", "nonsense"],
            ("--only", "nonsense", "ur5e", "iiwa14", "bench"),
        ),
        (["joint", "--only", ","], ("--only", "'',''", "ur5e", "iiwa14", "bench")),
        (["joint", "--only", ""], ("--only", "''", "ur5e", "iiwa14", "bench")),
        (["fe", "--only", "bench"], ("--only", "bench fe", "bench joint", "all")),
        (["--only", "bench"], ("--only", "bench fe", "bench joint", "all")),
        (["joint", "--design", "x"], ("--design", "bench joint", "bench fe", "all")),
    ],
)
def test_bench_refuses_before_it_works(given, message, monkeypatch, capsys):
    """Options that are wrong, or of another part: one line, and no part has begun."""

    def begun(*_):
        raise AssertionError("a part has begun")

    monkeypatch.setattr(bench, "_run_part", begun)
    assert main(["bench", *given]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and names(lines[0], *message)


def test_bench_scaling(monkeypatch, capsys, tmp_path):
    """Rows and fits; then as a table with the exponents."""
    sweeps = [sweep for sweep in scaling.SWEEPS if sweep.name in ("joints", "batch")]
    small = [replace(sweep, sizes=(1, 8, 16)) for sweep in sweeps]
    monkeypatch.setitem(scaling.run_scaling.__kwdefaults__, "sweeps", small)
    assert main(["bench", "scaling", "--json", "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [row["size"] for row in result["rows"]] == [1, 8, 16, 1, 8, 16]
    keys = {"bench", "model", "setting", "error", "unit", "wall_s", "reference"}
    assert all(keys | {"outcome"} <= set(row) for row in result["rows"])
    assert {fit["sweep"] for fit in result["fits"]} == {"joints", "batch"}
    assert len(list(tmp_path.iterdir())) == 3
    assert "size^" in scaling_text.report(result)

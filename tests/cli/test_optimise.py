"""``swgjoint optimise``: JSON contract, files, bad input."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.cli.optimise import _best
from swgjoint.gear.design.design import Design

pytest.importorskip("optuna", reason="needs swgjoint[tune]")

TEXT = """
description = "small and long"
design = "reference-2d"
beside = ["reference-2d-dca"]
[size]
figures = ["volume_cm3", "length_mm"]
[[objectives]]
figure = "volume_cm3"
[[objectives]]
figure = "length_mm"
goal = "maximise"
[plan]
kind = "nsga2"
designs = 12
population = 6
[[plan.parameters]]
keys = ["circular_spline.rim_mm"]
low = 1.0
high = 5.0
[[plan.parameters]]
keys = ["drive.face_width_mm"]
low = 5.0
high = 25.0
[confirm]
designs = 2
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "some.toml"
    path.write_text(TEXT)
    return path


def test_json_and_files(file, tmp_path, capsys):
    """The front as table and as designs that load; a second run computes nothing."""
    out = tmp_path / "out"
    arguments = ["optimise", str(file), "--jobs", "1", "--out", str(out)]
    assert main([*arguments, "--json"]) == 0
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert "search: 12/12" in captured.err
    assert (result["evaluations"], result["generations"]) == (12, 2)
    assert result["wall_s"] > 0.0 and result["failed"] == 0
    assert result["start"]["design"] == "reference-2d"
    assert [row["design"] for row in result["beside"]] == ["reference-2d-dca"]
    assert result["start"]["confirmed"]["length_mm"] == 10.0
    # members of the same size: the thinnest rim for its length beats all or is beaten
    volumes = [row["volume_cm3"] for row in result["front"]]
    assert volumes == sorted(volumes)
    assert sum(row["confirmed"] is not None for row in result["front"]) == 2
    names = [Path(name).name for name in result["files"]]
    count = len(result["front"])
    fronts = [f"front-{k + 1:02d}.toml" for k in range(count)]
    assert names == [*fronts, "tried.csv", "optimise.png", "optimise.json"]
    assert json.loads((out / "optimise.json").read_text()) == result
    for name, row in zip(fronts, result["front"], strict=True):
        design = Design.load(out / name)
        assert design.circular_spline.rim_mm == row["circular_spline.rim_mm"]
        assert design.drive.face_width_mm == row["drive.face_width_mm"]
        assert design.drive.name == f"reference-2d-{name.removesuffix('.toml')}"
    with (out / "tried.csv").open() as text:
        assert len(list(csv.DictReader(text))) == 12
    # left by a search with a longer front
    (out / f"front-{count + 1:02d}.toml").write_text("old")
    (out / "front-ours.toml").write_text("the user's")
    assert main(arguments) == 0
    found = {path.name for path in out.glob("front*")}
    assert found == {*fronts, "front-ours.toml"}
    told = capsys.readouterr().out
    assert "12 designs tried in 2 generations, 0 failed; 0 comp" in told
    assert "volume_cm3: minimise, length_mm: maximise" in told
    assert "*: confirmed" in told


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        (["none"], 2, ("'none'", "models/optimisations", "qca-stress")),
        (["FILE", "--jobs", "0"], 2, ("--jobs", "0", "1", "1024")),
        (
            ["FILE", "--jobs", "2", "--scheduler", "tcp://a:1"],
            2,
            ("--jobs", "--scheduler", "one"),
        ),
        (
            ["BAD"],
            2,
            ("bad.toml", "objectives[0].figure", "'kg'", "volume_cm3", "length_mm"),
        ),
        (["HARD"], 1, ("12 designs", "limits")),
    ],
)
def test_bad_input_is_one_line(arguments, status, told, file, tmp_path, capsys):
    """What, where, and what would be accepted; no traceback."""
    limit = '[[limits]]\nfigure = "length_mm"\nmost = 1.0\n[plan]'
    others = {
        "FILE": file,
        "BAD": file.with_name("bad.toml"),
        "HARD": file.with_name("hard.toml"),
    }
    bad = TEXT.replace('figure = "volume_cm3"', 'figure = "kg"')
    others["BAD"].write_text(bad)
    others["HARD"].write_text(TEXT.replace("[plan]", limit))
    given = [str(others.get(name, name)) for name in arguments]
    if "--jobs" not in given:
        given += ["--jobs", "1"]
    out = tmp_path / "out"
    assert main(["optimise", *given, "--out", str(out)]) == status
    error = capsys.readouterr().err
    assert names(error, *told) and "Traceback" not in error
    assert not list(out.glob("optimise.*"))


def test_figures_that_nobody_can_tell_stay_empty():
    """Of a confirmed design as of one that the search alone has seen."""
    row = {"a": 2.0, "b": None, "confirmed": {"outcome": "ok", "a": None, "b": 3.0}}
    assert _best(row, ["a", "b"]) == ["", "3*"]
    assert _best({**row, "confirmed": None}, ["a", "b"]) == ["2", ""]
    assert _best({**row, "confirmed": {"outcome": "failed"}}, ["a", "b"]) == ["2", ""]


def test_the_start_beyond_a_limit_is_named(file, capsys):
    """The front is better than a start that the limits exclude."""
    limit = '[[limits]]\nfigure = "volume_cm3"\nmost = 120.0\n[plan]'
    file.write_text(TEXT.replace("[plan]", limit).partition("[confirm]")[0])
    assert main(["optimise", str(file), "--jobs", "1", "--quiet"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "reference-2d: its values miss the limit of volume_cm3" in lines
    assert not any(line.startswith("front") and "limit" in line for line in lines)

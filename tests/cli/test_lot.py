"""``swgjoint lot``."""

from __future__ import annotations

import csv
import json

import pytest
from messages import names
from solved import few_teeth

from swgjoint.cli.lot import report
from swgjoint.cli.main import main


@pytest.mark.fe
def test_lot_writes_rows_and_picture(tmp_path, capsys):
    """JSON alone on stdout; one row a drive in the CSV; exit status 0."""
    spec = tmp_path / "spec.toml"
    spec.write_text("[spec]\nripple_rms_percent = 1000.0\n")
    out = tmp_path / "deep" / "out"
    design = tmp_path / "design.toml"
    design.write_text(few_teeth("reference-2d-tolerances").to_toml(), encoding="utf-8")
    arguments = ["lot", str(design), "--drives", "2", "--jobs", "1"]
    arguments += ["--spec", str(spec), "--out", str(out), "--json"]
    assert main(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    text = report(found)
    assert names(text, "output turn", "rated torque of 20 N·m", "swgjoint run")
    assert "without micro_geometry" not in text
    found["validity"]["left_out"] = "micro_geometry"
    assert "level 2d, errors superposed, without micro_geometry" in report(found)
    assert "0.95 times that of all angles in trials" in text
    assert found["yield"]["part"] == 1.0
    assert sorted(path.name for path in out.iterdir()) == [
        "lot.csv",
        "lot.json",
        "lot.png",
    ]
    with (out / "lot.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["seed"]) for row in rows] == [1, 2]
    assert float(rows[1]["ripple_rms_percent"]) == pytest.approx(
        found["rows"][1]["ripple_rms_percent"]
    )
    assert json.loads((out / "lot.json").read_text())["rows"] == found["rows"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--drives", "0"], ("--drives", "0", "1", "100000")),
        (["--jobs", "0"], ("--jobs", "0", "1", "256")),
        (["--seed", "-1"], ("--seed", "-1", "1", "2147483147")),
        (["--clearance-um", "6", "23"], ("--clearance-um", "6", "23", "ring")),
        (
            ["--model", "ring", "--clearance-um", "23", "6"],
            ("--clearance-um", "23", "6", "increasing"),
        ),
        (
            ["--model", "ring", "--clearance-um", "nan", "6"],
            ("--clearance-um", "nan", "6", "increasing"),
        ),
    ],
)
def test_bad_numbers_are_one_line(arguments, said, capsys):
    """What, the value and what is accepted; exit status 2."""
    assert main(["lot", "reference-2d-tolerances", *arguments]) == 2
    assert names(capsys.readouterr().err, *said)


def test_unknown_limit_is_one_line(tmp_path, capsys):
    """The figures of a lot, not those of a comparison, are accepted."""
    spec = tmp_path / "spec.toml"
    spec.write_text("[spec]\nvon_mises_MPa = 300.0\n")
    command = ["lot", "reference-2d-tolerances", "--spec", str(spec)]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert names(said, "spec.toml", "spec.von_mises_MPa", "300.0", "positive")
    assert names(said, "transmission_accuracy_arcmin", "ripple_rms_percent")

"""Drives and levels side by side in one scene."""

from __future__ import annotations

import json

import pytest

from swgjoint.cli.main import main
from swgjoint.study.compare import LOWER, UPPER

SHORT = ["--set", "simulation.duration_s=1.5", "--set", "trajectory.settle_s=0.3"]
STIFF, SOFT = "CSG-32-100", "CSG-14-100"


def found(capsys, *arguments, status=0):
    assert main(["compare", *arguments, *SHORT, "--json"]) == status
    return json.loads(capsys.readouterr().out)


def test_rows_come_in_the_order_given(capsys):
    """One row an argument, stiffness from the catalogue, no stress without a design."""
    result = found(capsys, SOFT, STIFF)
    assert result["scene"] == "bench" and result["passed"] is None
    assert [row["argument"] for row in result["rows"]] == [SOFT, STIFF]
    soft, stiff = result["rows"]
    # K1 of the catalogue: 0.47 and 6.7e4 N·m/rad
    assert soft["K1_Nm_rad"] == pytest.approx(0.47e4, rel=0.02)
    assert stiff["K1_Nm_rad"] == pytest.approx(6.7e4, rel=0.02)
    assert soft["von_mises_MPa"] is None
    assert {*UPPER, *LOWER, "argument", "design"} <= set(soft)


def test_levels_keep_the_drives_of_the_scene(capsys):
    """The rigid level has neither ripple nor error."""
    drive = ["--set", f"defaults.drive={STIFF}"]
    rigid, full = found(capsys, "rigid", "full", *drive)["rows"]
    assert rigid["design"] == full["design"] == STIFF
    assert rigid["level"] == "rigid" and full["level"] == "full"
    assert rigid["ripple_pp_percent"] == pytest.approx(0.0, abs=1e-6)
    assert rigid["transmission_error_arcmin"] == 0.0


def test_sorting_puts_the_best_first(capsys):
    """The stiffest drive first, where more is better."""
    rows = found(capsys, SOFT, STIFF, "--sort", "K1_Nm_rad")["rows"]
    assert [row["argument"] for row in rows] == [STIFF, SOFT]


def test_spec_decides_the_exit_status(tmp_path, capsys):
    """A missed limit is named and gives exit status 1; kept ones give 0."""
    spec = tmp_path / "spec.toml"
    spec.write_text("[spec]\nK1_Nm_rad = 1e4\npeak_torque_of_rating = 1.0\n")
    result = found(capsys, SOFT, STIFF, "--spec", str(spec), status=1)
    assert result["passed"] is False
    assert [row["missed"] for row in result["rows"]] == [["K1_Nm_rad"], []]
    assert found(capsys, STIFF, "--spec", str(spec))["passed"] is True


def test_design_has_a_stress_and_a_picture(tmp_path, capsys, monkeypatch):
    """A design brings its stress; table and picture lie in the folder."""
    monkeypatch.setattr("swgjoint.study.compare.STRESS_POSITIONS", 1)
    monkeypatch.setattr("swgjoint.fe.sampling.ANGLES", 4)
    out = tmp_path / "out"
    result = found(capsys, "reference-2d", "--out", str(out))
    (row,) = result["rows"]
    # 321 MPa at 20 N·m on the mesh of the thesis
    assert 280.0 < row["von_mises_MPa"] < 360.0
    assert sorted(p.name for p in out.iterdir()) == ["compare.json", "compare.png"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["CSG-25-101"], "CSG-25-100"),
        (["CSG-25-100", "--sort", "beauty"], "--sort beauty; accepted: ripple_rms"),
        (["CSG-25-100", "--spec", "spec.toml"], "spec.beauty = 1; accepted"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, monkeypatch, capsys):
    """What cannot be compared is refused before anything runs."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.toml").write_text("[spec]\nbeauty = 1\n")
    assert main(["compare", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert message in err

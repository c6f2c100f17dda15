"""``swgjoint tune``: the keys of the contract, files, bad input, missing extras."""

from __future__ import annotations

import json
import sys

import pytest
from messages import names

from swgjoint.cli.main import main

QUICK = ("--controller", "pd", "--evaluations", "32", "--set", "episode_s=0.5")


def test_json_of_the_contract(tmp_path, capsys):
    """One object on stdout with what was found, what it is held against, and files."""
    folder = tmp_path / "out"
    arguments = ["tune", "JointTracking-v0", *QUICK, "--out", str(folder), "--json"]
    assert main(arguments) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert set(result) >= {"best", "baseline", "evaluations", "wall_s", "summary"}
    assert result["evaluations"] == 32 and "tuning pd" in err
    best, baseline = result["best"], result["baseline"]
    assert baseline["parameters"]["damping_ratio"] == 0.7
    assert best["gains"]["stiffness_Nm_rad"] > 0.0
    saved = 1.0 - best["held_out_cost_arcmin"] / baseline["held_out_cost_arcmin"]
    assert result["improvement_percent"] == pytest.approx(100.0 * saved)
    assert len(best["held_out_costs_arcmin"]) == len(result["seeds"]["held_out"])
    files = {"tune.npz", "tune.json", "tune.png", "report.html"}
    assert {path.name for path in folder.iterdir()} == files
    # a run that is over is there at once, and the progress says so
    for more in (["--resume"], []):
        assert main([*arguments, *more]) == 0
        out, err = capsys.readouterr()
        assert json.loads(out)["best"] == best
        assert "tuning" not in err and names(err, str(folder / "tune.npz"), "32")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ["JointTracking-v1"],
            ("environment", "'JointTracking-v1'", "JointTracking-v0"),
        ),
        (
            ["ArmTracking-v0", "--set", "action=setpoint"],
            ("action", "'setpoint'", "torque"),
        ),
        (
            ["JointTracking-v0", "--controller", "none.py:Mine"],
            ("none.py", "FILE.py:NAME"),
        ),
        (
            ["JointTracking-v0", "--controller", "pid"],
            ("controller", "'pid'", "pd", "pd-feedforward", "pd-flexible"),
        ),
        (
            ["JointTracking-v0", "--optimiser", "sgd"],
            ("optimiser", "'sgd'", "de", "cma", "optuna"),
        ),
        (["JointTracking-v0", "--evaluations", "3"], ("evaluations", "3", "32", "16")),
        (["JointTracking-v0", "--minutes", "-1"], ("minutes", "-1", "> 0", "<= 1440")),
        (["JointTracking-v0", "--resume"], ("resume", "--out")),
        (
            ["JointTracking-v0", "--set", "drive=CSG-1-1"],
            ("'CSG-1-1'", "ratings.csv", "CSG-14-50"),
        ),
        (
            ["JointTracking-v0", "--set", "error_scale_arcmin=0"],
            ("error_scale_arcmin", "0 arcmin", "> 0"),
        ),
        (
            ["JointTracking-v0", "--set", "num_envs=3"],
            ("'num_envs'", "drive", "level", "effort_weight"),
        ),
        (
            ["JointTracking-v0", "--set", "threads=1"],
            ("'threads'", "drive", "level", "effort_weight"),
        ),
        (
            ["JointTracking-v0", "--set", "vectorization_mode=sync"],
            ("'vectorization_mode'", "drive", "level", "effort_weight"),
        ),
        (
            ["JointTracking-v0", "--set", "autoreset_mode=SameStep"],
            ("'autoreset_mode'", "drive", "level", "effort_weight"),
        ),
    ],
)
def test_bad_input_is_one_line(arguments, text, capsys):
    """What is not accepted, and what is; exit status 2, no traceback."""
    assert main(["tune", *arguments]) == 2
    out, err = capsys.readouterr()
    assert names(err, *text) and "Traceback" not in err and not out
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("name", ["cma", "optuna"])
def test_missing_optimiser_says_what_installs_it(name, monkeypatch, capsys):
    """Before any search, with the command."""
    monkeypatch.setitem(sys.modules, name, None)
    assert main(["tune", "JointTracking-v0", *QUICK, "--optimiser", name]) == 1
    err = capsys.readouterr()[1]
    assert names(err, name, "pip install 'swgjoint[tune]'", "de")

"""Ratings that a rule supplied are told apart from stated ones."""

from __future__ import annotations

import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.gear.ratings import rule_of
from swgjoint.maps.drive_map import DriveMap
from swgjoint.view.run import run_scene
from swgjoint.view.validity import warnings_of


def printed(capsys, *arguments):
    assert main([*arguments]) == 0
    return capsys.readouterr().out.splitlines()


def test_a_sheet_marks_ratings_by_rule(capsys, tmp_path):
    """A design states its rated torque; the momentary peak is scaled."""
    keys = "rated_torque_Nm,momentary_peak_Nm"
    file = str(tmp_path / "own.toml")
    change = "ratings.rated_torque_Nm=50"
    printed(capsys, "design", "new", "size-25-100", "--set", change, "-o", file)
    lines = printed(capsys, "spec", file, "--only", keys)
    assert any(
        line.startswith("rated torque") and line.endswith("N·m") for line in lines
    )
    peak = next(line for line in lines if line.startswith("momentary peak"))
    assert peak.endswith("N·m, by rule")
    assert names(lines[-1], "by rule", "CSG-25-100", "50 N·m")
    lines = printed(capsys, "spec", "CSG-25-100", "--only", keys)
    assert not any("by rule" in line for line in lines)
    lines = printed(capsys, "spec", "CHA-25-100", "--only", keys)
    assert sum(line.endswith("by rule") for line in lines) == 2


@pytest.mark.parametrize(
    ("drive", "keys"),
    [
        (DriveMap.from_catalogue("CSG-25-100"), 0),
        (DriveMap.linear(2e4, rated_torque=50.0), 4),
        (DriveMap.from_numbers(stiffness=2e4, rated_torque=50.0, T1=8.0), 3),
    ],
)
def test_sources_of_all_drives_are_understood(drive, keys):
    """Catalogue figures are stated; multiples of a rated torque are not."""
    assert len(rule_of(drive.ratings.source)[0]) == keys


def test_a_run_marks_an_exceeded_rating_by_rule():
    """The message names what was exceeded and that a rule made it."""
    run = run_scene(
        "bench",
        overrides={"simulation.duration_s": 1.0, "load.joint.rated_fraction": 2.5},
        drives={"reference-2d": DriveMap.linear(2e4, rated_torque=50.0)},
    )
    (line,) = [one for one in warnings_of(run.metrics()["joints"]) if "exceeded" in one]
    assert "rated 50 N·m)" in line and "repeated peak 100 N·m, by rule)" in line

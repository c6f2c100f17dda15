"""``swgjoint list``: names that the commands take, with figures of their source."""

from __future__ import annotations

import json

import pytest
from messages import names

from swgjoint.cli.list import KINDS
from swgjoint.cli.main import main
from swgjoint.cli.shared.text import table
from swgjoint.gear.ratings import rule_of
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.from_catalogue import catalogue_names
from swgjoint.models_path import bundled_names


def listed(capsys, kind):
    assert main(["list", kind, "--json"]) == 0
    return json.loads(capsys.readouterr().out)["rows"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_name_is_a_row_and_a_line(kind, capsys):
    """Rows are the bundled files, or the catalogue; the table shows each of them."""
    folder = "drives" if kind == "designs" else kind
    suffix = ".xml" if kind == "arms" else ".toml"
    expected = catalogue_names() if kind == "drives" else bundled_names(folder, suffix)
    assert [row["name"] for row in listed(capsys, kind)] == expected
    assert main(["list", kind]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:-1]] == expected


def test_drives_have_the_figures_of_their_maps(capsys):
    """Torques of the ratings and K1 within what rounded corners change."""
    kinds = set()
    for row in listed(capsys, "drives")[::5]:
        drive = DriveMap.from_catalogue(row["name"])
        assert row["rated_torque_Nm"] == drive.ratings.rated_torque
        assert row["repeated_peak_Nm"] == drive.ratings.repeated_peak
        assert abs(drive.ratio) == row["ratio"]
        K1 = drive.spec_sheet(("K1_Nm_rad",))["K1_Nm_rad"]
        assert row["K1_Nm_rad"] == pytest.approx(K1, rel=0.02)
        by_rule = bool(rule_of(drive.ratings.source)[0])
        assert row["ratings"] == ("by rule" if by_rule else "stated")
        kinds.add(row["ratings"])
    assert kinds == {"stated", "by rule"}


def test_an_arm_has_its_joints_and_mass(capsys):
    """The two links by hand: 2.70 kg, stretched out along x."""
    (row,) = [row for row in listed(capsys, "arms") if row["name"] == "two-link"]
    assert row["joints"] == ["shoulder", "elbow"]
    assert row["mass_kg"] == pytest.approx(2.70, abs=0.01)
    assert row["tool_at_zero_m"][0] == pytest.approx(0.75, abs=0.03)


def test_another_kind_is_refused_with_those_there_are(capsys):
    """One line with the kinds."""
    with pytest.raises(SystemExit) as left:
        main(["list", "robots"])
    assert left.value.code == 2
    assert names(capsys.readouterr().err, "'robots'", *KINDS)


def test_tables_align_text_left_and_numbers_right():
    """By the content of a column: marks and units do not make a number a text."""
    rows = [("a", "", "N·m", ""), ("b", "one", "! 1.5", "-"), ("c", "twelve", 10.25, 2)]
    assert table(rows, header=("", "word", "torque", "n")).splitlines() == [
        "   word    torque  n",
        "a             N·m",
        "b  one      ! 1.5  -",
        "c  twelve   10.25  2",
    ]

"""The study of the two-mass response through the command."""

from __future__ import annotations

import json
from math import pi, sqrt

import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.validation import response as study


def test_study_writes_rows_and_a_picture(tmp_path, capsys, monkeypatch):
    """Linear rows agree with their closed form; the picture lies in the folder."""
    monkeypatch.setattr(study, "AMPLITUDES", (0.002, 0.1))
    monkeypatch.setattr(study, "STEP", 2e-4)
    monkeypatch.setattr(study, "PERIOD", (4.0, 4.0))
    assert main(["study", "response", "--json", "--out", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)
    rows = [row for row in found["rows"] if row["case"].endswith("linear")]
    assert [row["quantity"] for row in rows] == ["antiresonance", "resonance"]
    for row in rows:
        assert row["ours"] == pytest.approx(row["source_value"], rel=0.01)
        assert row["converged"] == pytest.approx(row["ours"], rel=2e-3)
    full = [row["ours"] for row in found["rows"] if row["quantity"] == "resonance"]
    assert full[2] > 1.05 * full[1]  # the drive hardens
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "response-CSG-25-100.png",
        "response.csv",
        "response.json",
    ]


def asked(capsys, *options):
    assert main(["study", "response", *options, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_load_decides_the_frequencies(capsys):
    """Motor locked and free by hand, with K1 and with the mean stiffness.

    2 kg·m² on CSG-25-100, K1 3.1e4 N·m/rad, a rotor of 1 kg·m² at the output.
    """
    options = ["--load-inertia", "2", "--closed-form"]
    found = asked(capsys, *options)
    (drive,) = found["drives"]
    assert drive["load_inertia_kgm2"] == 2.0 and drive["rotor_inertia_kgm2"] == 1e-4
    K = drive["stiffness_Nm_rad"]
    assert K["K1"] == pytest.approx(3.1e4, rel=0.01) and K["mean"] > 1.3 * K["K1"]
    for key, value in K.items():
        locked, free = sqrt(value / 2.0), sqrt(value * (1.0 / 2.0 + 1.0))
        assert drive["locked_Hz"][key] == pytest.approx(locked / 2.0 / pi)
        assert drive["free_Hz"][key] == pytest.approx(free / 2.0 / pi)
    values = [row["source_value"] for row in found["rows"]]
    pairs = zip(drive["locked_Hz"].values(), drive["free_Hz"].values(), strict=True)
    assert values == [value for pair in pairs for value in pair]
    assert main(["study", "response", *options]) == 0
    text = capsys.readouterr().out
    assert names(text, "2 kg·m²", "0.0001 kg·m²", "K1", "mean stiffness", "locked")


def test_the_rotor_is_seen_through_the_ratio(capsys):
    """Twice the rotor: the motor locked does not care, free it is slower."""
    load = ["--load-inertia", "2", "--closed-form"]
    (once,) = asked(capsys, *load)["drives"]
    (twice,) = asked(capsys, *load, "--rotor-inertia", "2e-4")["drives"]
    assert twice["locked_Hz"] == once["locked_Hz"]
    ratio = sqrt((1.0 / 2.0 + 1.0 / 2.0) / (1.0 / 2.0 + 1.0))
    assert twice["free_Hz"]["K1"] == pytest.approx(ratio * once["free_Hz"]["K1"])


def test_a_given_load_is_simulated(capsys, monkeypatch):
    """The chirp finds the frequencies of the closed forms with it."""
    monkeypatch.setattr(study, "AMPLITUDES", (0.002,))
    monkeypatch.setattr(study, "STEP", 2e-4)
    monkeypatch.setattr(study, "PERIOD", (4.0, 4.0))
    found = asked(capsys, "--load-inertia", "2")
    (drive,) = found["drives"]
    rows = [row for row in found["rows"] if row["case"].endswith("linear")]
    expected = [drive["locked_Hz"]["mean"], drive["free_Hz"]["mean"]]
    assert [row["source_value"] for row in rows] == expected
    assert [row["ours"] for row in rows] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["response", "--load-inertia", "0"], ("--load-inertia", "0 kg·m²", "1e-09")),
        (["response", "--rotor-inertia", "nan"], ("--rotor-inertia", "nan kg·m²")),
        (["response", "--load-inertia", "1e6"], ("1e+06 kg·m²", "Hz", "--closed-form")),
        (["ring", "--load-inertia", "2"], ("--load-inertia", "ring", "response")),
        (["thesis", "--closed-form"], ("--closed-form", "thesis", "response")),
    ],
)
def test_inertias_that_are_not_accepted(arguments, message, capsys):
    """One line with the value, its unit and the range, before anything is computed."""
    assert main(["study", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert names(err, *message)


def test_unknown_drive_is_one_line(capsys):
    """A drive that does not exist names the nearest one."""
    assert main(["study", "response", "--only", "CSG-25-101"]) == 2
    assert names(capsys.readouterr().err, "'CSG-25-101'", "ratings.csv", "CSG-25-100")

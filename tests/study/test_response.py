"""The study of the two-mass response through the command."""

from __future__ import annotations

import json

import pytest
from messages import names

from swgjoint.cli.main import main
from swgjoint.sim import frequency_response
from swgjoint.study import response as study


def test_study_writes_rows_and_a_picture(tmp_path, capsys, monkeypatch):
    """Linear rows agree with their closed form; the picture lies in the folder."""
    monkeypatch.setattr(study, "AMPLITUDES", (0.002, 0.1))
    monkeypatch.setattr(study, "STEP", 2e-4)
    short = frequency_response.Chirp
    monkeypatch.setattr(study, "Chirp", lambda **keys: short(**keys, period=4.0))
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
        "response.json",
    ]


def test_unknown_drive_is_one_line(capsys):
    """A drive that does not exist names the nearest one."""
    assert main(["study", "response", "--only", "CSG-25-101"]) == 2
    assert names(capsys.readouterr().err, "'CSG-25-101'", "ratings.csv", "CSG-25-100")

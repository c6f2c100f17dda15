"""``swgjoint map``: the map that was built lies in the file."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from messages import names
from validation_record import made_record

from swgjoint.cli.main import main
from swgjoint.drives import build_map as builder
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.file import map_bytes
from swgjoint.maps.sheet.map_validity import NOT_VALIDATED


@pytest.fixture
def built(monkeypatch, synthetic_map):
    """Give the command a map without finite elements; the options that it asked for."""
    seen = {}
    info = {"residual": {"torque_Nm": 1e-3}, "energy_check": {"relative": 0.01}}
    drive = replace(synthetic_map, info=info)

    def build(design, **options):
        options["progress"]("samples", 1, 1)
        seen.update(options, design=design.drive.name)
        return drive

    monkeypatch.setattr(builder, "build_map", build)
    return drive, seen


def test_map_is_written(built, tmp_path, capsys):
    """The file holds the map bitwise; the JSON object its record and stiffness."""
    drive, seen = built
    path = tmp_path / "a.swg"
    options = ["-o", str(path), "--model", "2d", "--json"]
    assert main(["map", "reference-2d", *options]) == 0
    result = json.loads(capsys.readouterr().out)
    assert map_bytes(DriveMap.load(path)) == map_bytes(drive)
    assert result["residual"] == {"torque_Nm": 1e-3}
    assert result["energy_check"] == {"relative": 0.01}
    assert len(result["harmonics"]) == len(drive.orders)
    assert result["stiffness_Nm_rad"] == pytest.approx(drive.mean_stiffness)
    assert result["torque_range_Nm"] == pytest.approx(list(drive.torque_range))
    assert result["files"] == [str(path)]
    assert result["wall_s"] > 0
    assert (seen["design"], seen["model"]) == ("reference-2d", "2d")


def test_fields_are_left_out(monkeypatch, synthetic_map, fields, tmp_path):
    """The file without them holds the same drive and is far smaller."""
    drive = replace(synthetic_map, fields=fields)
    monkeypatch.setattr(builder, "build_map", lambda design, **_: drive)
    whole, lean = tmp_path / "whole.swg", tmp_path / "lean.swg"
    assert main(["map", "reference-2d", "-o", str(whole)]) == 0
    assert main(["map", "reference-2d", "--no-fields", "-o", str(lean)]) == 0
    assert DriveMap.load(whole).fields is not None
    assert map_bytes(DriveMap.load(lean)) == map_bytes(synthetic_map)
    assert lean.stat().st_size < 0.5 * whole.stat().st_size


def test_report(built, tmp_path, capsys):
    """The terminal names the file, the residual and the energy check."""
    path = tmp_path / "a.swg"
    assert main(["map", "reference-2d", "-o", str(path)]) == 0
    out = capsys.readouterr().out
    assert str(path) in out.splitlines()[0]
    assert "residual torque [N·m]" in out
    assert "energy check relative" in out


@pytest.mark.parametrize("model", ["ring", "3d"])
def test_fidelities_that_are_not_there(model, tmp_path, capsys):
    """A fidelity that cannot be built yet is bad input in one line, nothing written."""
    path = tmp_path / "a.swg"
    assert main(["map", "reference-2d", "-o", str(path), "--model", model]) == 2
    _, err = capsys.readouterr()
    assert err.count("\n") == 1
    assert not path.exists()


LOOP = """torque_Nm,torsion_arcmin
0,0.0
40,4.2
80,8.1
40,4.4
0,0.3
-40,-4.0
-80,-8.0
-40,-4.3
0,-0.2
40,4.1
80,8.1
"""


def test_measured_loop_becomes_a_map(tmp_path, capsys):
    """A CSV file with teeth and rated torque gives a map of its mean stiffness."""
    loop, path = tmp_path / "loop.csv", tmp_path / "a.swg"
    loop.write_text(LOOP)
    measured = ["--measured-teeth", "200/202", "--measured-rated", "80"]
    assert main(["map", str(loop), "-o", str(path), *measured, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["level"] == "measurement"
    # 160 N·m over 16.1 arcmin
    secant = 160.0 / (16.1 * np.pi / 10800.0)
    assert result["stiffness_Nm_rad"] == pytest.approx(secant, rel=0.05)
    assert result["info"]["fit"]["torsion"]["samples"] == 11
    assert DriveMap.load(path).ratio == -100
    fit = result["fit"]
    for key in ("hysteresis_loss_arcmin", "lost_motion_arcmin"):
        assert fit[key].keys() == {"measured", "predicted"}
    assert fit["rms_arcmin"] > 0.0
    assert main(["map", str(loop), "-o", str(path), *measured]) == 0
    out = capsys.readouterr().out.splitlines()
    assert any(names(line, "measured", "map") for line in out)
    assert sum(line.startswith("warning: ") for line in out) == len(fit["warnings"])


def test_lost_hysteresis_and_noise_of_a_loop_are_printed(tmp_path, capsys):
    """Noise of a tenth of the torsion: what it costs the map is in the text."""
    rng = np.random.default_rng(1)
    leg = np.linspace(-90.0, 90.0, 91)
    torque = np.concatenate([leg[45:], leg[-2::-1], leg[1:]])
    noise = rng.normal(size=torque.size)
    loop, path = tmp_path / "loop.csv", tmp_path / "a.swg"
    rows = np.column_stack([torque, torque / 9.0 + noise])
    np.savetxt(loop, rows, "%.6g", ",", header="torque_Nm,torsion_arcmin", comments="")
    measured = ["--measured-teeth", "200/202", "--measured-rated", "80"]
    assert main(["map", str(loop), "-o", str(path), *measured]) == 0
    out = capsys.readouterr().out.splitlines()
    assert any(names(line, "warning", "the loops differ", "rms") for line in out)
    assert any(names(line, "no hysteresis in the map", "noise") for line in out)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["loop.csv"], ("loop.csv", "--measured-teeth FS/CS", "--measured-rated NM")),
        (["loop.csv", "--model", "2d"], ("--model 2d", "measured loop")),
        (
            ["loop.csv", "--measured-teeth", "200", "--measured-rated", "8"],
            ("--measured-teeth", "200", "FS/CS"),
        ),
        (
            ["reference-2d", "--measured-rated", "8"],
            ("--measured-rated", "design", ".csv"),
        ),
    ],
)
def test_measured_loop_needs_its_drive(
    arguments, message, tmp_path, monkeypatch, capsys
):
    """What a loop does not tell is asked for in one line; nothing is written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop.csv").write_text(LOOP)
    assert main(["map", *arguments, "-o", "a.swg"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and names(err, *message)
    assert not (tmp_path / "a.swg").exists()


@pytest.mark.parametrize(
    ("rows", "parts"),
    [
        ({5.0: (0.02, 0.03)}, ()),
        ({5.0: (0.02, 0.13)}, ("warning", "13 %", "loaded output error", "5 N·m")),
        ({5.0: (0.52, 0.13)}, ("not valid", "52 %", "input torque", "5 N·m")),
    ],
)
def test_validation_is_printed_and_judged(built, tmp_path, capsys, rows, parts):
    """The table, one line above 10 % and another above 30 %; the record in the JSON."""
    drive, _ = built
    record = made_record(rows)
    object.__setattr__(drive, "info", {**drive.info, "validation": record})
    path = tmp_path / "a.swg"
    assert main(["map", "reference-2d", "-o", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    (head,) = [line for line in lines if line.startswith("validation")]
    table = lines[lines.index(head) + 1 :]
    assert names(head, "11", "5 N·m")
    assert all(names(line, "5") for line in table[1:4])
    assert [names(line, *parts) for line in table[4:]] == [True] * bool(parts)
    assert main(["map", "reference-2d", "-o", str(path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["validation"] == record and result["validation_reason"] is None
    assert result["energy_check"] == {"relative": 0.01}
    assert "validation" not in result["info"]


def test_a_map_without_validation_says_so_once(built, tmp_path, capsys):
    """One phrase in the terminal, null with a reason in the JSON."""
    path = tmp_path / "a.swg"
    assert main(["map", "reference-2d", "-o", str(path)]) == 0
    assert capsys.readouterr().out.count(NOT_VALIDATED) == 1
    assert main(["map", "reference-2d", "-o", str(path), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["validation"] is None
    assert names(result["validation_reason"], NOT_VALIDATED)


def test_the_torque_range_ends_where_samples_do(built, tmp_path, capsys):
    """The mean curve of a map with errors goes on beyond its last sample."""
    drive, _ = built
    sampled = [0.8 * drive.torque_range[0], 2.0 * drive.torque_range[1]]
    info = {**drive.info, "sampled_torque_Nm": sampled}
    object.__setattr__(drive, "info", info)
    options = ["-o", str(tmp_path / "a.swg"), "--json"]
    assert main(["map", "reference-2d", *options]) == 0
    found = json.loads(capsys.readouterr().out)["torque_range_Nm"]
    assert found == pytest.approx([sampled[0], drive.torque_range[1]])

"""``swgjoint study articles``: rows, parts, failures, what the solid model finds."""

from __future__ import annotations

import json
from math import nan, pi

import pytest
from messages import names, naming

from swgjoint.cli.main import main
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.models_path import models_path
from swgjoint.validation.articles import articles as study
from swgjoint.validation.articles.file import ArticlesFile
from swgjoint.validation.articles.runs import ArticleTask, run_task

BROKEN = ("deflection", "force", "force, lobes", "fatigue", "four, fine")
KEYS = {"case", "quantity", "unit", "source_value", "ours", "converged", "reason"}
LOBES = {
    "height_mm": 0.4,
    "deflection_mm": [0.0, 0.1, 0.2, 0.3, 0.4, 0.5],
    "force_N": [0.0, 6.5, 13.0, 19.5, 26.0, 32.5],
    "play_mrad": [nan, nan, 3.0, 1.0, -1.0, -3.0],
    "pressed_mm": [0.35, 0.36],
    "on_teeth_N": [0.0, 10.0],
}
"""65 N/mm; play that falls by 20 rad/m and vanishes at 0.35 mm; teeth of 1 N/µm."""


def section(safety):
    return {"S": safety, "normal_amplitude_MPa": 300.0 / safety}


def instant(task):
    """Numbers of the right shape at once."""
    if task.kind == "pinched":
        value = 50.0 + 0.1 * len(task.name)
        return {"mid_face": value, "open_edge": 40.0, "face_width": value}
    if task.kind == "rotated":
        return {"outward": 67.0, "inward": 64.0}
    if task.kind == "lobes":
        return LOBES
    if task.kind == "deflected":
        return {
            "largest_radial_mm": 0.52,
            "at_mid_face_mm": 0.49,
            "radial_z_mm": -8.0,
            "radial_from_major_deg": 0.0,
            "von_mises_MPa": 700.0,
            "von_mises_part": "back edge",
            "von_mises_from_major_deg": 3.0,
            "at_minor_MPa": 200.0,
        }
    torques = (0.0, *task.torques) if task.kind == "four" else task.torques
    return {
        "by_torque": [
            {
                "torque_Nm": torque,
                "worst_section": section(1.0),
                "mid_face": section(2.0 - 0.005 * torque),
                "von_mises_amplitude_MPa": {"root, mid-face": 290.0},
                "S_without_factors_mid_face": 2.5,
                "shell_theory": {"S": 2.2},
                "von_mises_MPa": 340.0,
                "largest_radial_mm": 0.372,
                "least_force_N": 100.0 - torque,
            }
            for torque in torques
        ]
    }


@pytest.fixture
def computed(monkeypatch):
    """Replace every computation; the names of the tasks that were asked for."""
    asked = []

    def run(task):
        asked.append(task.name)
        return instant(task)

    monkeypatch.setattr(study, "run_task", run)
    return asked


def articles(capsys, *arguments):
    assert main(["study", "articles", "--jobs", "1", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_rows_of_all_parts(computed, capsys, tmp_path):
    """Every row has the keys of the contract and a reason; held back means null."""
    result = articles(capsys, "--out", str(tmp_path / "out"))
    rows = result["rows"]
    assert all(set(row) >= KEYS and row["reason"] for row in rows)
    assert {row["part"] for row in rows} == set(study.PARTS)
    by = {(row["case"], row["quantity"]): row for row in rows}
    theory = by["xb1-100-80", "theory, smooth shell of 70 mm"]
    assert theory["source_value"] == 1625.0
    assert theory["ours"] == pytest.approx(81.28, abs=0.01)
    assert theory["converged"] == pytest.approx(79.36, abs=0.01)
    stiffness = by["xb1-100-80", "radial stiffness, loads at mid-face"]
    assert stiffness["source_value"] is None
    longest = max(len(v.name) for v in ArticlesFile.load("articles").force.variations)
    assert stiffness["high"] == pytest.approx(50.0 + 0.1 * (longest + len("force, ")))
    assert stiffness["low"] < stiffness["high"]
    lobe = {key[1]: row for key, row in by.items() if key[0] == "xb1-100-80"}
    assert lobe["lobe force at w_0"]["ours"] == pytest.approx(26.0)
    assert lobe["lobe force at w_0 with teeth"]["ours"] is None  # beyond 0.36 mm
    assert lobe["lobe force at which play vanishes"]["ours"] == pytest.approx(22.75)
    take_up = lobe["play taken up per micrometre of lobe deflection"]["ours"]
    assert take_up == pytest.approx(20e-6 * 10800 / pi, rel=0.01)
    name = "springs, constant force of 20 N: "
    assert lobe[name + "lobe force"]["ours"] == pytest.approx(20.0)
    assert lobe[name + "lobe deflection"]["ours"] == pytest.approx(20 / 65)
    assert lobe[name + "force on the teeth"]["ours"] == 0.0
    # 30 N + 5 N/mm 0.05 mm - 22.75 N of the cup over 1 N/µm and both stiffnesses
    name = "springs, 5 N/mm, 30 N: "
    assert lobe[name + "play"]["ours"] == 0.0
    wanted = 7.5 / (1.0 + 0.005 + 0.065)
    assert lobe[name + "force on the teeth"]["ours"] == pytest.approx(wanted)
    deflection = by["dca-80-to-1", "largest radial displacement"]
    assert (deflection["source_value"], deflection["ours"]) == (0.517, 0.52)
    assert "coned" in deflection["reason"]
    bending = by["stress-cup", "bending stress, 1.5 E s_1 w_0/r_m^2"]
    assert bending["ours"] == pytest.approx(163.3, abs=0.05)
    theory = by["stress-cup 100 N·m", "S, shell theory"]
    assert theory["source_value"] is None
    assert theory["ours"] == pytest.approx(2.17, abs=0.005)
    force = by["stress-cup 20 N·m", "nodal force T/(R N)"]
    assert (force["source_value"], force["ours"]) == (49.6, pytest.approx(56, abs=0.5))
    pulls = "of which one pulls"
    assert pulls in by["stress-cup 120 N·m", "S, four forces, mid-face"]["reason"]
    assert pulls not in by["stress-cup 80 N·m", "S, four forces, mid-face"]["reason"]
    # the finer mesh at every third torque
    key = "S, meshing, ellipse, mid-face"
    fine = [by[f"stress-cup {T} N·m", key]["converged"] for T in range(20, 141, 20)]
    assert [value is not None for value in fine] == [True, False, False] * 2 + [True]
    limit = by["stress-cup", "torque at S = 1.5, shell theory"]
    assert 500.0 < limit["ours"] < 1500.0 and limit["source_value"] is None
    assert result["failed"] == []
    names = [path.name for path in (tmp_path / "out").iterdir()]
    assert sorted(names) == ["articles.csv", "articles.json", "articles.png"]
    assert (tmp_path / "out/articles.png").read_bytes().startswith(b"\x89PNG")


def test_parts_run_alone(computed, capsys):
    """A part asks for its own computations; stress and fatigue share some."""
    assert {
        row["part"] for row in articles(capsys, "--only", "deflection")["rows"]
    } == {"deflection"}
    assert {"deflection", "deflection, fine"} < set(computed)
    assert all(name.startswith("deflection") for name in computed)
    computed.clear()
    articles(capsys, "--only", "stress,fatigue")
    assert len(set(computed)) == len(computed)
    assert computed.count("four") == 1


def test_what_fails_stays_in_the_table(monkeypatch, capsys):
    """No value, the outcome as the reason, the name among the failed ones."""

    def run(task):
        broken = task.name in BROKEN
        return {"fault": f"{task.name} broke"} if broken else instant(task)

    monkeypatch.setattr(study, "run_task", run)
    result = articles(capsys)
    assert set(result["failed"]) == set(BROKEN)
    lost = [row for row in result["rows"] if "broke" in row["reason"]]
    assert all(row["ours"] is None for row in lost)
    assert {row["part"] for row in lost} == {"deflection", "force", "fatigue"}
    assert "failed: force: force broke" in result["summary"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "torsion"], ("deflection", "force", "stress", "fatigue")),
        (["--model", "2d"], ("3d",)),
    ],
)
def test_bad_input(capsys, arguments, message):
    """One line on stderr, status 2."""
    assert main(["study", "articles", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and names(err, *arguments, *message)


def test_file_of_the_study(tmp_path):
    """Every variation is a design; series of unequal length are refused."""
    file = ArticlesFile.load("articles")
    for variation in file.force.variations:
        changed = Design.preset(file.force.base).with_changes(variation.changes)
        assert changed != Design.preset(file.force.base)
    good = (models_path() / "studies/articles.toml").read_text()
    bad = tmp_path / "bad.toml"
    bad.write_text(good.replace("[184.0, 203.0,", "[203.0,"))
    with pytest.raises(
        InputError, match=naming("bad.toml", "stress.von_mises_MPa", "6", "7")
    ):
        ArticlesFile.load(str(bad))


def test_a_design_that_cannot_be_meshed_is_a_fault():
    """Part of the result, not an error."""
    design = Design.load("xb1-100-80").with_changes({"cup.fillet_mm": 0.1})
    found = run_task(ArticleTask(name="thin", kind="pinched", design=design))
    assert "fillet_mm = 0.1" in found["fault"]


@pytest.mark.slow
def test_open_edge_of_the_80_to_1_drive():
    """Coning moves the open edge by more than w_0 = 0.5 mm, as the article finds."""
    design = Design.load("dca-80-to-1").with_changes({"mesh.refinement": 0.6})
    found = run_task(ArticleTask(name="dca", kind="deflected", design=design))
    assert found["at_mid_face_mm"] == pytest.approx(0.53, abs=0.02)
    assert 0.55 < found["largest_radial_mm"] < 0.7
    assert found["radial_z_mm"] == pytest.approx(-8.0)
    assert found["radial_from_major_deg"] < 5.0
    assert found["von_mises_from_major_deg"] < 10.0
    assert found["at_minor_MPa"] < found["von_mises_MPa"]


@pytest.mark.slow
def test_four_forces_on_the_cup_of_the_article():
    """Nominal stress without torque within a tenth of the shell theory's 164 MPa."""
    task = ArticleTask(name="four", kind="four", design=Design.load("stress-cup"))
    (at_rest,) = run_task(task)["by_torque"]
    assert at_rest["mid_face"]["normal_amplitude_MPa"] == pytest.approx(164.4, rel=0.12)
    assert at_rest["largest_radial_mm"] == pytest.approx(0.372)

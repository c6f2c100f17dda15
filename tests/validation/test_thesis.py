"""The runner on tiny studies: rows, failures, files, resumption."""

from __future__ import annotations

import csv

import pytest
from messages import names, naming

from swgjoint.errors import InputError
from swgjoint.faults import validate
from swgjoint.validation.rows import StudyOptions
from swgjoint.validation.runner import run_study, write_study
from swgjoint.validation.thesis import record
from swgjoint.validation.thesis.cases import KINDS, StudyFile
from swgjoint.validation.thesis.record import RunRecord
from swgjoint.validation.thesis.thesis import run_cases, run_thesis

TINY = {
    "source": "a source",
    "torque_Nm": 20.0,
    "positions": 2,
    "group": [
        {
            "id": "sweep",
            "title": "Rim",
            "source": "a figure",
            "base": "reference-2d",
            "keys": ["flexspline.rim_mm"],
            "symbol": "t_r",
            "unit": "mm",
            "lowest": {"von_mises": 0.9},
            "cases": [{"value": 0.9}, {"value": 1.0, "tensile_MPa": 300.0}],
        },
        {
            "id": "states",
            "title": "States",
            "source": "another",
            "base": "reference-2d",
            "cases": [
                {"name": "stuck", "torque_Nm": 5.0},
                {"name": "no drive", "changes": {"flexspline.rim_mm": -1.0}},
                {"name": "engaged", "state": "meshed", "tensile_MPa": 290.0},
                {"name": "turned", "angle_deg": 3.0},
            ],
        },
    ],
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    return tmp_path_factory.mktemp("cache"), tmp_path_factory.mktemp("out") / "a" / "b"


@pytest.fixture(scope="module")
def study():
    return validate(StudyFile, TINY, where="tiny")


@pytest.fixture(scope="module")
def result(study, folders):
    """The tiny study, run and written; at 5 and 0.5 N·m nothing can be solved."""
    compute = record.compute

    def partly(spec):
        if spec.torque in (5.0, 0.5):
            return RunRecord(outcome="failed", message="the solve is stuck")
        return compute(spec)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SWGJOINT_CACHE", str(folders[0]))
        patch.setattr(record, "compute", partly)
        return write_study("thesis", run_cases(study, StudyOptions()), folders[1])


def rows_of(result, case):
    return {row.more["kind"]: row for row in result.rows if row.case == case}


def test_rows_of_the_contract(result):
    """Three rows a case in the order of the file, printed values or none."""
    cases = list(dict.fromkeys(row.case for row in result.rows))
    assert cases == [
        *("sweep t_r = 0.9 mm", "sweep t_r = 1 mm"),
        *("states stuck", "states no drive", "states engaged", "states turned"),
    ]
    assert len(result.rows) == 3 * len(cases)
    row = rows_of(result, "sweep t_r = 1 mm")["tensile"].to_json()
    assert row["source_value"] == 300.0
    assert row["unit"] == "MPa" and row["quantity"] == "tensile stress"
    assert row["converged"] is None
    assert row["deviation_percent"] == pytest.approx(100 * (row["ours"] / 300 - 1))
    assert rows_of(result, "sweep t_r = 0.9 mm")["tensile"].source_value is None


def test_torque_and_tenth_differ(result):
    """More torque, more tensile stress: T and T/10 are two simulations."""
    row = rows_of(result, "sweep t_r = 1 mm")["tensile"]
    assert row.ours > row.more["ours_tenth"] > 200.0


def test_single_states(result):
    """A set-up state is the same at both torques; a position is read there."""
    engaged = rows_of(result, "states engaged")["tensile"]
    assert engaged.ours == engaged.more["ours_tenth"]
    turned = rows_of(result, "states turned")["von_mises"]
    first = rows_of(result, "sweep t_r = 1 mm")["von_mises"]
    assert turned.ours != first.ours
    assert turned.ours == pytest.approx(first.ours, rel=0.1)


def test_failures_stay_in_the_table(result):
    """What cannot be solved or built has a row with the reason, and is counted."""
    stuck = rows_of(result, "states stuck")["tensile"]
    assert stuck.ours is None
    assert stuck.reason == "T, T/10: the solve is stuck"
    refused = rows_of(result, "states no drive")["tensile"]
    assert refused.more["outcome"] == "refused"
    assert names(refused.reason, "flexspline.rim_mm", "-1 mm")
    assert result.more["failed_cases"] == ["states stuck", "states no drive"]


def test_shares_and_trends(result):
    """Printed values within 15 % are counted; stated trends are checked."""
    assert result.more["shares"]["tenth"] == {"printed": 2, "computed": 2, "within": 2}
    assert result.more["shares"]["converged_tenth"]["computed"] == 0
    assert [t["claim"] for t in result.more["trends"]] == ["lowest", "lowest"]
    assert any("2 of 2 printed values within 15 %" in line for line in result.summary)


def test_increase_with_torque(study, folders, monkeypatch):
    """A group over another one has the increase of its von Mises stress in percent."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(folders[0]))
    low = {**TINY["group"][0], "cases": [{"value": 1.0}], "lowest": {}}
    high = {**low, "id": "high", "torque_Nm": 200.0, "over": "sweep"}
    tiny = validate(StudyFile, {**TINY, "group": [low, high]}, where="tiny")
    rows = run_cases(tiny, StudyOptions()).rows
    assert [row.more["part"] for row in rows] == ["sweep"] * 3 + ["high"] * 4
    before, after, increase = rows[2], rows[5], rows[6]
    assert increase.quantity == "von Mises stress over that at 20 N·m"
    assert increase.unit == "%" and increase.ours > 20.0
    assert increase.ours == pytest.approx(100 * (after.ours / before.ours - 1))
    # ten times the torque of a tenth is the torque
    assert after.more["ours_tenth"] == pytest.approx(before.ours, rel=1e-12)
    high["over"] = "nothing"
    with pytest.raises(
        InputError, match=naming("group[1].over", "'nothing'", "group of", "keys")
    ):
        validate(StudyFile, {**TINY, "group": [low, high]}, where="tiny")


def test_files(result, folders):
    """Tables, report and one plot a part; the CSV has every row and column."""
    assert sorted(path.name for path in folders[1].iterdir()) == [
        *("states.png", "sweep.png"),
        *("thesis.csv", "thesis.json", "thesis.md"),
    ]
    assert len(result.files) == 5
    with (folders[1] / "thesis.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(result.rows)
    assert list(table[0]) == list(result.rows[0].to_json())
    assert float(table[3]["ours"]) == result.rows[3].ours
    text = (folders[1] / "thesis.md").read_text(encoding="utf-8")
    assert "## sweep: Rim" in text and "the solve is stuck" in text
    for part in ("sweep", "states"):
        assert (folders[1] / f"{part}.png").read_bytes().startswith(b"\x89PNG")


def test_a_study_resumes(result, study, folders, monkeypatch):
    """Run again, a study takes every record from the cache and finds the same rows."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(folders[0]))

    def computed(spec):
        raise AssertionError("computed again")

    monkeypatch.setattr(record, "compute", computed)
    assert run_cases(study, StudyOptions()).rows == result.rows
    # processes of their own find the same records
    assert run_cases(study, StudyOptions(jobs=2)).rows == result.rows


@pytest.mark.slow
def test_finer_meshes(study, monkeypatch):
    """A group that converges has the value of the finest mesh and its last change."""
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    group = {**TINY["group"][0], "converge": True, "cases": [{"value": 1.0}]}
    group["lowest"] = {}
    finer = {"refinements": [2], "fine_positions": 1, "group": [group]}
    tiny = validate(StudyFile, {**TINY, **finer}, where="tiny")
    found = {row.more["kind"]: row for row in run_cases(tiny, StudyOptions()).rows}
    assert set(found) == set(KINDS)
    row = found["tensile"]
    # 261 and 287 MPa in the deflected state on refinements 1 and 2
    assert 1.05 < row.converged / row.ours < 1.2
    change = 100 * (row.more["converged_tenth"] / row.more["ours_tenth"] - 1)
    assert row.more["last_refinement_percent"] == pytest.approx(change)


def test_chapter_seven_is_three_dimensional():
    """With the 3D model the study has the parts of chapter 7 and no others."""
    with pytest.raises(
        InputError, match=naming("4.4", "7.9", "7.10", "7.13.1", "table-7.4")
    ):
        run_thesis(StudyOptions(model="3d", only=("4.4",)))


def test_table_of_micro_geometry(tmp_path, monkeypatch):
    """Table 7.4 at T and T/10, mesh by mesh at T: an edge that grows is said to."""
    specs = []

    def compute(spec):
        specs.append(spec)
        mesh = spec.design.mesh.refinement
        crowned = spec.design.micro_geometry.wave_generator_crowning_um > 0.0
        edge = 290.0 if crowned else 1000.0 * mesh**0.5
        load = 1.0 if spec.torque == 20.0 else 0.9
        stresses = dict.fromkeys(KINDS, load * edge)
        return RunRecord(
            outcome="converged",
            average=stresses,
            places={"von_mises": {"back edge": spec.positions}},
            angle_deg=[0.0] * spec.positions,
        )

    monkeypatch.setenv("SWGJOINT_CACHE", "")
    monkeypatch.setattr(record, "compute", compute)
    options = StudyOptions(model="3d", only=("table-7.4",), folder=tmp_path / "out")
    result = run_study("thesis", options)
    meshes = [(s.torque, s.design.mesh.refinement, s.positions) for s in specs]
    wanted = [(20.0, 1.0, 36), (2.0, 1.0, 36), (20.0, 1.3, 6), (20.0, 1.6, 6)]
    assert sorted(meshes) == sorted(2 * wanted)
    initial = rows_of(result, "table-7.4 initial")["von_mises"]
    assert initial.source_value == 1160.326
    assert initial.ours == pytest.approx(1000.0)
    assert initial.more["ours_tenth"] == pytest.approx(900.0)
    assert initial.converged == pytest.approx(1000.0 * 1.6**0.5)
    assert initial.more["converged_tenth"] is None
    assert list(initial.more["by_refinement"]) == ["1", "1.3", "1.6"]
    stresses = "1000, 1140, 1265 MPa at refinement 1, 1.3, 1.6"
    line = f"{stresses}, +10.9 % in the last step: has no"
    assert line in initial.reason
    # judged at T: 1000 is within 15 % of 1160
    assert "at T/10" not in initial.reason
    improved = rows_of(result, "table-7.4 improved")["compressive"]
    assert improved.reason.startswith("-25 % at T; ")
    assert improved.reason.endswith(
        "290, 290, 290 MPa at refinement 1, 1.3, 1.6, +0.0 % in the last step: settles"
    )
    assert result.more["shares"]["converged"]["computed"] == 6
    # the sign of the slope, stated by the study and its report
    assert any("figure 7.33 lowers it" in line for line in result.summary)
    text = (tmp_path / "out/thesis.md").read_text(encoding="utf-8")
    assert "figure 7.33 lowers it" in text and "the 3D studies" in text
    assert "| T/10 |" in text and "at T only" in text

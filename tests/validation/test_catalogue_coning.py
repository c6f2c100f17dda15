"""The part ``coning`` of the catalogue study: cases, rows, where it runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.validation.catalogue import catalogue as study
from swgjoint.validation.catalogue import coning as coning
from swgjoint.validation.catalogue import runs as runs
from swgjoint.validation.catalogue.file import CatalogueFile
from swgjoint.validation.catalogue.printed import (
    catalogue_row,
    catalogue_stiffness,
    edges,
)
from swgjoint.validation.rows import StudyOptions
from swgjoint.validation.runner import run_study

FAILED = "coning 100 bearing, straight"


def straight_line(task):
    """1e5 N·m/rad, half as stiff on a bearing at ratio 50; one case fails."""
    if task.name == FAILED:
        return {"fault": "no equilibrium", "wall_s": 0.0}
    soft = 2.0 if "bearing" in task.name and "50" in task.name else 1.0
    found = {
        "torque_Nm": list(task.torques),
        "torsion_rad": [1e-5 * soft * torque for torque in task.torques],
        "compliance_rad_Nm": [1e-5 * soft] * len(task.torques),
        "balls": [9.0] * len(task.torques),
        "half_play_rad": 0.25e-5 * soft * task.torques[0],
        "wall_s": 0.0,
    }
    if task.kind != "coning ring":
        for key in ("tooth_centre_over_face", "bore_centre_over_face"):
            found[key] = [-0.2] * len(task.torques)
    return found


@pytest.fixture
def computed(monkeypatch):
    """Replace every computation."""
    monkeypatch.setattr(study, "run_task", straight_line)


def test_cases_are_the_same_drive_in_other_models():
    """Straight cases lack all relief, others keep that of the family; kinds exist."""
    tasks = coning.coning_tasks(CatalogueFile.load("catalogue"))
    assert len(tasks) == 12
    for task in tasks:
        assert task.kind in runs.KINDS
        assert task.design.mesh.refinement == 0.5
        relief = task.design.micro_geometry
        heights = (
            relief.wave_generator_crowning_um,
            relief.wave_generator_slope_um,
            relief.flexspline_crowning_um,
        )
        assert all(heights) != ("straight" in task.name)
        ratio = int(task.name.split()[1])
        assert task.torques == edges(catalogue_row(25, ratio))[1:]


def test_stiffness_is_that_of_the_segments(computed, tmp_path):
    """K over the catalogue, the drop by the bearing, the failed case, the picture."""
    options = StudyOptions(jobs=1, only=("coning",), folder=tmp_path)
    found = run_study("catalogue", options)
    rows = {(row["ratio"], row["case"]): row for row in found.more["coning"]["rows"]}
    assert len(rows) == 11
    printed = catalogue_stiffness(catalogue_row(25, 50))
    one = rows[50, "bearing, relieved"]
    assert one["over_catalogue"] == pytest.approx(5e4 / printed)
    assert one["K2_Nm_rad"] == pytest.approx(5e4)
    assert one["half_play_rad"] == pytest.approx(0.25 * one["torsion_rad"][0])
    text = "\n".join(found.summary)
    assert text.count("half the play is 25 % of the torsion at T1") == len(rows)
    assert "bearing, relieved over rigid, relieved: 0.50/0.50/0.50 at ratio 50" in text
    assert f"failed: {FAILED}: no equilibrium" in text
    assert "tooth forces centred at -0.20/-0.20/-0.20 face widths" in text
    assert (tmp_path / "coning.png").read_bytes().startswith(b"\x89PNG")
    assert str(tmp_path / "coning.png") in found.files


def test_coning_runs_when_it_is_asked_for(computed, monkeypatch):
    """The default run has none of its tasks."""
    seen = []

    def tasks_of(study_file, part):
        seen.append(part)
        return []

    monkeypatch.setattr(study, "tasks_of", tasks_of)
    monkeypatch.setattr(study, "rows_of", lambda *_: [])
    for name in ("cube_scaling", "shares", "friction", "individual_summary"):
        monkeypatch.setattr(study, name, lambda *_: {"rows": [], "lines": []})
    monkeypatch.setattr(study, "ratcheting_orders", lambda *_: [])
    monkeypatch.setattr(study, "compare_scaling", lambda *_: [])
    study.run_catalogue(StudyOptions(jobs=1))
    assert "coning" not in seen
    assert seen == list(study.PARTS)


def test_a_coning_task_is_the_torsion_in_space(monkeypatch):
    """The kind says which bearing the solver gets."""
    from swgjoint.fe.solid.figures import torsion

    asked = []

    def solved(design, torques, *, bearing):
        asked.append(bearing)
        zero = np.zeros(len(torques))
        return torsion.SolidTorsion(
            torque=np.array(torques),
            torsion=1e-5 * np.array(torques),
            compliance=zero,
            tooth_centre=zero,
            tooth_force=zero,
            bore_centre=zero,
            balls=zero,
            half_play=3e-6,
        )

    monkeypatch.setattr(torsion, "solid_torsion", solved)
    tasks = coning.coning_tasks(CatalogueFile.load("catalogue"))
    for task in tasks[1:6]:
        found = runs.KINDS[task.kind](task)
        assert found["torsion_rad"] == pytest.approx(1e-5 * np.array(task.torques))
        assert found["half_play_rad"] == 3e-6
    assert asked == [None, None, "free", "free", "held"]


@pytest.mark.fe
def test_rings_of_coning_have_their_cup_in_series_once():
    """Torsion above half the play, in the middle of its tangents; a longer cup adds."""
    task = coning.coning_tasks(CatalogueFile.load("catalogue"))[0]
    task = replace(task, torques=task.torques[:2])
    cup = {"cup.length_mm": 1.5 * task.design.cup.length_mm}
    long = replace(task, design=task.design.with_changes(cup))
    own, soft = (runs.KINDS[one.kind](one) for one in (task, long))
    torque, torsion = np.array(own["torque_Nm"]), np.array(own["torsion_rad"])
    assert 0.0 < own["half_play_rad"] < torsion[0] < torsion[1]
    low, high = sorted(own["compliance_rad_Nm"])
    assert low < np.diff(torsion)[0] / np.diff(torque)[0] < high
    k, longer = (cup_torsional_stiffness(one.design) for one in (task, long))
    more = 1.0 / longer - 1.0 / k
    assert more > 0.05 * low
    assert np.array(soft["torsion_rad"]) == pytest.approx(torsion + more * torque)
    assert soft["half_play_rad"] == pytest.approx(own["half_play_rad"])

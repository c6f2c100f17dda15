"""The part ``experiments`` of the catalogue study: one change at a time, its effect."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.mounting import series_compliance
from swgjoint.units import arcsec
from swgjoint.validation.catalogue import catalogue as study
from swgjoint.validation.catalogue.experiments import changed_design, experiment_tasks
from swgjoint.validation.catalogue.file import CatalogueFile
from swgjoint.validation.catalogue.printed import catalogue_row
from swgjoint.validation.rows import StudyOptions

FILE = CatalogueFile.load("catalogue")


def straight(task):
    """Rings of 1e5 N·m/rad, 8e4 with thinner races; one experiment fails."""
    if task.name == "experiment 50 groove 0.53":
        return {"fault": "no equilibrium", "wall_s": 0.0}
    bearing = task.design.wave_generator.bearing
    K = 8e4 if bearing.race_thickness_mm < 0.02 * 63.5 else 1e5
    torque = np.array([0.1, *task.torques])
    return {
        "torque_Nm": torque.tolist(),
        "ring_torsion_rad": (torque / K).tolist(),
        "work_per_mu_J": [1e-3] * (torque.size - 1),
        "race_part": [0.2] * (torque.size - 1),
        "ring_compliance_rad_Nm": [1.0 / K] * torque.size,
        "ring_shares": {"rim": [1.0] * torque.size},
        "balls": [9.0] * torque.size,
        "tooth_pairs": [4.0] * torque.size,
    }


def flat(design):
    """Values of a design by dotted key."""
    found = {}

    def walk(table, path):
        for key, value in table.items():
            if isinstance(value, dict):
                walk(value, f"{path}{key}.")
            else:
                found[path + key] = value

    walk(design.model_dump(), "")
    return found


def test_one_thing_changes_at_a_time():
    """Only the stated keys differ; another rim leaves the wall; names are unique."""
    assert len({one.name for one in FILE.experiments}) == len(FILE.experiments)
    assert len(experiment_tasks(FILE, 25)) == 2 * (1 + len(FILE.experiments))
    for ratio in (50, 100):
        base = flat(changed_design(FILE, 25, ratio, None))
        for one in FILE.experiments:
            here = flat(changed_design(FILE, 25, ratio, one))
            moved = {key for key in here if here[key] != base.get(key)}
            stated = {*one.changes, *one.per_pitch_diameter}
            if one.rim is not None:
                stated |= {"flexspline.rim_mm", "cup.thickness_coefficient"}
                walls = [
                    table["flexspline.rim_mm"] * table["cup.thickness_coefficient"]
                    for table in (here, base)
                ]
                assert walls[0] == pytest.approx(walls[1], rel=0.005)
            if one.flank_deg is not None:
                assert {"flexspline.pressure_angle_deg"} <= moved
                continue
            if one.ratios is not None and ratio not in one.ratios:
                assert not moved
            assert moved <= stated


def test_effects_are_those_of_the_paths(monkeypatch):
    """A softer race at ratio 50, play by hand, the failed experiment left out."""
    monkeypatch.setattr(study, "run_task", straight)
    found = study.run_catalogue(StudyOptions(jobs=1, only=("experiments",)))
    assert found.rows == ()
    rows = {row["experiment"]: row for row in found.more["experiments"]["rows"]}
    assert "groove 0.53" not in rows
    assert found.more["failed"] == ["experiment 50 groove 0.53"]
    cups = {
        ratio: series_compliance(changed_design(FILE, 25, ratio, None), cup=True)
        for ratio in (50, 100)
    }
    unchanged = (1e-5 + cups[100]) / (1e-5 + cups[50])
    assert rows["no change"]["effect"] == pytest.approx([unchanged] * 3)
    soft = (1e-5 + cups[50]) / (1.25e-5 + cups[50])
    race = rows["race 0.8 times as thick at ratio 50"]
    assert race["over_unchanged"][0] == pytest.approx([soft] * 3)
    assert race["over_unchanged"][1] == pytest.approx([1.0] * 3)
    assert race["effect"] == pytest.approx([soft * unchanged] * 3)
    T1 = catalogue_row(25, 50).T1
    play = rows["play of the coupling"]["over_unchanged"][0]
    torsion = T1 * (1e-5 + cups[50])
    assert play[0] == pytest.approx(torsion / (torsion + 10.0 * arcsec))
    assert play[1:] == pytest.approx([1.0, 1.0])
    assert any("race 0.8 times as thick" in line for line in found.summary)

"""Error against run time of the finite elements."""

from __future__ import annotations

import json

import numpy as np
import pytest

from swgjoint.errors import ComputationError, DesignError
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design import Design
from swgjoint.study import fe_cost
from swgjoint.study.fe_cost import Found, Setting, run_fe_cost

CUP = Design.load("reference-3d")


def found(part):
    """A setting that is off by a part."""
    return Found(
        stiffness=1e5 * (1.0 + part),
        kinematic_error=1e-6 * (1.0 + part) * np.array([1.0, 0.0, -1.0, 0.0]),
        tensile=3e8 * (1.0 - part),
        wall_s=1.0 / (0.1 + part),
    )


def test_rows_compare_with_the_last_setting(monkeypatch, tmp_path):
    """Errors in percent of the reference, of the pattern in arcsec; one may fail."""
    settings = [Setting(model="3d", refinement=n) for n in (0.5, 0.7, 1.0)]
    parts = {0.5: 0.1, 1.0: 0.0}

    def solved(design, setting):
        if setting.refinement not in parts:
            raise ComputationError("no equilibrium")
        return found(parts[setting.refinement])

    monkeypatch.setattr(fe_cost, "_solved", solved)
    result = run_fe_cost(design=CUP, settings=settings, folder=tmp_path / "out")
    assert [row["outcome"] for row in result["rows"]] == [
        *["converged"] * 3,
        "no equilibrium",
        *["converged"] * 3,
    ]
    coarse, fine = result["rows"][:3], result["rows"][4:]
    assert [row["error"] for row in fine] == [0.0, 0.0, 0.0]
    assert coarse[0]["error"] == pytest.approx(10.0)
    assert coarse[1]["error"] == pytest.approx(0.2 * 180 * 3600 / np.pi * 1e-6)
    assert coarse[2]["error"] == pytest.approx(-10.0)
    table, picture = result["files"]
    with open(table, encoding="utf-8") as file:
        assert len(json.load(file)["rows"]) == 7
    with open(picture, "rb") as file:
        assert file.read(4) == b"\x89PNG"


def test_a_reference_that_fails_is_an_error(monkeypatch):
    """Without it there is nothing to compare with."""

    def failed(design, setting):
        raise ComputationError("diverged")

    monkeypatch.setattr(fe_cost, "_solved", failed)
    with pytest.raises(ComputationError, match="the reference, refinement 1: diverged"):
        run_fe_cost(design=CUP, settings=[Setting(model="3d", refinement=1.0)])


def test_a_design_without_cup_is_refused():
    """The reference is a model in space."""
    with pytest.raises(DesignError, match="needs a"):
        run_fe_cost(design=Design.load("reference-2d"))


@pytest.mark.fe
def test_plane_model_has_the_cup_in_series(monkeypatch):
    """Stiffness at rated torque behind that of the cup."""
    settings = [Setting(model="2d", refinement=0.5)]
    both = run_fe_cost(design=CUP, settings=settings)["rows"][0]["value"]
    monkeypatch.setattr(fe_cost, "cup_torsional_stiffness", lambda design: np.inf)
    ring = run_fe_cost(design=CUP, settings=settings)["rows"][0]["value"]
    cup = cup_torsional_stiffness(CUP)
    assert 1.0 / both == pytest.approx(1.0 / ring + 1.0 / cup, rel=1e-6)

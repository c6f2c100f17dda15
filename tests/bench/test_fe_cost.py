"""Error against run time of the finite elements."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from messages import naming
from solved import small_cup

from swgjoint.bench.fe import cost as fe_cost
from swgjoint.bench.fe import solve as fe_cost_solve
from swgjoint.bench.fe.cost import run_fe_cost
from swgjoint.bench.fe.rows import cheapest
from swgjoint.bench.fe.setting import POSITIONS, RIM, FeSetting, Found, rim_shape
from swgjoint.bench.fe.solve import SettingTask, solve_in_process, solve_setting
from swgjoint.cli.bench import fe_text
from swgjoint.errors import ComputationError, DesignError
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design

CUP = Design.load("reference-3d")
SMALL = small_cup()
PHI = np.pi * np.arange(RIM) / RIM


def found(part, cost=1.0):
    """A setting that is off by a part."""
    return Found(
        stiffness=1e5 * (1.0 + part),
        kinematic_error=1e-6 * (1.0 + part) * np.array([1.0, 0.0, -1.0, 0.0]),
        tensile=3e8 * (1.0 - part),
        rim_shape=1e-3 * np.cos(2.0 * PHI) * (1.0 + part),
        wall_s=3.0 * cost,
        cpu_s=cost,
        peak_MB=100.0,
        nodes=10,
    )


@pytest.fixture
def solve(monkeypatch):
    """Set what every setting says, by its key."""

    def given(table):
        def all_of(design, settings, **keys):
            return {setting.key: table[setting.key] for setting in settings}

        monkeypatch.setattr(fe_cost, "_solve_all", all_of)

    return given


def test_rows_compare_with_three_references(solve, tmp_path):
    """The best, the finest of the kind, the next level up; one may fail."""
    settings = [
        FeSetting(model="2d", refinement=1),
        FeSetting(model="2d", refinement=2),
        FeSetting(model="3d", refinement=0.7),
        FeSetting(model="3d", refinement=0.5),
        FeSetting(model="3d", refinement=1.0),
    ]
    parts = (0.2, 0.15, None, 0.1, 0.0)
    table = {
        s.key: "no equilibrium" if part is None else found(part, k + 1.0)
        for k, (s, part) in enumerate(zip(settings, parts, strict=True))
    }
    solve(table)
    result = run_fe_cost(design=CUP, settings=settings, folder=tmp_path / "out")
    rows = {(r["model"], r["setting"], r["quantity"]): r for r in result["rows"]}
    assert len(result["rows"]) == 4 * 4 + 1

    def row(model, mesh, quantity="torsional_stiffness_Nm_rad"):
        return rows[model, f"refinement {mesh}", quantity]

    assert row("3d", 0.7)["outcome"] == "no equilibrium"
    assert row("3d", 0.7)["error"] is None and not row("3d", 0.7)["pareto"]
    assert row("3d", 1)["error"] == 0.0 and row("3d", 1)["error_next_level"] is None
    coarse = row("2d", 1)
    assert coarse["reference"] == "3d, refinement 1"
    assert coarse["error"] == pytest.approx(20.0)
    assert coarse["reference_of_kind"] == "2d, refinement 2"
    assert coarse["error_of_kind"] == pytest.approx(100.0 * (1.2 / 1.15 - 1.0))
    assert coarse["reference_next_level"] == "3d, refinement 1"
    assert row("3d", 0.5, "tensile_MPa")["error"] == pytest.approx(-10.0)
    assert row("3d", 0.5, "rim_shape_mm")["error"] == pytest.approx(10.0)
    pattern = row("2d", 1, "kinematic_error_pp_arcsec")
    assert pattern["error"] == pytest.approx(0.2 * 2e-6 * 180 * 3600 / np.pi)
    assert pattern["error_percent"] == pytest.approx(20.0)
    *files, picture = result["files"]
    with open(files[0], encoding="utf-8") as file:
        kept = json.load(file)
    assert kept["rows"] == result["rows"]
    assert {"commit", "versions", "machine"} <= set(kept["provenance"])
    with open(files[1], encoding="utf-8") as file:
        assert len(file.readlines()) == 1 + len(result["rows"])
    with open(picture, "rb") as file:
        assert file.read(4) == b"\x89PNG"


def test_the_front_has_what_nothing_cheaper_beats(solve):
    """A dearer setting with a larger or the same error is not on it."""
    settings = [FeSetting(model="3d", refinement=n) for n in (0.5, 0.6, 0.7, 0.8, 1.0)]
    parts = ((0.1, 1), (0.1 - 1e-9, 1.5), (0.2, 2), (0.05, 3), (0.0, 4))
    table = zip(settings, parts, strict=True)
    solve({s.key: found(*values) for s, values in table})
    rows = run_fe_cost(design=CUP, settings=settings)["rows"]
    front = [row["pareto"] for row in rows if row["quantity"] == "tensile_MPa"]
    assert front == [True, False, False, True, True]


def test_a_bound_that_is_met_by_chance_does_not_count(solve):
    """The finer mesh of the same kind must meet it, too."""
    settings = [FeSetting(model="3d", refinement=n) for n in (0.5, 0.7, 0.8, 1.0)]
    table = zip(settings, ((0.02, 1), (0.08, 2), (0.03, 3), (0.0, 4)), strict=True)
    solve({s.key: found(*values) for s, values in table})
    picks = cheapest(run_fe_cost(design=CUP, settings=settings)["rows"])
    stiffness = [p["setting"] for p in picks if p["quantity"].startswith("torsional")]
    assert stiffness == [None, "refinement 0.8", "refinement 0.5"]


def test_the_plane_alone_goes_by_its_own_finest_mesh(solve):
    """Far from the model in space, near to the finest plane mesh."""
    settings = [FeSetting(model="2d", refinement=n) for n in (1, 2, 4)]
    settings.append(FeSetting(model="3d", refinement=1.0))
    table = zip(settings, ((0.33, 1), (0.31, 2), (0.3, 3), (0.0, 4)), strict=True)
    solve({s.key: found(*values) for s, values in table})
    result = run_fe_cost(design=CUP, settings=settings)
    assert all(one["setting"] is None for one in result["cheapest"])
    plane = [one["setting"] for one in result["cheapest_in_the_plane"]][:3]
    assert plane == ["refinement 2", "refinement 1", "refinement 1"]


def test_a_reference_that_fails_is_an_error(solve):
    """Without it there is nothing to compare with."""
    solve({"3d, refinement 1": "diverged"})
    with pytest.raises(
        ComputationError, match=naming("reference", "refinement 1", "diverged")
    ):
        run_fe_cost(design=CUP, settings=[FeSetting(model="3d", refinement=1.0)])


def test_a_design_without_cup_is_refused():
    """The reference is a model in space."""
    with pytest.raises(
        DesignError, match=naming("reference-2d", "[cup]", "reference-3d-modified")
    ):
        run_fe_cost(design=Design.load("reference-2d"))


def test_the_only_mesh_of_a_kind_is_not_its_own_reference(solve):
    """No error of its kind instead of none."""
    settings = [
        FeSetting(model="3d", refinement=0.5, nonlinear=False),
        *(FeSetting(model="3d", refinement=n) for n in (0.5, 1.0)),
    ]
    table = zip(settings, (0.4, 0.1, 0.0), strict=True)
    solve({s.key: found(part) for s, part in table})
    rows = run_fe_cost(design=CUP, settings=settings)["rows"]
    linear = [row for row in rows if row["kind"] == "3d linear"]
    keys = ("error_of_kind", "reference_of_kind", "error_of_kind_percent")
    assert len(linear) == 4
    assert all(row[key] is None for row in linear for key in keys)
    assert {row["reference_of_kind"] for row in rows[4:]} == {"3d, refinement 1"}


PLANE = FeSetting(model="2d", refinement=0.5)

FATED = """
import os
import signal


def fated(task):
    if task.setting.refinement == 3.0:
        os.kill(os.getpid(), signal.SIGKILL)
    if task.setting.refinement == 2.0:
        raise MemoryError
    return task
"""
"""Instead of a solution what may befall a process; a file that processes can import."""


def test_a_process_that_dies_is_a_row(tmp_path, monkeypatch):
    """Killed or out of memory: why stands in its place, the others go on."""
    (tmp_path / "fates.py").write_text(FATED)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(fe_cost, "solve_in_process", import_module("fates").fated)
    settings = [FeSetting(model="2d", refinement=n) for n in (1.0, 2.0, 3.0)]
    got = fe_cost._solve_all(
        CUP, settings, jobs=2, stage="settings", progress=lambda *_: None
    )
    assert got["2d, refinement 1"].setting == settings[0]
    assert got["2d, refinement 2"] == "out of memory"
    assert "killed" in got["2d, refinement 3"]


THREADS = """
import os


def threads(task):
    return len(os.listdir("/proc/self/task"))
"""
"""Instead of a solution the threads of the process, its algebra loaded."""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="counts under Linux")
def test_a_process_has_one_thread(tmp_path, monkeypatch):
    """Whatever the shell says: two pools of them would fight for the cores."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "3")
    (tmp_path / "threads.py").write_text(THREADS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(fe_cost, "solve_in_process", import_module("threads").threads)
    got = fe_cost._solve_all(
        CUP, [PLANE], jobs=1, stage="settings", progress=lambda *_: None
    )
    assert got == {PLANE.key: 1}
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"


def test_the_kinematic_error_says_at_how_many_positions(solve):
    """In JSON and table: four of a pitch, which see its first harmonic alone."""
    setting = FeSetting(model="3d", refinement=1.0)
    solve({setting.key: found(0.0)})
    result = run_fe_cost(design=CUP, settings=[setting])
    assert result["kinematic_error_positions"] == POSITIONS == 4
    text = fe_text.report(result)
    assert "kinematic error at 4 positions of a pitch, first harmonic" in text
    assert text.count("first harmonic") == 1


def test_rim_shape_folds_half_turns():
    """A two-lobe shape, its major axis at the wave generator's angle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    radius = 0.05 + 1e-3 * np.cos(2.0 * (angle - 0.3))
    points = radius[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    shape = rim_shape(points, 0.05, 0.3)
    assert np.abs(shape - 1e-3 * np.cos(2.0 * PHI)).max() < 1e-8


@pytest.fixture(scope="module")
def half():
    """The coarsest plane model, of half the teeth."""
    return solve_in_process(SettingTask(design=SMALL, setting=PLANE))


def test_half_and_all_teeth_agree(half):
    """The same drive; and the process tells its memory and time."""
    whole = solve_setting(SMALL, replace(PLANE, full=True))
    assert whole.stiffness == pytest.approx(half.stiffness, rel=1e-7)
    assert np.abs(whole.rim_shape - half.rim_shape).max() < 1e-10
    assert np.abs(whole.kinematic_error - half.kinematic_error).max() < 1e-11
    assert half.peak_MB > 50.0 and 0.0 < half.cpu_s


def test_plane_model_has_the_cup_in_series(half, monkeypatch):
    """Stiffness at rated torque behind that of the cup."""
    monkeypatch.setattr(fe_cost_solve, "series_compliance", lambda design, cup: 0.0)
    ring = solve_setting(SMALL, PLANE).stiffness
    cup = cup_torsional_stiffness(SMALL)
    assert 1.0 / half.stiffness == pytest.approx(1.0 / ring + 1.0 / cup, rel=1e-6)


@pytest.mark.slow
def test_closed_form_and_rings_tell_the_lobe():
    """Rings on a stiff bearing keep the deflection at the lobes and the cup behind."""
    closed = solve_setting(CUP, FeSetting(model="ring", refinement=0))
    assert closed.rim_shape[0] == pytest.approx(1e-3)
    assert closed.stiffness == cup_torsional_stiffness(CUP)
    rings = solve_setting(CUP, FeSetting(model="ring", refinement=0.5))
    assert rings.stiffness < closed.stiffness
    assert rings.rim_shape[0] == pytest.approx(1e-3, rel=0.02)
    assert rings.tensile == pytest.approx(closed.tensile, rel=0.3)

"""``swgjoint study catalogue``: definitions, brackets, failures, what is kept."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from messages import names, naming

from swgjoint.cli.main import main
from swgjoint.errors import ComputationError, InputError
from swgjoint.fe.rings.accuracy import output_turn_angles
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.base_oil import MAKER_GREASES, ROOM
from swgjoint.gear.bearing.rolling_friction import BASE_OILS, GreasedBearing
from swgjoint.gear.catalogue_stated import stated_losses
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.sheet.friction_running import RUNNING_SPEED
from swgjoint.units import arcmin, mm
from swgjoint.validation.catalogue import catalogue as study
from swgjoint.validation.catalogue import runs as runs
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design
from swgjoint.validation.catalogue.losses import running_of
from swgjoint.validation.catalogue.printed import (
    catalogue_row,
    catalogue_stiffness,
    printed_accuracy,
    torques_of,
)
from swgjoint.validation.catalogue.rows import friction_of_path, stiffnesses
from swgjoint.validation.catalogue.runs import CatalogueTask, oval, run_task
from swgjoint.validation.rows import StudyOptions

BROKEN = "path 20 80 28 deg, rim by ratio"


def curve(task):
    """Rings of known stiffness, softer by a play at small torques."""
    scale = 1.0 if " 28" in task.name else 1.25
    torque = np.array([0.1, *task.torques])
    x = 0.05 * arcmin + torque / (scale * 1e5)
    steps = np.diff(x)
    return {
        "torque_Nm": torque.tolist(),
        "ring_torsion_rad": x.tolist(),
        "work_per_mu_J": (2.0 * steps).tolist(),
        "race_part": np.full(steps.size, 0.25).tolist(),
        "ring_compliance_rad_Nm": [1.0 / (scale * 1e5)] * torque.size,
        "ring_shares": {"rim": [0.7] * torque.size, "teeth": [0.3] * torque.size},
        "balls": [9.0] * torque.size,
        "tooth_pairs": [4.0] * torque.size,
    }


def single(task, torque):
    """Two angles, straight lines: softer from gear to gear, stiffer at the second."""
    soft = 1.0 + 0.1 * task.design.tolerances.seed
    return [(angle * soft * torque / 1e5).tolist() for angle in (1.0, 0.8)]


def turning(task):
    """Friction of 60 mN·m per mu, a quarter of the teeth; twice with 28 deg."""
    scale = 2.0 if task.name.endswith(" 28") else 1.0
    free = {
        "input_angles_rad": [0.0, 1.0],
        "elastic_Nm": [0.5e-3, -0.5e-3],
        "teeth_per_mu_Nm": [scale * 0.01, scale * 0.02],
        "race_per_mu_Nm": [scale * 0.03, scale * 0.06],
        "tooth_pairs": [2.0, 4.0],
        "lobe_forces_N": [[0.0, 0.0], [0.0, 0.0]],  # balls that do not press
        "bending_per_loss_factor_Nm": [0.1, 0.1],
    }
    load = {"teeth_per_mu_Nm": [scale * 0.2, scale * 0.2]}
    return {**free, "loaded": [free | load]}


def instant(task):
    """Numbers of the right shape at once."""
    if task.name == BROKEN:
        return {"fault": "no equilibrium", "wall_s": 0.0}
    if task.kind == "path":
        return curve(task) | {"wall_s": 0.0}
    if task.kind == "individual":
        torque = np.array([0.1, *task.torques])
        return {"torque_Nm": torque.tolist(), "ring_torsion_rad": single(task, torque)}
    if task.kind == "accuracy":
        theta = output_turn_angles(task.design, 96)
        error = 0.25 * arcmin * np.cos(2.0 * theta)
        return {"input_angles_rad": theta.tolist(), "error_rad": error.tolist()}
    if task.kind == "running":
        return turning(task) | {"wall_s": 0.0}
    fixed = task.name.endswith("fixed")
    return {"limit_Nm": 4000.0 if fixed else 1000.0, "passed": not fixed, "wall_s": 0.0}


@pytest.fixture
def computed(monkeypatch):
    """Replace every computation."""
    monkeypatch.setattr(study, "run_task", instant)


def options(**more):
    return StudyOptions(jobs=1, **more)


def test_stiffness_is_read_by_the_definition():
    """K of the segments 0..T1, T1..T2, T2..Tmax of a known curve and a known cup."""
    row = catalogue_row(25, 100)
    design = Design.preset("size-25-100")
    torques = torques_of(row)
    assert torques[-1] == max(row.repeated_peak, 1.5 * row.T2)
    path = friction_of_path(
        curve(CatalogueTask(name="x 28", kind="path", design=design, torques=torques)),
        design,
    )
    compliance = 1e-5 + series_compliance(design, cup=True)
    play = 0.05 * arcmin
    K = stiffnesses(path, row)
    assert K[1:] == pytest.approx(1.0 / compliance, rel=1e-12)
    assert K[0] == pytest.approx(row.T1 / (play + row.T1 * compliance), rel=1e-12)
    # 2 N·m of friction per mu, on the ring's part of the torsion alone
    R = 0.1 * 2e-5 / compliance
    assert path.hysteresis_loss(0.1) == pytest.approx(2 * (play + R * compliance))


def test_catalogue_values_are_those_of_the_tables():
    """Size 25: K of class 80 and 50, upper bounds, ratings of the size and ratio."""
    assert catalogue_stiffness(catalogue_row(25, 100)) == pytest.approx(
        [3.1e4, 5e4, 5.7e4]
    )
    assert catalogue_stiffness(catalogue_row(25, 50)) == pytest.approx(
        [2.5e4, 3.4e4, 4.4e4]
    )
    assert (
        printed_accuracy(catalogue_row(25, 80))["transmission_accuracy_arcmin"] == 0.8
    )
    with pytest.raises(InputError, match=naming("size", "26", "ratio", "80")):
        catalogue_row(26, 80)


def test_rows_hold_brackets_and_failures(computed):
    """Every case is there, the failed one with its reason; middles are middles."""
    found, study_file = study.run_catalogue(options()), CatalogueFile.load("catalogue")
    rows = {(row.case, row.quantity): row for row in found.rows}
    assert len(rows) == 15 * 7 + 3 * 4
    one = rows["size 25, ratio 100", "K2"]
    assert one.source_value == pytest.approx(5e4)
    assert one.ours == pytest.approx(0.5 * (one.more["low"] + one.more["high"]))
    assert one.more["low"] < one.ours < one.more["high"]
    series = [
        series_compliance(variant_design(25, 100, v), cup=True)
        for v in CatalogueFile.load("catalogue").variants
    ]
    assert one.more["high"] == pytest.approx(1.0 / (1 / 1.25e5 + min(series)), rel=1e-9)
    assert one.more["low"] == pytest.approx(1.0 / (1e-5 + max(series)), rel=1e-9)
    assert one.more["goal"] == 0.25
    # above 1.25, within 25 % twice; below 0.75
    met = [rows["size 25, ratio 100", key].more["met"] for key in ("K1", "K2", "K3")]
    assert met == [False, True, True]
    assert rows["size 32, ratio 100", "K2"].more["met"] is False
    assert rows["size 14, ratio 100", "K1"].more["goal"] is None
    broken = rows["size 20, ratio 80", "K1"]
    assert broken.ours is not None
    assert "no equilibrium" in broken.reason
    assert found.more["failed"] == [BROKEN]
    skips = rows["size 32, ratio 80", "ratcheting torque"]
    assert skips.ours == pytest.approx(1000.0 * (32 / 25) ** 3)
    assert "no limit up to" in skips.reason and "scaled" in skips.reason
    error = rows["size 17, ratio 50", "transmission accuracy"]
    assert error.ours == pytest.approx(0.5 * 25 / 17, rel=1e-5)  # dense angles
    assert rows["size 14, ratio 80", "transmission accuracy"].ours == (
        pytest.approx(0.5, rel=1e-5)
    )
    slow = rows["size 25, ratio 100", "no-load running torque"]
    assert slow.source_value == pytest.approx(195.0)
    # mean over the angles; mu of 0.05, one flank and no drag, to 0.1, the other flank
    # and the drag in the thickest oil; bending by 0.1 N·m and both loss factors
    bearing = BallBearing.from_design(variant_design(25, 100, study_file.variants[0]))
    drag = {
        oil: 1e3 * GreasedBearing.from_bearing(bearing, oil).drag_torque(RUNNING_SPEED)
        for oil in (*BASE_OILS, *(g.viscosity(ROOM) for g in MAKER_GREASES.values()))
    }
    ends = [3.0 + 100.0 * 2e-5, 12.0 + 100.0 * 1e-2 + drag[BASE_OILS[1]]]
    assert [slow.more["low"], slow.more["high"]] == pytest.approx(ends)
    named = sorted(drag[g.viscosity(ROOM)] for g in MAKER_GREASES.values())
    ends = [3.0 + 100.0 * 2e-5 + named[0], 12.0 + 100.0 * 1e-2 + named[-1]]
    assert slow.more["maker_greases"] == pytest.approx(ends)
    assert slow.more["conditions"].startswith("2000 rpm, +20 C, grease")
    assert "teeth 25 %" in slow.reason and "3 pairs" in slow.reason
    assert "bending 0.1 mN·m" in slow.reason and "seals" in slow.reason
    start = rows["size 25, ratio 100", "starting torque"]
    ends = [3.5 + 100.0 * 2e-5, 15.5 + 100.0 * 1e-2]
    assert [start.more["low"], start.more["high"]] == pytest.approx(ends)
    # 870 mN·m at rated torque; 245 mN·m per mu, twice with 28 deg
    best = rows["size 25, ratio 100", "efficiency at rated torque"]
    assert best.source_value == pytest.approx(77.0)
    ends = [
        87.0 / (0.87 + 0.049 + 1e-3 + 1e-3 * drag[BASE_OILS[1]]),
        87.0 / (0.87 + 0.01225 + 2e-6),
    ]
    assert [best.more["low"], best.more["high"]] == pytest.approx(ends)
    lines = "".join(found.summary)
    assert "running torque: the bracket contains the catalogue value in 4 of 4" in lines
    assert (
        "starting torque: the bracket contains the catalogue value in 0 of 4" in lines
    )
    shares = [r for r in found.more["shares"]["rows"] if r["ratio"] == 100]
    assert shares.pop()["K_without_over_with"] == pytest.approx([1.0] * 3)
    assert np.sum([r["share"] for r in shares], axis=0) == pytest.approx(np.ones(6))
    rubs = [r for r in found.more["friction"]["rows"] if r["ratio"] == 100]
    assert [r["mu"] for r in rubs] == [0.0, 0.05, 0.1]
    losses = np.array([r["hysteresis_loss_arcmin"] for r in rubs])
    # linear in mu, the play at no friction
    assert losses[0] == pytest.approx(0.1, rel=1e-6)
    assert losses[2] - losses[0] == pytest.approx(2 * (losses[1] - losses[0]))
    assert np.diff(rubs[-1]["round_loss_J"]).min() > 0.0
    # the tables have the largest at 80; equal ones of ours stay in order
    trend = "by ratio: model 50 > 80 > 100, catalogue 80 > 100 > 50"
    assert trend in "".join(found.summary)
    assert "individual gears" in "".join(found.summary)
    json.dumps(found.more)


def test_a_bracket_beside_the_catalogue_is_named(monkeypatch):
    """The case whose friction takes more than is stated, and by how much."""

    def heavy(task):
        one = turning(task)
        if "running 17" not in task.name:
            return one
        return one | {"race_per_mu_Nm": [30.0, 30.0]}

    monkeypatch.setattr(study, "run_task", heavy)
    found = study.run_catalogue(options(only=("losses",)))
    (line,) = (s for s in found.summary if "running torque: the bracket" in s)
    assert "in 3 of 4 cases" in line
    # 1.5 N·m of 51 mN·m
    assert "size 17, ratio 100 2.9e+03 %" in line


def test_the_command_writes_table_and_plot(computed, capsys, tmp_path):
    """Rows as the contract has them, three files, a part that is unknown refused."""
    out = tmp_path / "out"
    arguments = ["study", "catalogue", "--jobs", "1", "--json"]
    assert main([*arguments, "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    keys = "case quantity unit source_value ours converged reason".split()
    assert all(set(keys) <= set(row) for row in result["rows"])
    with (out / "catalogue.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(result["rows"])
    assert (out / "catalogue.png").read_bytes().startswith(b"\x89PNG")
    assert main([*arguments, "--only", "stifness"]) == 2
    assert names(capsys.readouterr().err, "--only", "stifness", "stiffness", "coning")
    assert main([*arguments, "--model", "2d"]) == 2


def test_results_are_kept(monkeypatch, tmp_path):
    """A second run computes nothing; a failure is kept, too; no cache, no files."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    calls = []

    def compute(task):
        calls.append(task.name)
        if task.name == "bad":
            raise ComputationError("no equilibrium\nmore")
        return {"value": 1.0}

    monkeypatch.setitem(runs.KINDS, "path", compute)
    design = Design.preset("size-25-50")
    good = CatalogueTask(name="good", kind="path", design=design, torques=(1.0,))
    bad = CatalogueTask(name="bad", kind="path", design=design, torques=(2.0,))
    for _ in range(2):
        assert run_task(good)["value"] == 1.0
        assert run_task(bad)["fault"] == "no equilibrium"
    assert calls == ["good", "bad"]
    for path in (tmp_path / "studies").iterdir():
        path.write_text("{")
    run_task(good)
    assert calls == ["good", "bad", "good"]


def test_individual_gears_differ_by_their_seed():
    """Same seed, same gear; the clearance stays inside its class."""
    file = CatalogueFile.load("catalogue")
    one, again, other = (file.individual(seed) for seed in (1, 1, 2))
    assert one.content_hash() == again.content_hash() != other.content_hash()
    # bore of 45 mm: 6 to 23 µm of ISO 5753-1
    drawn = [file.individual(s).wave_generator.bearing.clearance_um for s in range(20)]
    assert 6.0 <= min(drawn) < 10.0 and 19.0 < max(drawn) <= 23.0


def test_the_oval_circular_spline_has_the_stated_outside():
    """Root diameter and twice the rim are 1.37 pitch diameters, in every ratio."""
    for ratio in (50, 100):
        design = oval(Design.preset(f"size-25-{ratio}"))
        own, drive = design.circular_spline, design.drive
        assert own.outer_rim == "free"
        root = drive.module_mm * (drive.teeth_circular_spline + 1.6)
        outside = (root + 2.0 * own.rim_mm) * mm
        assert outside == pytest.approx(1.37 * 63.5 * mm, rel=1e-6)


@pytest.mark.slow
def test_one_case_runs_whole(monkeypatch, tmp_path):
    """One size at the smallest ratio by the real rings: K1 to K3 rise; it is kept."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    row = catalogue_row(25, 50)
    design = variant_design(25, 50, CatalogueFile.load("catalogue").variants[0])
    task = CatalogueTask(name="p", kind="path", design=design, torques=torques_of(row))
    found = run_task(task)
    K = stiffnesses(friction_of_path(found, design), row)
    assert K[0] < K[1] < K[2]
    assert run_task(task) == found


@pytest.mark.slow
def test_losses_of_the_smallest_size(monkeypatch, tmp_path):
    """Real rings: run in below, flooded around the table; the start far below it."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    file = CatalogueFile.load("catalogue")
    tasks = {task.name: task for task in study.tasks_of(file, "losses")}
    assert len(tasks) == 8
    task = tasks["running 14 100 20"]
    found = run_task(task)
    slow, loaded = (running_of(x, task.design) for x in (found, found["loaded"][0]))
    stated = stated_losses(catalogue_row(14, 100))
    for mu in file.coefficients:
        for oil in BASE_OILS:
            running = slow.running_torque(mu, RUNNING_SPEED, oil)
            assert 0.0 < running < stated.no_load_running
        oil = MAKER_GREASES["SK-1A, SK-2"].viscosity(ROOM)
        losses = [
            one.running_torque(mu, RUNNING_SPEED, oil, flooded=True)
            for one in (slow, loaded)
        ]
        assert losses[0] == pytest.approx(stated.no_load_running, rel=0.1)
        # within 5 points
        assert abs(0.1 / (0.1 + losses[1]) - stated.efficiency) < 0.05
        assert 0.0 < slow.starting_torque(mu) < 0.1 * stated.starting

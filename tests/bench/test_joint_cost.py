"""``swgjoint bench joint``: its references, what it measures, its rows."""

from __future__ import annotations

import copy
import csv
import json
from dataclasses import replace
from math import log2, pi, sqrt

import numpy as np
import pytest
from messages import names

from swgjoint.bench.joint import cost as joint_cost
from swgjoint.bench.joint.modes import numerical_damping
from swgjoint.bench.joint.scenes import exact
from swgjoint.bench.joint.splits import SPLITS, split
from swgjoint.bench.stability.joint import Start, hardening_drive, make_joint
from swgjoint.bench.stability.reference import reference
from swgjoint.cli.bench import joint_text
from swgjoint.cli.main import main
from swgjoint.joint.step_damping import restore_damping
from swgjoint.maps.drive_map import DriveMap
from swgjoint.provenance import provenance
from swgjoint.sim.accuracy import (
    Setting,
    Stepper,
    assemble_setting,
    attempt,
    attempt_assembled,
    cost_at,
    errors,
    relative_cost,
    rigid_arm,
)


@pytest.fixture(scope="module")
def reference_run(bench):
    """RK4 at 0.1 ms, and DOP853."""
    setting = Setting(level="full", integrator="RK4", step=1e-4)
    got = attempt(bench.scene, setting, bench.drives)
    return got.run, exact(got.run, got.assembly)


@pytest.mark.parametrize(("integrator", "order"), [("RK4", 4.0), ("discrete", 2.0)])
def test_order_of_the_integrators(integrator, order):
    """A free joint under load: RK4 of order four, the scheme where it lives of two."""
    keys = dict(rotor=1e-4, link=1.0)
    start = Start(torque=60.0, load=100.0, speed=20.0)
    best = reference(3e4, **keys, start=start)
    off = []
    for step in (1e-3, 5e-4):
        joint = make_joint(
            hardening_drive(3e4), **keys, step=step, integrator=integrator
        )
        off.append(best.error(joint, start, 1))
    assert log2(off[0] / off[1]) == pytest.approx(order, abs=0.15)


def test_the_reference_is_the_solution(bench, reference_run):
    """RK4 with the reference of the middle of a step is of the second order.

    The equations of DOP853 are written out; nothing of map or engine is in them.
    """
    run, best = reference_run
    setting = Setting(level="full", integrator="RK4", step=2e-4)
    coarse = attempt(bench.scene, setting, bench.drives).run
    own, twice = errors(run, best), errors(coarse, best)
    assert own["link_angle"] < 1e-4  # arcmin; a torsion of some arc minutes
    assert own["torsion"] < 1e-5
    assert twice["link_angle"] / own["link_angle"] == pytest.approx(4.0, abs=0.5)
    assert np.ptp(best.torsion) > 1e-5


def test_stiff_drives_are_rigid(bench):
    """The error of the rigid arm is the torsion, which falls with the stiffness."""
    off = {}
    for stiffness in (1e6, 1e7):
        drives = {"hardening": DriveMap.linear(stiffness, rated_torque=100.0)}
        rigid, full = (
            attempt(
                bench.scene,
                Setting(level=level, integrator="discrete", step=1e-3),
                drives,
            ).run
            for level in ("rigid", "full")
        )
        found = errors(rigid, full)
        assert found["torsion"] == pytest.approx(50.0 / stiffness * 10800 / pi, rel=0.2)
        off[stiffness] = found["link_angle"]
    assert off[1e7] < 0.2 * off[1e6]


def test_errors_of_a_known_difference(reference_run):
    """A constant, and a line of the spectrum, come out as such; nothing as zero."""
    run, _ = reference_run
    assert set(errors(run, run).values()) == {0.0}
    by = 2.0 * pi / 10800.0
    moved = replace(run, position=run.position + by, torsion=run.torsion - by)
    found = errors(moved, run)
    assert found["link_angle"] == pytest.approx(2.0)
    assert found["torsion"] == pytest.approx(2.0)
    window = run.steady
    n = window.stop - window.start - 1
    wave = np.zeros(run.time.size)
    wave[window] = 3.0 * np.sin(2.0 * pi * (n // 4) * np.arange(n + 1) / n)
    louder = replace(run, output_torque=run.output_torque + wave[:, None])
    rated = run.assembly.transmissions[0].drive.ratings.rated_torque
    found = errors(louder, run)["ripple_spectrum"]
    # the straight line that ripple is free of takes a little of the wave
    assert found == pytest.approx(100.0 * 3.0 / sqrt(2.0) / rated, rel=5e-3)


def test_a_coarse_run_lacks_the_upper_lines(reference_run):
    """What its samples cannot carry counts as an error."""
    run, _ = reference_run
    window = run.steady
    n = window.stop - window.start - 1
    wave = np.zeros(run.time.size)
    wave[window] = 3.0 * np.sin(2.0 * pi * (n * 3 // 8) * np.arange(n + 1) / n)
    louder = replace(run, output_torque=run.output_torque + wave[:, None])
    every = {
        name: getattr(run, name)[::2]
        for name in ("time", "position", "torsion", "output_torque", "tool_position")
    }
    whole = replace(run.assembly, sub_steps=2).without_sub_steps()
    coarse = replace(run, assembly=whole, **every)
    rated = run.assembly.transmissions[0].drive.ratings.rated_torque
    found = errors(coarse, louder)["ripple_spectrum"]
    assert found == pytest.approx(100.0 * 3.0 / sqrt(2.0) / rated, rel=0.02)


def test_damping_that_steps_add(bench):
    """Neither scheme nor compensated native spring adds any, at known frequencies."""
    step = 5e-4
    drives = {"hardening": DriveMap.linear(3e4, rated_torque=100.0)}
    found = {}
    for level in ("linear", "full"):
        setting = Setting(level=level, integrator="discrete", step=step)
        whole = assemble_setting(bench.scene, setting, drives)
        ((found[level]),) = numerical_damping(whole)
    # rotor 1e-4 kg m2 behind -100 or so, link 1 kg m2
    ratio = whole.transmissions[0].ratio
    w = sqrt(3e4 * (1.0 + 1.0 / (ratio**2 * 1e-4)))
    for frequency, own, _ in found.values():
        assert frequency == pytest.approx(w / (2.0 * pi), rel=1e-3)
        assert own == pytest.approx(0.02, abs=1e-4)
    # without compensation a native spring has half of h w = 0.12
    for level in found:
        assert abs(found[level][2]) < 2e-4


def test_splits_of_a_linear_drive(bench, monkeypatch):
    """Without kinematic error nothing is left to split: both are a plain native spring.

    The corrected one with mu = 1 puts in what it takes out.
    """
    monkeypatch.setitem(SPLITS, "corrected split", 1.0)
    drives = {"hardening": DriveMap.linear(3e4, rated_torque=100.0)}
    scene = bench.scene.with_changes({"defaults.damping_ratio": 0.0})
    setting = Setting(level="linear", integrator="discrete", step=2e-3)
    plain = assemble_setting(scene, setting, drives)
    restore_damping(plain.model, [t.attached for t in plain.transmissions])
    native = attempt_assembled(plain)
    for name in SPLITS:
        with split(
            scene, Setting(level="full", integrator=name, step=2e-3), drives
        ) as (whole):
            run = attempt_assembled(whole).run
        assert np.abs(run.position - native.run.position).max() < 1e-10


def test_splits_add_damping(bench):
    """The correction takes most of it away, the scheme of the joint all of it."""
    found = {}
    for name in SPLITS:
        setting = Setting(level="full", integrator=name, step=1e-3)
        with split(bench.scene, setting, bench.drives) as whole:
            ((_, _, found[name]),) = numerical_damping(whole)
    setting = Setting(level="full", integrator="discrete", step=1e-3)
    whole = assemble_setting(bench.scene, setting, bench.drives)
    ((_, own, found["discrete"]),) = numerical_damping(whole)
    assert own == pytest.approx(0.02, abs=1e-3)
    assert found["plain split"] > 0.1
    assert 0.01 < found["corrected split"] < 0.4 * found["plain split"]
    assert abs(found["discrete"]) < 1e-3


def test_cost_counts_sub_steps(bench, monkeypatch):
    """At equal time of a step: ten times the steps cost ten times; a real time is > 0.

    The time itself is not judged, other programs share the cores.
    """
    rigid = rigid_arm(bench.scene, bench.drives)

    def stepper(step):
        setting = Setting(level="rigid", integrator="discrete", step=step)
        return Stepper.from_assembly(
            assemble_setting(bench.scene, setting, bench.drives)
        )

    assert relative_cost(stepper(1e-3), rigid, pairs=3) > 0.0
    monkeypatch.setattr(Stepper, "seconds", lambda self: 2e-6)
    assert relative_cost(stepper(1e-3), rigid) == pytest.approx(1.0)
    assert relative_cost(stepper(1e-4), rigid) == pytest.approx(10.0)
    cut = stepper(1e-3).assembly
    half = replace(cut, model=copy.copy(cut.model))
    half.model.opt.timestep /= 2.0
    assert cost_at(half, 1.0) == pytest.approx(2.0 * cost_at(cut, 1.0))


def test_bench_joint(monkeypatch, capsys, tmp_path, bench):
    """Rows with the contract's keys, failures among them, and files; as a table."""
    chosen = [
        Setting(level="rigid", integrator="discrete", step=1e-3),
        Setting(level="full", integrator="discrete", step=1e-3),
        Setting(level="full", integrator="Euler", step=1e-3),
        Setting(level="full", integrator="RK4", step=5e-3),
    ]
    monkeypatch.setattr(joint_cost, "settings", lambda: chosen)
    monkeypatch.setattr(joint_cost, "bench_scene", lambda name: bench)
    monkeypatch.setattr(joint_cost, "REFERENCE_STEP", 1e-4)
    out = ["--out", str(tmp_path)]
    assert main(["bench", "joint", "--only", "bench", "--json", *out]) == 0
    result = json.loads(capsys.readouterr().out)
    keys = {"bench", "model", "setting", "error", "unit", "wall_s", "reference"}
    for row in result["rows"]:
        assert keys | {"outcome", "own_error", "cost", "pareto"} <= set(row)
        assert row["bench"] == "joint" and row["reference"] == "full, DOP853"
    link = {
        (row["model"], row["integrator"]): row
        for row in result["rows"]
        if row["quantity"] == "link_angle"
    }
    assert link["full", "RK4"]["outcome"] == "refused"
    assert "region" in link["full", "RK4"]["reason"]
    assert link["full", "RK4"]["error"] is None
    assert (
        link["full", "discrete"]["error"]
        < 0.1
        < 1.0
        < link["rigid", "discrete"]["error"]
    )
    assert link["rigid", "discrete"]["own_error"] < 0.1
    assert link["full", "Euler"]["outcome"] == "ok"
    assert any(row["pareto"] for row in link.values())
    assert not link["full", "RK4"]["pareto"]
    assert result["provenance"]["versions"]["mujoco"]
    names = {f"bench-joint.{suffix}" for suffix in ("csv", "json")}
    assert {path.name for path in tmp_path.iterdir()} == {
        *names,
        "bench-joint-bench.png",
    }
    with (tmp_path / "bench-joint.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(result["rows"])
    text = joint_text.report(result)
    assert "full, DOP853" in text and "refused" in text


def test_all_levels_and_integrators_are_run():
    """Every level with every integrator, steps from 1e-5 to 5e-3 s."""
    chosen = joint_cost.settings()
    assert len({(s.level, s.integrator) for s in chosen}) == 5 * 4 + len(SPLITS)
    full = sorted(
        s.step for s in chosen if (s.level, s.integrator) == ("full", "discrete")
    )
    assert len(full) == 8 and (full[0], full[-1]) == (1e-5, 5e-3)


def test_unknown_scenes_are_refused(capsys):
    """One line, exit status 2."""
    assert main(["bench", "joint", "--only", "ur6"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert names(lines[0], "swgjoint bench", "--only", "ur6", "ur5e", "iiwa14")


def test_provenance_names_what_ran():
    """Versions of what computes, the machine, a seed where one was used."""
    found = provenance(seed=3)
    assert {"mujoco", "numpy", "scipy", "python"} <= set(found["versions"])
    assert found["seed"] == 3 and found["machine"]["cores"] >= 1

"""Runs with friction: asked for per joint, in the torque of the motor, in the label."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import names, naming

from swgjoint.cli.run import left_out_lines
from swgjoint.drives.references import drive_of
from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.maps.friction_temperature import KEY, friction_table
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.sim.figures.rating_use import first_ratcheting
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
LAW = Friction(stiffness=50.0, coulomb=0.05, static=0.05, load=0.1, damping=0.05)
RUBBING = replace(LINEAR, friction=LAW)


@pytest.mark.parametrize("level", ["full", "native"])
def test_a_scene_has_friction_unless_it_says_false(bench, level):
    """The motor works against it; switched off nothing of it is in the model."""
    off = bench(RUBBING, defaults__level=level, defaults__friction=False)
    on = bench(RUBBING, defaults__level=level)
    torque = [run.motor_torque[run.steady, 0].mean() for run in (off, on)]
    # 20 N·m over i = -60; at level native no part of the load rubs
    rubs = 0.05 + (0.1 * 20.0 / 60.0 if level == "full" else 0.0)
    rubs *= 1.0 + 1.0 / 60.0 if level == "full" else 1.0
    assert abs(torque[0]) == pytest.approx(20.0 / 60.0, rel=1e-6)
    extra = abs(torque[1] - torque[0])
    assert extra == pytest.approx(rubs, rel=2e-3 if level == "full" else 0.02)
    label = [run.contains["joints"]["joint"]["friction"] for run in (off, on)]
    assert label == [None, "given"]
    changes = "part of the friction law: its dependence on load and speed"
    now = [item["part"] for item in on.contains["left_out"]]
    assert (changes in now) == (level == "native")
    left = [item["part"] for item in off.contains["left_out"]]
    assert "friction of the drive" in left
    assert "friction of the drive" not in now
    (line,) = (one for one in left_out_lines(off.contains) if "friction" in one)
    assert names(line, "joints.*.friction", "false")


def test_a_run_says_that_a_drive_without_friction_loses_nothing():
    """The catalogue states no losses of size 32: the motor works at no loss."""
    parts = {}
    for name in ("CSG-25-100", "CSG-32-100"):
        changes = {"defaults.drive": name, "simulation.duration_s": 3.0}
        run = run_scene("bench", overrides=changes)
        energy = run.metrics()["joints"]["joint"]["energy"]
        parts[name] = [one["part"] for one in run.contains["left_out"]]
        lossless = name == "CSG-32-100"
        assert (energy["efficiency"] > 0.9999) == lossless
        assert any("efficiency" in part for part in parts[name]) == lossless
    lines = left_out_lines(run.contains)
    assert any(names(line, "friction", "100 %", "catalogue") for line in lines)


@pytest.mark.parametrize("level, said", [("full", True), ("native", False)])
def test_a_run_says_that_its_ripple_has_no_friction_of_the_teeth(bench, level, said):
    """Maps of finite elements carry it as hysteresis; without ripple, no word of it."""
    parts = []
    for friction in ("left out of the potential", None):
        label = {"model": "2d", "friction": friction}
        drive = replace(LINEAR, info={**LINEAR.info, "label": label})
        run = bench(drive, defaults__level=level, simulation__duration_s=0.1)
        parts.append([item["part"] for item in run.contains["left_out"]])
    part = "effect of the friction of the teeth on the ripple"
    assert [part in some for some in parts] == [said, False]


def test_the_link_feels_the_friction_of_the_flexspline(bench):
    """Recorded output torque is the load: elastic part and friction on the link."""
    run = bench(RUBBING, defaults__friction=True, simulation__duration_s=3.0)
    late = slice(-200, None)  # the motor's loop has taken up the friction
    np.testing.assert_allclose(run.output_torque[late, 0], 20.0, rtol=1e-4)
    elastic = 2e4 * run.torsion[late, 0]
    rubs = 0.05 + 0.1 * 20.0 / 60.0
    assert np.abs(elastic - 20.0) == pytest.approx(rubs, rel=0.03)


def test_hysteresis_can_be_switched_off():
    """A joint may leave the hysteresis of its drive out."""
    element = Jenkin(stiffness=2e4, yield_torque=3.0)
    known = {"x": replace(LINEAR, hysteresis=(element,))}
    assert drive_of(JointSection(drive="x"), known=known).hysteresis == (element,)
    section = JointSection(drive="x", hysteresis=False)
    assert drive_of(section, known=known).hysteresis == ()


def test_ratcheting_is_reported(bench):
    """Above the ratcheting torque a run says when and at which torque, and goes on."""
    ratings = replace(LINEAR.ratings, ratcheting_torque=19.0)
    run = bench(replace(LINEAR, ratings=ratings))
    metrics = run.metrics()
    use = metrics["joints"]["joint"]["ratings"]
    assert use["ratcheting"]["time_s"] == 0.0
    assert use["ratcheting"]["torque_Nm"] == pytest.approx(20.0)
    assert use["ratcheting_margin"] == pytest.approx(0.95)
    (line,) = [line for line in metrics["reasons"] if "skip" in line]
    assert names(line, "joint", "0 s", "20 N·m", "19 N·m")
    for limit, margin in ((21.0, 1.05), (None, None)):
        ratings = replace(LINEAR.ratings, ratcheting_torque=limit)
        use = bench(replace(LINEAR, ratings=ratings)).metrics()
        use = use["joints"]["joint"]["ratings"]
        assert use["ratcheting"] is None
        assert use["ratcheting_margin"] == (margin and pytest.approx(margin))


def test_the_first_of_several_events():
    """Either sign of the torque counts; the first instant above the limit is told."""
    time, torque = np.arange(5.0), np.array([1.0, -3.0, 2.0, 5.0, 0.0])
    event = first_ratcheting(time, torque, 2.5)
    assert (event["time_s"], event["torque_Nm"]) == (1.0, -3.0)
    assert first_ratcheting(time, torque, 5.0) is None


def test_one_joint_switches_off_what_the_scene_asks_for(bench):
    """A joint's own ``friction = false`` goes before that of the defaults."""
    run = bench(
        RUBBING,
        defaults__friction=True,
        joints={"joint": {"friction": False}},
        simulation__duration_s=0.6,
    )
    assert run.assembly.model.ntendon == 1
    assert run.contains["joints"]["joint"]["friction"] is None


@pytest.mark.parametrize("level", ["full", "native"])
def test_the_motor_feels_the_temperature(bench, level):
    """Viscous torque of the table at the temperature; without the key as the map is."""
    laws = {
        T + 273.15: replace(LAW, load=0.0, viscous=v)
        for T, v in ((0.0, 0.04), (20.0, 0.01), (40.0, 0.0025))
    }
    table = {KEY: friction_table(laws, lubricant="an oil")}
    drive = replace(LINEAR, friction=laws[293.15], info=table)
    runs = {
        None: bench(drive, defaults__level=level),
        0.0: bench(drive, defaults__level=level, defaults__temperature_C=0.0),
        30.0: bench(drive, defaults__level=level, defaults__temperature_C=30.0),
    }
    torque = {
        key: abs(run.motor_torque[run.steady, 0].mean()) for key, run in runs.items()
    }
    speed = {
        key: abs(run.motor_velocity[run.steady, 0].mean()) for key, run in runs.items()
    }
    along = 1.0 + 1.0 / 60.0 if level == "full" else 1.0
    for key, viscous in ((0.0, 0.04), (30.0, 0.005)):
        change = torque[key] - torque[None]
        wanted = (viscous * speed[key] - 0.01 * speed[None]) * along**2
        assert change == pytest.approx(wanted, rel=0.02)
    label = runs[30.0].contains["joints"]["joint"]["friction"]
    assert names(label, "30 °C", "an oil")


def test_a_temperature_without_friction_is_refused(bench):
    """One line with the joint; out of the table with its range."""
    with pytest.raises(
        InputError, match=naming("joints.joint.temperature_C", "[losses]")
    ):
        bench(LINEAR, joints__joint__temperature_C=30.0)
    cold = replace(
        RUBBING, info={KEY: friction_table({280.0: LAW, 290.0: LAW}, lubricant="x")}
    )
    with pytest.raises(InputError, match=naming("-40 °C", "6.85 to 16.85 °C")):
        bench(cold, joints__joint__temperature_C=-40.0)

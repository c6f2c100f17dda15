"""Controllers from outside in scenes: the scene's own law, its sensors and limits."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from messages import naming

from swgjoint.control.motor_side import MotorPID, ideal_plan, rigid_plan
from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.friction import Friction
from swgjoint.sim.controller import ReadingAge
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
SWEEP = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.15, "end_deg": {"joint": 4.0}}
SCENE = {
    "name": "given",
    "arm": "bench",
    "defaults": {"drive": "map", "level": "full", "rotor_inertia_kgm2": 1e-4},
    "trajectory": SWEEP,
    "load": {"joint": {"torque_Nm": 20.0}},
    "controller": {"feedforward": "gravity_inertia", "control_period_s": 0.001},
    "simulation": {"duration_s": 0.6},
}
SENSORS = {
    "sensors.motor.counts_per_turn": 4096,
    "sensors.motor.delay_s": 0.002,
    "sensors.motor.noise_arcsec": 30.0,
    "sensors.seed": 3,
}


def run(drive=LINEAR, changes=None, **options):
    scene = Scene.from_data(SCENE, overrides=changes)
    return run_scene(scene, drives={"map": drive}, **options)


class Spy:
    """Gives no torque and remembers what it was told."""

    def start(self, task):
        """Keep the task."""
        self.task, self.read = task, []

    def torque(self, k, measured):
        """Keep the reading."""
        self.read.append((k, measured))
        return np.zeros_like(measured.motor_angle)


@pytest.mark.parametrize("kind", ["pd", "pid"])
@pytest.mark.parametrize("changes", [{}, SENSORS, {"defaults.level": "rigid"}])
def test_pid_from_outside_is_the_scenes_own(synthetic_map, kind, changes):
    """Same gains, plan and sensors, old readings included: the same to round-off."""
    changes = {"controller.kind": kind, **changes}
    own = run(synthetic_map, changes)
    loops = own.assembly.loops
    time = None if kind == "pd" else float((loops.stiffness / loops.integral)[0])
    pid = MotorPID(rigid_plan, integral_time=time)
    given = run(synthetic_map, changes, controller=pid)
    for key in ("position", "motor_position", "motor_torque", "wanted_torque"):
        np.testing.assert_allclose(
            getattr(given, key), getattr(own, key), rtol=1e-10, atol=1e-12
        )
    assert given.contains["controller"]["kind"] == "MotorPID"
    mine, other = given.metrics(), own.metrics()
    assert json.loads(json.dumps(mine)).keys() == other.keys()
    assert mine["energy"]["balance_error_J"] == pytest.approx(
        other["energy"]["balance_error_J"], abs=1e-9
    )


def test_sub_steps_lie_within_a_control_period():
    """A stiff joint under RK4 is cut into parts; the controller is asked as before."""
    stiff = DriveMap.linear(3e6, teeth_flexspline=120, teeth_circular_spline=122)
    changes = {"simulation.integrator": "RK4", "simulation.duration_s": 0.55}
    own, spy = run(stiff, changes), Spy()
    assert own.assembly.sub_steps > 1
    given = run(stiff, changes, controller=MotorPID(rigid_plan))
    np.testing.assert_allclose(given.position, own.position, rtol=1e-10, atol=1e-12)
    got = run(stiff, changes, controller=spy)
    assert [k for k, _ in spy.read] == list(range(550))
    np.testing.assert_array_equal(spy.task.position, got.reference)


def test_gains_and_period_follow_the_scene(synthetic_map):
    """At another period, with gains given outright, it is the scene's law as well."""
    changes = {
        "controller.control_period_s": 0.003,
        "controller.stiffness_Nm_rad": 0.6,
        "controller.damping_Nms_rad": 0.02,
    }
    own = run(synthetic_map, changes)
    pd = MotorPID(rigid_plan, stiffness=0.6, damping=0.02)
    given = run(synthetic_map, changes, controller=pd)
    np.testing.assert_allclose(given.position, own.position, rtol=1e-10, atol=1e-12)
    assert pd.planned.angle.shape == (201, 1)


def test_the_task_is_the_motion_at_the_instants_of_the_control():
    """Motion, known torque and joints as the scene has them, one per period."""
    spy = Spy()
    motor = {"defaults.motor": {"torque_limit_Nm": 2.0}}
    got = run(changes={"controller.control_period_s": 0.002, **motor}, controller=spy)
    task, whole = spy.task, got.assembly
    assert task.period == pytest.approx(0.002)
    np.testing.assert_array_equal(task.position, got.reference[::2])
    expected = 20.0 + 1.0 * whole.trajectory.acceleration[::2]
    np.testing.assert_allclose(task.link_torque, expected, rtol=1e-6)
    joints = task.joints
    assert joints.names == ("joint",) and joints.ratio[0] == -60.0
    assert joints.link_inertia[0] == pytest.approx(1.0)
    assert joints.torque_limit[0] == 2.0
    assert joints.damping[0] == whole.transmissions[0].attached.damping
    assert [k for k, _ in spy.read] == list(range(300))


@pytest.mark.parametrize("delay", [0.001, 0.002, 0.003])
def test_values_of_the_task_are_as_old_as_readings(delay):
    """What an exact sensor reads of the motor is the motor's motion as it is read.

    Instants that lie between two of the control by the straight line.
    """
    spy = Spy()
    changes = {"controller.control_period_s": 0.002, "sensors.motor.delay_s": delay}
    got = run(changes=changes, controller=spy)
    read = np.array([measured.motor_angle for _, measured in spy.read])
    true = got.motor_position[::2]
    late = spy.task.as_read(true, "motor")[: len(read)]
    # an eighth of the second difference
    between = 0.0 if delay == 0.002 else np.abs(np.diff(true, 2, axis=0)).max() / 7.0
    np.testing.assert_allclose(late, read, rtol=0, atol=between)
    assert np.abs(true[: len(read)] - read).max() > 10.0 * np.abs(late - read).max()
    waves = np.exp(1j * true)
    np.testing.assert_array_equal(spy.task.as_read(waves, "motor")[0], waves[0])
    assert spy.task.as_read(true, "link") is true  # to the last bit


def test_an_unknown_payload_is_not_in_the_known_torque():
    """The controller is told the arm that it knows; the scene moves the other one."""
    spy = Spy()
    step = {"kind": "step", "at_s": 0.1, "step_deg": {"elbow": 1.0}}
    load = {"elbow": {"torque_Nm": 5.0}}
    keys = {"arm": "two-link", "trajectory": step, "load": load}
    payload = {"payload": {"mass_kg": 2.0, "known": False}}
    scene = Scene.from_data(SCENE, overrides={**keys, **payload})
    run_scene(scene, drives={"map": LINEAR}, controller=spy)
    hidden = spy.task.link_torque
    run(changes=keys, controller=spy)
    np.testing.assert_allclose(hidden, spy.task.link_torque, rtol=0, atol=1e-12)
    run(changes={**keys, "payload": {"mass_kg": 2.0}}, controller=spy)
    assert np.abs(hidden - spy.task.link_torque).max() > 1.0


def test_readings_are_the_sensors(synthetic_map):
    """Link angle by an encoder under link feedback, torque by its sensor, else none."""
    spy = Spy()
    got = run(synthetic_map, controller=spy)
    assert spy.read[5][1].link_angle is None and spy.read[5][1].output_torque is None
    np.testing.assert_array_equal(spy.read[5][1].motor_angle, got.motor_position[5])
    late = {
        "controller.feedback": "link",
        "sensors.link.delay_s": 0.002,
        "sensors.torque.delay_s": 0.003,
    }
    assert spy.task.reading_age == ReadingAge()
    got = run(synthetic_map, late, controller=spy)
    assert spy.task.reading_age == ReadingAge(link=0.002, torque=0.003)
    read = spy.read[400][1]
    np.testing.assert_array_equal(read.link_angle, got.position[398])
    np.testing.assert_allclose(read.output_torque, got.output_torque[397], rtol=1e-9)


def test_noise_has_its_deviation_and_its_seed(synthetic_map):
    """Readings scatter as stated; one seed, one run."""
    spy, found = Spy(), []
    keys = {
        "controller.feedback": "link",
        "sensors.motor.noise_arcsec": 60.0,
        "sensors.link.noise_arcsec": 2.0,
        "sensors.torque.noise_Nm": 0.5,
    }
    for seed in (1, 1, 2):
        got = run(synthetic_map, {**keys, "sensors.seed": seed}, controller=spy)
        n = len(spy.read)
        found.append(
            [
                np.array([r.motor_angle for _, r in spy.read]) - got.motor_position[:n],
                np.array([r.link_angle for _, r in spy.read]) - got.position[:n],
                np.array([r.output_torque for _, r in spy.read])
                - got.output_torque[:n],
            ]
        )
    np.testing.assert_array_equal(found[0], found[1])
    second = np.pi / 648000.0
    for noise, other, deviation in zip(
        found[0], found[2], (60 * second, 2 * second, 0.5), strict=True
    ):
        # 600 readings tell a deviation to 3 %
        assert np.std(noise) == pytest.approx(deviation, rel=0.12)
        assert np.abs(noise - other).max() > deviation


def test_motors_keep_their_limits():
    """What the controller asks for beyond the limit is not given, and is counted."""
    got = run(changes={"defaults.motor": {"torque_limit_Nm": 0.3}},
              controller=MotorPID(ideal_plan, frequency=30.0))  # fmt: skip
    assert np.abs(got.motor_torque).max() <= 0.3
    assert got.metrics()["joints"]["joint"]["motor"]["at_limit_s"] > 0.0


@pytest.mark.parametrize("layout", ["circular_spline_fixed", "flexspline_fixed"])
def test_friction_of_the_known_drive_is_carried(layout):
    """At constant speed either way the motor gives what slipping takes: no error."""
    law = Friction(stiffness=50.0, coulomb=0.05, static=0.05, viscous=1e-3, load=0.05)
    drive = replace(
        DriveMap.linear(2e4, layout=layout, teeth_flexspline=120,
                        teeth_circular_spline=122), friction=law)  # fmt: skip
    for speed in (20.0, -20.0):
        keys = {
            "trajectory": {"kind": "constant_speed", "speed_deg_s": {"joint": speed}},
            "defaults.friction": True,
        }
        got = run(drive, keys, controller=MotorPID(rigid_plan))
        off = (drive.ratio * got.reference - got.motor_position)[-1, 0]
        # without it: friction over the gain
        friction = abs(got.friction_torque[-1, 0])
        assert friction > 0.05
        assert abs(off) < 0.01 * friction / got.assembly.loops.stiffness[0]


def test_a_run_of_a_controller_is_recorded(tmp_path):
    """The viewer's file is written as for any run."""
    got = run(changes={"simulation.duration_s": 0.55}, controller=MotorPID())
    assert got.to_rerun(tmp_path / "run.rrd").stat().st_size > 10_000


def test_a_batch_of_motions_is_controlled_at_once():
    """Leading axes are motions side by side, gains may differ from one to the next."""
    spy = Spy()
    run(controller=spy)
    task, read = spy.task, spy.read[7][1]
    alone = []
    for frequency in (5.0, 9.0):
        pid = MotorPID(frequency=frequency, integral_time=0.1)
        pid.start(task)
        alone.append([pid.torque(k, read) for k in (7, 8)][-1])
    both = MotorPID(frequency=np.array([[5.0], [9.0]]), integral_time=0.1)
    both.start(task)
    got = [both.torque(k, read) for k in (7, 8)][-1]
    np.testing.assert_allclose(got, np.stack(alone), rtol=1e-12)


class Broken(Spy):
    """Asks for something that is no torque."""

    def torque(self, k, measured):
        """Two numbers for one joint, after the first instant."""
        return np.full(2, 1.0) if k else np.zeros(1)


def test_bad_controllers_and_arguments_are_refused():
    """One clear line each."""
    with pytest.raises(
        ComputationError, match=naming("Broken", "torque", "[1. 1.]", "[N·m]", "joint")
    ):
        run(controller=Broken())
    with pytest.raises(InputError, match=naming("known_drives", "controller")):
        run(known_drives={"joint": LINEAR})
    with pytest.raises(InputError, match=naming("known_drives", "'elbow'", "joint")):
        run(controller=Spy(), known_drives={"elbow": LINEAR})
    with pytest.raises(
        InputError, match=naming("sensors.torque", "controller", "run_scene")
    ):
        run(changes={"sensors.torque.noise_Nm": 0.1})
    stiff = DriveMap.linear(9e4, teeth_flexspline=120, teeth_circular_spline=122)
    spy = Spy()
    run(controller=spy, known_drives={"joint": stiff})
    assert spy.task.joints.drives == (stiff,)

"""Runs of the bench: closed forms, balance, equality with twins."""

import mujoco
import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.actuators import control_inputs
from swgjoint.sim.assembly import assemble
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)


@pytest.mark.parametrize("level", ["linear", "full"])
def test_a_linear_joint_under_constant_load_twists_by_torque_over_stiffness(
    bench, level
):
    """Torsion is T/K from the first instant to the last, the error is its negative."""
    run = bench(LINEAR, defaults__level=level)
    np.testing.assert_allclose(run.torsion, 20.0 / 2e4, rtol=1e-9)
    np.testing.assert_allclose(run.transmission_error, -20.0 / 2e4, rtol=1e-9)
    np.testing.assert_allclose(run.output_torque, 20.0, rtol=1e-9)
    # the motor carries T/i, signed: the ratio is -60
    np.testing.assert_allclose(run.motor_torque, -20.0 / 60.0, rtol=1e-6)


def test_a_nonlinear_joint_twists_as_its_map_says(bench, plain_map):
    """The torsion under load is that of the mean curve."""
    run = bench(plain_map, load__joint__torque_Nm=45.0)
    np.testing.assert_allclose(run.torsion, plain_map.mean_torsion(45.0), rtol=1e-8)


def test_a_rigid_joint_has_no_torsion_and_carries_the_load(bench, synthetic_map):
    """Torsion and error are zero, link and motor move as one, torque is the load."""
    run = bench(synthetic_map, defaults__level="rigid")
    assert not run.torsion.any()
    assert not run.transmission_error.any()
    np.testing.assert_allclose(run.motor_position, -60.0 * run.position)
    np.testing.assert_allclose(run.output_torque[1:], 20.0, rtol=1e-9)
    np.testing.assert_allclose(run.position, run.reference, atol=1e-12)


def test_feedforward_of_the_inertia_lets_the_rigid_arm_follow(bench, synthetic_map):
    """With weight, load and inertia fed forward the control loop has nothing to do."""
    sweep = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.2, "end_deg": {"joint": 10.0}}
    # the engine's positions lead by half a step of travel: a fine step
    timing = {"duration_s": 1.0, "step_s": 1e-4}
    keys = dict(defaults__level="rigid", trajectory=sweep, simulation=timing)
    exact = bench(synthetic_map, controller__feedforward="gravity_inertia", **keys)
    plain = bench(synthetic_map, controller__feedforward="gravity", **keys)
    lag = np.abs(exact.position - exact.reference).max()
    assert lag < 0.02 * np.abs(plain.position - plain.reference).max()
    # the drive gives load and link inertia, 1 kg·m²; its rotor is none of the link's
    needed = 20.0 + 1.0 * exact.assembly.trajectory.acceleration
    assert np.ptp(needed) > 3.0
    # a step behind: jerk times the step
    np.testing.assert_allclose(exact.output_torque, needed, atol=0.02)


def test_a_rigid_arm_follows_within_the_order_of_rk4_steps(bench, synthetic_map):
    """With all torques fed forward: 1e-5 of the travel, and a quarter at half the step.

    A reference held from the start of a step is half a step late: 1e-3 of the travel.
    """
    sweep = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.2, "end_deg": {"joint": 10.0}}
    lag = []
    for step in (2e-3, 1e-3):
        run = bench(
            synthetic_map,
            controller__feedforward="gravity_inertia",
            defaults__level="rigid",
            trajectory=sweep,
            simulation={"duration_s": 1.0, "step_s": step, "integrator": "RK4"},
        )
        lag.append(np.abs(run.position - run.reference).max())
    assert lag[0] < 2e-5 * np.ptp(run.reference)
    assert lag[0] / lag[1] == pytest.approx(4.0, rel=0.1)


def test_a_joint_at_rest_stays_at_rest(bench, synthetic_map):
    """The start is an equilibrium: with load and cogging, nothing moves."""
    run = bench(
        synthetic_map,
        trajectory__speed_deg_s__joint=0.0,
        trajectory__start_deg={"joint": 17.0},
    )
    # 1e-9 rad is a thousandth of a millionth of the torsion of 1e-3 rad
    assert np.ptp(run.position, axis=0).max() < 1e-9
    np.testing.assert_allclose(run.output_torque, 20.0, rtol=1e-6)


@pytest.mark.parametrize("kind", ["pd", "computed_torque"])
def test_an_arm_under_link_feedback_starts_at_rest(kind):
    """The loop acts on the link, which starts on the reference; the motor is ahead."""
    linear = {"linear": {"stiffness_Nm_rad": 1e4}, "level": "linear"}
    scene = Scene.from_data(
        {
            "name": "held",
            "arm": "two-link",
            "defaults": {**linear, "rotor_inertia_kgm2": 1e-4},
            "trajectory": {"kind": "sweep", "end_deg": {}},
            "controller": {"kind": kind, "feedback": "link"},
            "simulation": {"duration_s": 2.5},
        }
    )
    run = run_scene(scene)
    assert np.abs(run.torsion[0]).max() > 1e-4
    assert np.ptp(run.position, axis=0).max() < 1e-7


def test_the_arm_starts_with_its_weight_on_the_drives(synthetic_map):
    """All six joints of the UR5e rest in balance with gravity, none is ringing."""
    run = run_scene(
        "ur5e-sweep",
        overrides={"simulation.duration_s": 4.0, "trajectory.hold_s": 0.3},
        drives={"reference-2d": synthetic_map},
    )
    rest = run.time < 0.29
    needed = run.assembly.arm.gravity(run.position[:1])
    np.testing.assert_allclose(run.output_torque[:1], needed, atol=1e-6)
    assert np.abs(run.output_torque[0]).max() > 10.0
    swing = np.ptp(run.output_torque[rest], axis=0)
    assert swing.max() < 1e-4  # of torques of 15 N·m


def test_the_ur5e_is_stable_at_two_milliseconds(synthetic_map):
    """Twice the step gives the same torsion where it matters, and no vibration."""
    fine, coarse = (
        run_scene(
            "ur5e-sweep",
            overrides={"simulation.duration_s": 6.0, "simulation.step_s": step},
            drives={"reference-2d": synthetic_map},
        )
        for step in (1e-3, 2e-3)
    )
    window, half = fine.steady, coarse.steady
    np.testing.assert_allclose(
        fine.torsion[window].mean(axis=0), coarse.torsion[half].mean(axis=0), atol=3e-6
    )
    assert (np.ptp(coarse.torsion[half], axis=0) < 1e-3).all()
    assert np.ptp(fine.position, axis=0).max() > 0.5


def test_energy_balances(bench, synthetic_map):
    """Work of the motor is work on the load, plus stored energy, plus the damper's."""
    h = 2.5e-4
    run = bench(
        synthetic_map,
        simulation={"duration_s": 2.0, "step_s": h},
        defaults__damping_ratio=0.1,
    )
    drive = run.assembly.transmissions[0]
    theta, psi = run.motor_position[:, 0], run.position[:, 0]
    theta_rate, psi_rate = run.motor_velocity[:, 0], run.velocity[:, 0]
    # the loop acts at the end of a step, over the way of that step
    motor = np.sum(run.motor_torque[1:, 0] * np.diff(theta))
    load = 20.0 * (psi[-1] - psi[0])
    kinetic = 0.5 * (1e-4 * theta_rate**2 + 1.0 * psi_rate**2)
    elastic = drive.law.energy(drive.law.torsion(theta, psi), theta, psi)
    stored = np.diff((kinetic + elastic)[[0, -1]])[0]
    rate = np.gradient(run.torsion[:, 0], run.time)
    damped = drive.attached.damping * np.sum(rate**2) * h
    assert damped > 1e-3 * load  # the ripple costs something, or this tests nothing
    # 2 J of work balance to 6e-6 J; the damper's share is 3.5e-3 J
    assert motor - load - stored == pytest.approx(damped, rel=0.01)


def test_levels_agree_where_the_map_is_linear(bench):
    """A linear map in the plugin moves the arm like the native spring."""
    moves = dict(
        trajectory={
            "kind": "sweep",
            "hold_s": 0.05,
            "ramp_s": 0.15,
            "end_deg": {"joint": 1.0},
        },
        simulation__step_s=1e-4,
    )
    native = bench(LINEAR, defaults__level="linear", **moves)
    plugin = bench(LINEAR, defaults__level="full", **moves)
    swing = np.ptp(native.torsion)
    assert swing > 1e-5
    # the native spring is damped by the step itself, h w / 2
    assert np.abs(native.torsion - plugin.torsion).max() < 0.02 * swing


def test_the_rollout_equals_single_steps(bench, synthetic_map):
    """States of the engine's rollout are those of a plain loop, bit by bit."""
    run = bench(synthetic_map)
    model = run.assembly.model
    data = mujoco.MjData(model)
    set_start(run.assembly, data)
    joint = run.assembly.link_position[0]
    for k, inputs in enumerate(control_inputs(run.assembly)):
        assert data.qpos[joint] == run.position[k, 0]
        data.ctrl[:] = inputs
        mujoco.mj_step(model, data)


def test_tool_error_follows_from_the_joint_error(bench, synthetic_map):
    """The tool lies at 0.5 m: its error is the chord of the link error."""
    run = bench(synthetic_map)
    link = run.position[:, 0] - run.reference[:, 0]
    np.testing.assert_allclose(run.tool_error(), np.abs(2 * 0.5 * np.sin(link / 2)))
    assert run.tool_error(run).max() == 0.0


def test_a_run_that_diverges_is_a_failure_with_advice(
    bench, plain_map, tmp_path, monkeypatch
):
    """A motor loop too stiff for an explicit step ends with step and remedy.

    The engine warns on the console and leaves no log in the working folder.
    """
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        ComputationError,
        match=naming("'bench test'", "0.005 s", "RK4", "simulation.step_s", "discrete"),
    ):
        bench(
            plain_map,
            defaults__level="rigid",
            simulation={"integrator": "RK4", "step_s": 0.005, "duration_s": 5.0},
            controller={"natural_frequency_Hz": 500.0, "damping_ratio": 1.0},
            trajectory={"kind": "sweep", "hold_s": 0.5, "end_deg": {"joint": 5.0}},
        )
    assert list(tmp_path.iterdir()) == []
    assert mujoco.MjLogConfig.get().logto_file


@pytest.mark.parametrize("sampled", [False, True])
def test_inputs_that_the_engine_drops_are_a_failure(bench, sampled):
    """A loop that asks for 1e11 N·m and more is not run without its motor."""
    gains = {"stiffness_Nm_rad": 1e13, "damping_Nms_rad": 1.0}
    period = {"control_period_s": 1e-3} if sampled else {}
    with pytest.raises(
        ComputationError, match=naming("'bench test'", "t = 0.", "1e10", "gains")
    ):
        bench(
            DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122),
            defaults__level="rigid",
            controller=gains | period,
            trajectory__start_deg={"joint": 10.0},
        )


def test_contents_name_what_is_in_the_model(bench, synthetic_map):
    """Rigid adds nothing; linear a rotor and a tendon; full a plugin instance too."""
    found = {
        level: bench(synthetic_map, defaults__level=level).contains
        for level in ("rigid", "linear", "full")
    }
    counts = ("degrees_of_freedom", "tendons", "plugin_instances")
    assert [found["rigid"][key] for key in counts] == [1, 0, 0]
    assert [found["linear"][key] for key in counts] == [2, 1, 0]
    assert [found["full"][key] for key in counts] == [2, 1, 1]
    assert "level rigid" in found["rigid"]["left_out"][0]["part"]
    assert found["full"]["left_out"] == []


def test_contents_state_the_damping_that_steps_leave(bench):
    """Damped as asked at linear; what the corners of native add is listed, at its step.

    RK4 damps nothing, and the model is without compensation.
    """
    drive = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    found = {}
    for level in ("linear", "native"):
        run = bench(drive, defaults__level=level, simulation__duration_s=0.02)
        joint, left = run.contains["joints"]["joint"], run.contains["left_out"]
        found[level] = joint["step_damping_ratio_rated"]
        assert joint["step_damping_ratio"] == pytest.approx(0.022, abs=0.004)
        assert joint["step_frequency_Hz"] < joint["natural_frequency_Hz"]
        told = [item for item in left if "damping ratio" in item["part"]]
        assert len(told) == (level == "native")
    assert found["linear"] < 0.02 < 0.05 < found["native"] < 0.15
    fixed = bench(
        drive,
        defaults__level="native",
        simulation__integrator="RK4",
        simulation__step_s=1e-4,
        simulation__duration_s=0.02,
    )
    assert "step_damping_ratio" not in fixed.contains["joints"]["joint"]
    (one,) = fixed.assembly.transmissions
    assert one.attached.compensated == 0.0


def test_unknown_joints_are_refused_together():
    """Every key that names a joint the arm does not have gives one line."""
    scene = Scene.load_file(
        "bench",
        {
            "joints.elbow.level": "full",
            "trajectory.speed_deg_s.wrist": 1.0,
            "load.knee.torque_Nm": 1.0,
        },
    )
    with pytest.raises(InputError) as caught:
        assemble(scene, drives={"reference-2d": LINEAR})
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    for key in ("joints.elbow", "trajectory.speed_deg_s.wrist", "load.knee"):
        assert any(names(line, key, "arm 'bench'", "joint") for line in lines)


def test_a_joint_without_drive_or_rotor_is_refused():
    """What a joint lacks is named with the place where it belongs."""
    scene = Scene.load_file("bench").with_changes({"defaults": {}})
    with pytest.raises(InputError) as caught:
        assemble(scene)
    text = str(caught.value)
    assert names(text, "joints.joint.drive", "linear", "[defaults]")
    assert names(text, "joints.joint.rotor_inertia_kgm2", "[defaults]")

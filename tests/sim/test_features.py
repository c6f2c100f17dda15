"""Limits, payload, sensors and disturbances: closed forms, and no trace without."""

import json
from math import pi

import mujoco
import numpy as np
import pytest
from messages import names

from swgjoint.errors import InputError
from swgjoint.joint.attach import attach_all
from swgjoint.joint.fitting import Fitting
from swgjoint.joint.step_damping import StepMode
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.actuators import control_inputs
from swgjoint.sim.arm.payload import arms_of
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.assembly import assemble
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.figures import contains
from swgjoint.sim.figures.contains import contents
from swgjoint.sim.scene.feature_sections import Payload
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
INERTIA = 1e-4 + 1.0 / 60.0**2  # rotor and load of the bench at the motor
STEP = {"kind": "step", "at_s": 0.05, "step_deg": {"joint": 40.0}}
REST = {"trajectory__speed_deg_s__joint": 0.0}


def saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


@pytest.mark.parametrize("name", ["bench", "ur5e-sweep"])
def test_a_plain_scene_has_no_trace_of_any_feature(name, synthetic_map):
    """Its model is byte for byte arm, drives, one affine motor a joint, and loads."""
    scene = Scene.load_file(name)
    assembly = assemble(scene, drives={"reference-2d": synthetic_map})
    arm = RigidArm(scene.arm)
    spec = arm.spec()
    spec.option.timestep = 1e-3
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    path = assembly.trajectory
    fittings = {
        joint: Fitting(
            drive=synthetic_map,
            rotor_inertia=scene.joint_settings(joint).rotor_inertia_kgm2,
            max_input_speed=60.0 * float(path.top_speed[j]) or None,
        )
        for j, joint in enumerate(arm.joints)
    }
    attach_all(spec, fittings)
    for j, joint in enumerate(arm.joints):
        motor = spec.add_actuator(name=f"{joint}_motor", target=f"{joint}_rotor")
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.gear[0] = motor.gainprm[0] = 1.0
        loops = assembly.loops
        motor.biasprm[:3] = [0.0, -loops.stiffness[j], -loops.damping[j]]
    for joint in scene.load:
        load = spec.add_actuator(name=f"{joint}_load", target=joint)
        load.trntype = mujoco.mjtTrn.mjTRN_JOINT
        load.gear[0] = -1.0
    assert saved(assembly.model) == saved(spec.compile())


FEATURES = {
    "motor_limits": {"defaults.motor.torque_limit_Nm": 2.0},
    "payload": {"payload.mass_kg": 2.0},
    "sensors": {"sensors.motor.delay_s": 0.002},
    "disturbances": {
        "disturbance": [
            {"kind": "tool_force", "force_N": [1, 0, 0], "start_s": 1, "duration_s": 1}
        ]
    },
}


@pytest.mark.parametrize("feature", FEATURES)
def test_contents_list_a_feature_only_where_it_is(feature, synthetic_map):
    """What the scene asks for is listed, as JSON, and nothing else."""
    drives = {"reference-2d": synthetic_map}
    plain = assemble(Scene.load_file("bench"), drives=drives)
    assert not set(FEATURES) & set(contents(plain))
    changed = assemble(Scene.load_file("bench", FEATURES[feature]), drives=drives)
    found = contents(changed)
    assert set(FEATURES) & set(found) == {feature}
    json.dumps(found)


def test_a_torque_limit_accelerates_evenly(bench):
    """A long step of the rigid bench starts with limit over inertia, and holds it."""
    run = bench(
        LINEAR,
        defaults__level="rigid",
        defaults__motor={"torque_limit_Nm": 0.5},
        trajectory=STEP,
        load={},
        simulation__duration_s=0.15,
    )
    # the reference of a step's end acts in that step, and positions follow the speed
    n = np.arange(40)
    expected = 0.5 * n * (n + 1) * 1e-6 * (-0.5 / INERTIA / -60.0)
    np.testing.assert_allclose(run.position[49:89, 0], expected, atol=1e-12)
    np.testing.assert_allclose(run.motor_torque[50:89, 0], -0.5)
    assert np.abs(run.motor_torque).max() == 0.5
    assert np.abs(run.wanted_torque).max() > 5.0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_torque_speed_line_lets_the_speed_rise_exponentially(bench, way):
    """A demand never met: w = w0 (1 - exp(-t stall / (J w0)))."""
    stall, top = 0.5, 300.0 * np.pi / 30.0
    run = bench(
        LINEAR,
        defaults__level="rigid",
        defaults__motor={"stall_torque_Nm": stall, "no_load_speed_rpm": 300.0},
        trajectory=STEP | {"step_deg": {"joint": 170.0 * way}},
        load={},
        simulation={"duration_s": 0.15, "step_s": 1e-4},
    )
    t = np.maximum(run.time - 0.0499, 0.0)  # from the step that ends at 0.05 s
    expected = -way * top * (1.0 - np.exp(-t * stall / (INERTIA * top)))
    # first order in the step: h / (2 e) over the time constant of 24 ms
    np.testing.assert_allclose(run.motor_velocity[:, 0], expected, atol=1e-3 * top)
    assert np.abs(run.motor_velocity).max() > 0.9 * top
    # on the line: what is left of the stall torque at that speed
    line = -way * stall * (1.0 - np.abs(run.motor_velocity[:, 0]) / top)
    np.testing.assert_allclose(run.motor_torque[t > 1e-3, 0], line[t > 1e-3], rtol=1e-9)


def test_a_current_limit_is_a_torque_limit(bench):
    """Torque constant times current bounds the motor, and the tighter bound counts."""
    for motor, bound in (
        ({"torque_constant_Nm_A": 0.1, "current_limit_A": 4.0}, 0.4),
        (
            {
                "torque_constant_Nm_A": 0.1,
                "current_limit_A": 4.0,
                "torque_limit_Nm": 0.3,
            },
            0.3,
        ),
    ):
        run = bench(LINEAR, defaults__motor=motor, trajectory=STEP, load={})
        assert np.abs(run.motor_torque).max() == pytest.approx(bound)
        assert np.count_nonzero(np.abs(run.motor_torque) > 0.999 * bound) > 20


@pytest.mark.parametrize(
    "motor",
    [
        {},
        {"torque_limit_Nm": 0.3},
        {"stall_torque_Nm": 0.5, "no_load_speed_rpm": 300.0, "torque_limit_Nm": 0.4},
    ],
)
@pytest.mark.parametrize("kind", ["pd", "pid"])
def test_the_recorded_motor_torque_is_the_engines(bench, motor, kind):
    """The actuator's own force, mean of a step's ends at the mean speed between."""
    run = bench(
        LINEAR,
        defaults={
            "drive": "map",
            "level": "linear",
            "rotor_inertia_kgm2": 1e-4,
            "motor": motor or None,
        },
        controller={"kind": kind},
        trajectory=STEP,
        simulation={"duration_s": 0.3, "step_s": 2e-4, "integrator": "RK4"},
    )
    model, data = run.assembly.model, mujoco.MjData(run.assembly.model)
    set_start(run.assembly, data)
    integrals = []
    for k, inputs in enumerate(control_inputs(run.assembly)):
        data.ctrl[:] = inputs
        start = data.qpos.copy(), data.qvel.copy(), data.act.copy()
        mujoco.mj_step(model, data)
        end = data.qpos.copy(), data.qvel.copy(), data.act.copy()
        forces = []
        for state in (start, end):
            data.qpos[:], data.qvel[:], data.act[:] = state
            data.qvel[:] = (end[0] - start[0]) / 2e-4
            mujoco.mj_forward(model, data)
            forces.append(float(data.actuator_force[0]))
        data.qvel[:] = end[1]
        assert run.motor_torque[k + 1, 0] == pytest.approx(np.mean(forces), abs=1e-9)
        integrals.append(float(np.abs(data.act).sum()))
    # the integral has its share where there is one
    gain = run.assembly.loops.integral[0]
    assert (gain * max(integrals) > 0.1) == (kind == "pid")


def test_a_payload_weighs_on_the_shoulder():
    """Its weight times lever arm more than the bare UR5e; its inertia adds m r²."""
    payload = Payload(mass_kg=3.0, centre_mm=[0.0, 0.0, 100.0], known=False)
    loaded, bare = arms_of(Scene.load_file("ur5e-sweep").with_payload(payload))
    q = np.deg2rad([[0.0, -90.0, 90.0, 20.0, -60.0, 0.0]])
    # centre of mass: 100 mm along the z axis of the tool site
    data = mujoco.MjData(bare.model)
    data.qpos[:] = q[0]
    mujoco.mj_forward(bare.model, data)
    axis = data.site_xmat[bare.tool].reshape(3, 3)[:, 2]
    centre = data.site_xpos[bare.tool] + 0.1 * axis
    jacobian = np.zeros((3, 6))
    body = int(bare.model.site_bodyid[bare.tool])
    mujoco.mj_jac(bare.model, data, jacobian, None, centre, body)
    extra = loaded.gravity(q)[0] - bare.gravity(q)[0]
    np.testing.assert_allclose(extra, 3.0 * 9.81 * jacobian[2], atol=1e-9)
    assert np.abs(extra[1]) > 5.0
    grown = loaded.inertia(q[0]) - bare.inertia(q[0])
    np.testing.assert_allclose(grown, 3.0 * (jacobian**2).sum(axis=0), atol=1e-7)


def test_an_unknown_payload_pulls_the_motors_off(synthetic_map):
    """Known, the motors stand where they should; unknown, off by torque over gain."""
    start = {"shoulder_lift_joint": -90.0, "elbow_joint": 90.0}
    runs = {
        known: run_scene(
            "ur5e-sweep",
            overrides={
                "simulation.duration_s": 0.3,
                "defaults.level": "linear",
                "payload": {"mass_kg": 2.0, "known": known},
                "trajectory": {"kind": "step", "step_deg": {}, "start_deg": start},
            },
            drives={"reference-2d": synthetic_map},
        )
        for known in (True, False)
    }
    lift = 1
    unknown, known = runs[False], runs[True]
    assembly = unknown.assembly
    torque = assembly.arm.gravity(unknown.position[:1])[0, lift]
    torque -= assembly.known_arm.gravity(unknown.reference[:1])[0, lift]
    off = unknown.motor_position - unknown.reference * assembly.ratio
    # the loop's spring carries what the feed-forward does not know
    expected = -torque / assembly.ratio[lift] / assembly.loops.stiffness[lift]
    assert abs(torque) > 5.0
    assert off[0, lift] == pytest.approx(expected, rel=1e-6)
    np.testing.assert_allclose(np.ptp(unknown.motor_position[:, lift]), 0.0, atol=1e-5)
    near = known.motor_position - known.reference * assembly.ratio
    assert np.abs(near[:, lift]).max() < 0.05 * abs(expected)


def test_a_pulse_twists_the_drive_while_it_acts(bench):
    """Torsion falls by T/K under a torque along the joint, and comes back."""
    run = bench(
        LINEAR,
        defaults__level="linear",
        defaults__damping_ratio=0.3,
        load={},
        trajectory__speed_deg_s__joint=0.0,
        controller={"natural_frequency_Hz": 20.0, "damping_ratio": 1.0},
        simulation__duration_s=2.0,
        disturbance=[
            {
                "kind": "joint_pulse",
                "joint": "joint",
                "torque_Nm": 8.0,
                "start_s": 0.5,
                "duration_s": 1.0,
            }
        ],
    )
    at = lambda t: run.torsion[round(t / 1e-3), 0]  # noqa: E731
    assert at(0.5) == 0.0
    assert at(1.499) == pytest.approx(-8.0 / 2e4, rel=1e-3)
    assert at(2.0) == pytest.approx(0.0, abs=1e-3 * 8.0 / 2e4)


def test_a_force_on_the_tool_is_a_torque_on_the_joint(bench):
    """40 N across the bar of 0.5 m are 20 N·m along the joint, in the world's axes."""
    run = bench(
        LINEAR,
        defaults__level="linear",
        defaults__damping_ratio=0.3,
        load={},
        trajectory={
            "kind": "constant_speed",
            "speed_deg_s": {"joint": 0.0},
            "start_deg": {"joint": 90.0},
        },
        controller={"natural_frequency_Hz": 20.0, "damping_ratio": 1.0},
        simulation__duration_s=1.5,
        # at 90 deg the bar points along y: a force along -x turns it forward
        disturbance=[
            {
                "kind": "tool_force",
                "force_N": [-40.0, 30.0, 5.0],
                "start_s": 0.1,
                "duration_s": 9.0,
            }
        ],
    )
    assert run.torsion[-1, 0] == pytest.approx(-20.0 / 2e4, rel=2e-3)


def test_a_sine_shakes_at_its_frequency(bench):
    """The drive's torque follows a slow sine on the link with the same amplitude."""
    run = bench(
        LINEAR,
        defaults__level="linear",
        load={},
        trajectory__speed_deg_s__joint=0.0,
        controller={"natural_frequency_Hz": 30.0, "damping_ratio": 1.0},
        simulation__duration_s=3.0,
        disturbance=[
            {
                "kind": "joint_sine",
                "joint": "joint",
                "rated_fraction": 0.05,
                "frequency_Hz": 1.0,
            }
        ],
    )
    late = run.time > 1.0
    t, torque = run.time[late], run.output_torque[late, 0]
    sine = 2.0 * np.mean(torque * np.sin(2 * np.pi * t))
    # the spring of the loop against the inertia: (1 Hz / 30 Hz)² of it
    assert sine == pytest.approx(-5.0, rel=5e-3)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"disturbance": [{"kind": "joint_pulse", "joint": "joint", "start_s": 0.0,
                           "duration_s": 1.0}]},
         ("disturbance[0].torque_Nm", "either", "rated_fraction")),
        ({"trajectory": {"kind": "speed_steps", "joint": "joint",
                         "speeds_deg_s": []}}, ("trajectory.speeds_deg_s", "1 item")),
        ({"trajectory": {"kind": "speed_steps", "joint": "joint", "ramp_s": 4.0,
                         "speeds_deg_s": [1.0]}},
         ("simulation.duration_s", "8.4 s", "ramps")),
        ({"defaults.motor.stall_torque_Nm": 1.0},
         ("defaults.motor.stall_torque_Nm", "no_load_speed_rpm")),
        ({"defaults.motor.current_limit_A": 1.0},
         ("defaults.motor.current_limit_A", "torque_constant_Nm_A")),
        ({"defaults.motor.torque_limit_Nm": -1.0},
         ("defaults.motor.torque_limit_Nm", "-1 N·m", "> 0 N·m")),
        ({"payload": {"mass_kg": 1.0, "inertia_kgm2": [1.0, 0.1, 0.1]}},
         ("payload.inertia_kgm2", "[1.0, 0.1, 0.1] kg·m²", "0", "1e+06", "sum")),
        ({"sensors.link.delay_s": 0.001},
         ("sensors.link", "controller.feedback", "'link'")),
        ({"sensors.motor.delay_s": 0.0015},
         ("sensors.motor.delay_s", "0.0015 s", "multiple", "step_s", "0.001 s")),
        ({"controller.control_period_s": 0.0025},
         ("controller.control_period_s", "0.0025 s", "multiple", "step_s", "0.001 s")),
        ({"controller.integral_time_s": 1.0},
         ("controller.integral_time_s", "pd", "pid")),
        (
            {"disturbance": [{"kind": "joint_pulse", "joint": "elbow", "torque_Nm": 1.0,
                              "start_s": 0.0, "duration_s": 1.0}]},
            ("disturbance[0].joint = 'elbow'", "arm 'bench'", "joint"),
        ),
        (
            {"disturbance": [{"kind": "tool_force", "force_N": [1.0, 2.0],
                              "start_s": 0.0, "duration_s": 1.0}]},
            ("disturbance[0].force_N[2]", "list", "3 numbers"),
        ),
        ({"disturbance": [{"kind": "joint_sine", "joint": "joint", "torque_Nm": 1.0,
                          "frequency_Hz": 1000.0}]},
         ("disturbance[0].frequency_Hz", "1000 Hz", "100 Hz", "0.001 s")),
        ({"disturbance": [{"kind": "joint_pulse", "joint": "joint", "torque_Nm": 1.0,
                          "start_s": 0.1, "duration_s": 3e-4}]},
         ("disturbance[0].duration_s", "0.0003 s", "step_s", "0.001 s")),
        ({"disturbance": [{"kind": "joint_pulse", "joint": "joint", "torque_Nm": 1.0,
                          "start_s": 50.0, "duration_s": 0.1}]},
         ("disturbance[0].start_s", "50 s", "8 s")),
        ({"trajectory": {"kind": "chirp", "joint": "joint", "amplitude_deg": 0.01,
                         "from_Hz": 1.0, "to_Hz": 101.0}},
         ("trajectory.to_Hz", "101 Hz", "100 Hz", "0.001 s")),
        ({"disturbance": [{"kind": "joint_pulse", "joint": "joint", "torque_Nm": 1e300,
                          "start_s": 0.1, "duration_s": 0.1}]},
         ("disturbance[0].torque_Nm", "1e+300 N·m", ">= -1e+06 N·m", "<= 1e+06 N·m")),
        ({"disturbance": [{"kind": "tool_force", "force_N": [0.0, -1e9, 0.0],
                          "start_s": 0.1, "duration_s": 0.1}]},
         ("disturbance[0].force_N", "[0.0, -1000000000.0, 0.0] N", "<= 1e+06 N")),
        ({"payload": {"mass_kg": 1.0, "centre_mm": [1e200, 2, 3]}},
         ("payload.centre_mm", "[1e+200, 2.0, 3.0] mm", "10000 mm")),
        ({"load.joint.torque_Nm": 1e300},
         ("load.joint.torque_Nm", "1e+300 N·m", ">= -1e+06 N·m", "<= 1e+06 N·m")),
        ({"disturbance": [{"kind": "push"}]},
         ("disturbance[0].kind", "'push'", "joint_pulse", "joint_sine", "tool_force")),
        ({"trajectory": {"kind": "step", "step_deg": {"joint": 1.0}},
          "defaults.level": "kinematic"},
         ("trajectory.kind", "'step'", "kinematic",
          "rigid", "linear", "native", "full")),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(overrides, message, synthetic_map):
    """Key, value, what is accepted."""
    with pytest.raises(InputError) as caught:
        assemble(
            Scene.load_file("bench", overrides), drives={"reference-2d": synthetic_map}
        )
    assert names(str(caught.value), "bench.toml", *message)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(("own", "where"), [(0.02, "100 Hz to 0.3;"), (6e2, None)])
def test_added_damping_is_stated_for_what_vibrates(own, where, monkeypatch):
    """In a clearance the drive hardly has a stiffness, and nothing vibrates."""
    vibration = StepMode(
        frequency=200.0 * pi,
        damping_ratio=own + 0.28,
        own_frequency=200.0 * pi,
        own_damping_ratio=own,
    )
    monkeypatch.setattr(contains, "_modes", lambda *_: (vibration, None))
    found = contents(
        assemble(Scene.load_file("bench"), drives={"reference-2d": LINEAR})
    )
    stated = [one["reason"] for one in found["left_out"] if "damping" in one["part"]]
    assert [where in text for text in stated] == ([True] if where else [])

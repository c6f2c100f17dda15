"""Controllers: steady errors, closed forms, what sensors and periods do."""

import numpy as np
import pytest

from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

LINEAR = DriveMap.linear(2e4, teeth_flexspline=120, teeth_circular_spline=122)
AT_REST = {"kind": "step", "at_s": 0.1, "step_deg": {"joint": 1.0}}
LOOP = {"natural_frequency_Hz": 8.0, "damping_ratio": 1.0}


def motor_error(run):
    return run.assembly.ratio * run.reference - run.motor_position


def test_the_integral_removes_the_error_that_a_load_leaves(bench):
    """Without feed-forward pd is off by torque over gain, pid is not."""
    keys = dict(simulation__duration_s=3.0, trajectory__speed_deg_s__joint=0.0)
    pd, pid = (
        bench(LINEAR, controller={**LOOP, "kind": kind, "feedforward": "none"}, **keys)
        for kind in ("pd", "pid")
    )
    gain = pd.assembly.loops.stiffness[0]
    assert motor_error(pd)[-1, 0] == pytest.approx(20.0 / -60.0 / gain, rel=1e-6)
    assert abs(motor_error(pid)[-1, 0]) < 1e-3 * abs(motor_error(pd)[-1, 0])
    assert pid.motor_torque[-1, 0] == pytest.approx(20.0 / -60.0, rel=1e-4)


@pytest.mark.parametrize("sampled", [False, True])
def test_the_integral_stops_at_its_limit(bench, sampled):
    """A clamp of half the load's torque leaves half the error of pd."""
    run = bench(
        LINEAR,
        simulation__duration_s=4.0,
        trajectory__speed_deg_s__joint=0.0,
        controller={
            **LOOP,
            "kind": "pid",
            "feedforward": "none",
            "integral_limit_Nm": 10.0 / 60.0,
            **({"control_period_s": 0.001} if sampled else {}),
        },
    )
    gain = run.assembly.loops.stiffness[0]
    assert motor_error(run)[-1, 0] == pytest.approx(10.0 / -60.0 / gain, rel=1e-3)


def test_a_sampled_loop_comes_close_to_the_engines(bench):
    """Its answer to a step differs by the period's share, and halves with it."""
    keys = dict(
        trajectory=AT_REST,
        simulation={"duration_s": 0.6, "step_s": 2.5e-4},
        defaults__level="linear",
    )
    for kind in ("pd", "pid"):
        loop = {**LOOP, "kind": kind}
        native = bench(LINEAR, controller=loop, **keys)
        off = [
            np.abs(
                bench(
                    LINEAR, controller={**loop, "control_period_s": period}, **keys
                ).position
                - native.position
            ).max()
            for period in (2e-3, 1e-3)
        ]
        assert off[0] < 0.1 * np.deg2rad(1.0)
        assert off[1] == pytest.approx(off[0] / 2.0, rel=0.35)


def test_torque_is_held_over_a_control_period(bench):
    """It changes at the ticks of the period only, and there by the law."""
    run = bench(
        LINEAR,
        trajectory=AT_REST,
        simulation__duration_s=0.3,
        controller={**LOOP, "control_period_s": 0.005},
    )
    # the torque beside a state acted on the way to it
    torque = run.motor_torque[1:, 0].reshape(-1, 5)
    np.testing.assert_array_equal(torque, torque[:, :1].repeat(5, axis=1))
    assert np.unique(torque[:, 0]).size > 30
    loops, path = run.assembly.loops, run.assembly.trajectory
    tick = 125
    law = (
        loops.stiffness * (-60.0 * path.position[tick] - run.motor_position[tick])
        - loops.damping * run.motor_velocity[tick]
        + run.assembly.feedforward[tick]
    )
    np.testing.assert_allclose(run.motor_torque[tick + 1], law, rtol=1e-9)


def test_a_delay_makes_the_loop_act_on_the_past(bench):
    """The law with the state of 3 ms before; the loop rings more for it."""
    keys = dict(trajectory=AT_REST, simulation__duration_s=0.4, defaults__level="rigid")
    # of the damping ratio a delay takes about w T / 2 = 0.14
    loop = {"natural_frequency_Hz": 15.0, "damping_ratio": 0.3}
    late = bench(LINEAR, controller=loop, sensors__motor__delay_s=0.003, **keys)
    loops, k = late.assembly.loops, 130
    law = (
        loops.stiffness * (-60.0 * late.reference[k] - late.motor_position[k - 3])
        - loops.damping * late.motor_velocity[k - 3]
        + late.assembly.feedforward[k]
    )
    np.testing.assert_allclose(late.motor_torque[k + 1], law, rtol=1e-9)
    prompt = bench(LINEAR, controller={**loop, "control_period_s": 0.001}, **keys)
    assert late.position.max() > 1.1 * prompt.position.max()


@pytest.mark.parametrize("kind", ["pd", "pid", "computed_torque"])
@pytest.mark.parametrize("feedback", ["motor", "link"])
def test_old_readings_do_not_push_the_link_ahead(bench, kind, feedback):
    """Held against the command of then, motor and link are where they shall be.

    Held against that of now, 3 ms at 30 deg/s would put them 5.4 arcmin ahead.
    """
    run = bench(
        LINEAR,
        simulation__duration_s=2.0,
        trajectory__speed_deg_s__joint=30.0,
        trajectory__settle_s=1.0,
        defaults__level="rigid",
        controller={**LOOP, "kind": kind, "feedback": feedback},
        sensors={"motor": {"delay_s": 0.003}}
        | ({"link": {"delay_s": 0.003}} if feedback == "link" else {}),
    )
    off = (run.position - run.reference)[run.steady, 0]
    np.testing.assert_allclose(np.rad2deg(off), 0.0, atol=1e-6)


def test_a_coarse_encoder_is_met_to_one_count(bench):
    """The motor stands within a count of the reference, and its torque steps."""
    count = 2.0 * np.pi / 256
    run = bench(
        LINEAR,
        trajectory=AT_REST,
        simulation__duration_s=1.0,
        load={},
        defaults__level="linear",
        controller=LOOP,
        sensors__motor__counts_per_turn=256,
    )
    late = run.time > 0.6
    off = motor_error(run)[late, 0]
    assert np.abs(off).max() < 1.5 * count
    fine = bench(
        LINEAR,
        trajectory=AT_REST,
        simulation__duration_s=1.0,
        load={},
        defaults__level="linear",
        controller={**LOOP, "control_period_s": 0.001},
    )
    assert np.abs(motor_error(fine)[late, 0]).max() < 1e-3 * np.abs(off).max()
    # a reading is the count below: the law sees multiples of it
    loops, k = run.assembly.loops, 700
    read = np.floor(run.motor_position[[k - 1, k], 0] / count) * count
    law = (
        loops.stiffness[0] * (-60.0 * run.reference[k, 0] - read[1])
        - loops.damping[0] * (read[1] - read[0]) / 1e-3
    )
    assert run.motor_torque[k + 1, 0] == pytest.approx(law, abs=1e-9)


def test_link_feedback_removes_the_torsion_from_the_pose(bench):
    """With an integral on the link's angle the link stands on the reference."""
    keys = dict(
        trajectory__speed_deg_s__joint=0.0,
        simulation__duration_s=3.0,
        defaults__level="linear",
        defaults__damping_ratio=0.2,
    )
    loop = {"natural_frequency_Hz": 3.0, "damping_ratio": 1.0, "kind": "pid"}
    motor = bench(LINEAR, controller=loop, **keys)
    link = bench(LINEAR, controller={**loop, "feedback": "link"}, **keys)
    error = (motor.position - motor.reference)[-1, 0]
    assert error == pytest.approx(-20.0 / 2e4, rel=1e-2)
    assert abs((link.position - link.reference)[-1, 0]) < 1e-3 * abs(error)


def ur5e(level: str, **keys: object):
    """One joint steps by 3 deg on a rigid or flexible UR5e with fine steps."""
    start = {"shoulder_lift_joint": -70.0, "elbow_joint": 60.0, "wrist_1_joint": -30.0}
    scene = Scene.from_data(
        {
            "name": "step",
            "arm": "ur5e",
            "defaults": {"drive": "map", "level": level, "rotor_inertia_kgm2": 1e-4},
            "trajectory": {
                "kind": "step",
                "at_s": 0.05,
                "step_deg": {"elbow_joint": 3.0},
                "start_deg": start,
            },
            "simulation": {"duration_s": 0.45, "step_s": 2.5e-4},
            **keys,
        }
    )
    return run_scene(scene, drives={"map": LINEAR})


def test_computed_torque_decouples_the_rigid_arm():
    """Each joint is an oscillator of its own: one steps, the others stay."""
    run = ur5e("rigid", controller={"kind": "computed_torque", **LOOP})
    omega, moved = 2.0 * np.pi * 8.0, np.deg2rad(3.0)
    t = np.maximum(run.time - 0.05, 0.0)
    expected = moved * (1.0 - (1.0 + omega * t) * np.exp(-omega * t))
    elbow = run.joints.index("elbow_joint")
    got = run.position - run.position[0]
    # first order in the step: w h / 2 = 0.6 % of the way
    np.testing.assert_allclose(got[:, elbow], expected, atol=0.01 * moved)
    others = np.delete(got, elbow, axis=1)
    # what is left is of that order, too
    assert np.abs(others).max() < 0.01 * moved
    pushed = ur5e("rigid", controller={"kind": "pd", **LOOP})
    kicked = np.delete(pushed.position - pushed.position[0], elbow, axis=1)
    assert np.abs(kicked).max() > 5.0 * np.abs(others).max()


def test_computed_torque_holds_a_flexible_arm_with_its_load(bench):
    """At rest under load nothing moves: the law knows weight and load."""
    run = bench(
        LINEAR,
        defaults__level="linear",
        trajectory__speed_deg_s__joint=0.0,
        controller={"kind": "computed_torque", **LOOP},
    )
    np.testing.assert_allclose(run.torsion, 1e-3, rtol=1e-5)
    assert np.ptp(run.position) < 1e-8


def test_controllers_hold_at_every_level(bench, synthetic_map):
    """A sweep is followed by pid and computed torque with rotor or without."""
    sweep = {"kind": "sweep", "hold_s": 0.1, "ramp_s": 0.2, "end_deg": {"joint": 4.0}}
    for level in ("rigid", "kinematic", "linear", "native", "full"):
        for kind in ("pid", "computed_torque"):
            run = bench(
                synthetic_map,
                defaults__level=level,
                trajectory=sweep,
                simulation__duration_s=1.0,
                controller={"kind": kind, **LOOP},
            )
            off = np.abs(motor_error(run)).max() / 60.0
            assert off < np.deg2rad(0.15), (level, kind)


def test_a_loop_at_level_kinematic_sees_the_motor_behind_the_error(
    bench, synthetic_map
):
    """At rest the motor stands where it shall, the link off by the kinematic error."""
    run = bench(
        synthetic_map,
        defaults__level="kinematic",
        trajectory={
            "kind": "trapezoid",
            "end_deg": {"joint": 4.0},
            "max_speed_deg_s": 10.0,
            "max_acceleration_deg_s2": 50.0,
        },
        simulation__duration_s=2.0,
        load={},
        controller={**LOOP, "control_period_s": 0.001},
    )
    motor = run.motor_position[-1, 0] / -60.0 - run.reference[-1, 0]
    link = run.position[-1, 0] - run.reference[-1, 0]
    assert abs(link) > 1e-6
    assert abs(motor) < 0.01 * abs(link)


def test_a_trapezoid_keeps_its_limits(bench):
    """Speed and acceleration of the reference are those of the scene, in degrees."""
    run = bench(
        LINEAR,
        defaults__level="rigid",
        trajectory={
            "kind": "trapezoid",
            "end_deg": {"joint": 10.0},
            "max_speed_deg_s": 10.0,
            "max_acceleration_deg_s2": 20.0,
        },
        simulation__duration_s=2.0,
        load={},
    )
    step = run.assembly.scene.simulation.step_s
    speed = np.diff(run.reference[:, 0]) / step
    acceleration = np.diff(speed) / step
    assert np.rad2deg(speed.max()) == pytest.approx(10.0, rel=1e-6)
    assert np.rad2deg(np.median(acceleration[acceleration > 0.01])) == pytest.approx(
        20.0, rel=1e-3
    )

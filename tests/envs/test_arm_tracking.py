"""ArmTracking-v0 is the scene of its name, with an action added to its loops."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.envs.arm import scene as arm_scene
from swgjoint.envs.arm_tracking import ArmTrackingEnv
from swgjoint.errors import InputError
from swgjoint.models_path import models_path
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin
from swgjoint.view.run import run_scene


def run(env, action):
    """Infos of an episode with one action."""
    _, info = env.reset(seed=0)
    rows = [info]
    for _ in range(env.core.steps):
        _, _, terminated, truncated, info = env.step(action)
        rows.append(info)
        if terminated or truncated:
            break
    assert truncated and not terminated
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


@pytest.mark.parametrize("scene", ["ur5e-circle", "ur5e-catalogue"])
def test_without_action_it_is_the_scene(scene):
    """Links, motors, torques and tool of ``run_scene`` on the same drives."""
    env = ArmTrackingEnv(scene=scene, episode_s=1.0, friction=False)
    got = run(env, np.zeros(6))
    plain = Scene.load_file(scene).with_friction(False)
    want = run_scene(plain.with_kinematic_error(None))
    n = len(got["time_s"])
    np.testing.assert_allclose(got["time_s"], want.time[:n], atol=1e-12)
    # the start is the scene's to the tolerance of its equilibrium
    np.testing.assert_allclose(got["link_angle_rad"], want.position[:n], atol=1e-8)
    np.testing.assert_allclose(
        got["motor_angle_rad"], want.motor_position[:n], atol=1e-6
    )
    np.testing.assert_allclose(
        got["motor_torque_Nm"][1:], want.motor_torque[1:n], atol=1e-5
    )
    np.testing.assert_allclose(
        got["link_error_arcmin"],
        (want.position - want.reference)[:n] / arcmin,
        atol=1e-4,
    )
    # the distance is linearised about the reference
    np.testing.assert_allclose(
        got["tool_error_mm"], 1e3 * want.tool_error()[:n], atol=2e-2, rtol=1e-2
    )
    assert got["tool_error_mm"].max() > 0.2


def test_a_set_point_moves_links_by_what_it_says():
    """A steady shift turns every link by the shift, weight and drive the same."""
    env = ArmTrackingEnv(
        scene="ur5e-catalogue",
        action="setpoint",
        shift_arcmin=10.0,
        episode_s=0.24,  # the path rests that long
        friction=False,
    )
    still, moved = run(env, np.zeros(6)), run(env, np.full(6, 0.5))
    change = moved["link_error_arcmin"][-1] - still["link_error_arcmin"][-1]
    np.testing.assert_allclose(change, 5.0, rtol=0.1)


def test_a_torque_is_added_to_the_motors():
    """In the first step the motors give what the loop gives, and the action."""
    env, torques = ArmTrackingEnv(friction=False), []
    for action in (0.0, 0.1, 0.2):
        env.reset(seed=0)
        torques.append(env.step(np.full(6, action))[-1]["motor_torque_Nm"])
    rated = np.array([d.ratings.rated_torque / 100.0 for d in env.task.joints.drives])
    share = (torques[1] - torques[0]) / (0.2 * 0.1 * rated)
    # less what the loop takes back within the step
    assert (share > 0.7).all() and (share < 1.0).all()
    np.testing.assert_allclose(
        torques[2] - torques[0], 2.0 * (torques[1] - torques[0]), rtol=0.01
    )


def test_reward_is_what_the_docstring_says():
    """From the error of the tool and the mean square of unequal actions."""
    env = ArmTrackingEnv(friction=False, effort_weight=0.2)
    env.reset(seed=0)
    action = np.array([0.5, 0.1, 0.0, -0.3, 0.0, 0.2])
    _, reward, _, _, info = env.step(action)
    error = info["tool_error_mm"] / env.core.settings.error_scale_mm
    expected = 1.0 / (1.0 + error**2) - 0.2 * np.mean(action**2)
    assert reward == pytest.approx(expected, rel=1e-5)


def test_sensors_know_the_load_from_the_first_instant():
    """Torque sensors read the weight at the start, link encoders the sag."""
    env = ArmTrackingEnv(
        # an error of the drives moves the links, and with them their weight
        kinematic_error_arcmin=0.0,
        sensors={"torque_sensor": True, "link_encoder": True},
    )
    observation, info = env.reset(seed=0)
    read = env.read_measurements(observation)
    weight = env.task.link_torque[0]
    np.testing.assert_allclose(info["output_torque_Nm"], weight, rtol=1e-3, atol=1e-4)
    # noise of a thousandth of the rated torque, five of its deviations
    np.testing.assert_allclose(read.output_torque, weight, atol=5.0 * 0.09)
    assert np.abs(weight).max() > 10.0
    np.testing.assert_allclose(read.link_angle, info["link_angle_rad"], atol=5e-5)


def test_delayed_readings_begin_where_the_arm_stands():
    """Until they are as old as the delay, readings are those of the start."""
    env = ArmTrackingEnv(
        sensors={
            "motor_counts": 0,
            "motor_noise_rad": 0.0,
            "link_counts": 0,
            "link_noise_rad": 0.0,
            "torque_noise_of_rated": 0.0,
            "link_encoder": True,
            "torque_sensor": True,
            "delay_periods": 3,
        }
    )
    keys = ("motor_angle_rad", "link_angle_rad", "output_torque_Nm")
    # the second time the ring of readings is not where it began
    for steps in (5, 8):
        observation, info = env.reset(seed=0)
        read, true = [env.read_measurements(observation)], [info]
        for _ in range(steps):
            observation, *_, info = env.step(np.full(6, 0.5))
            read.append(env.read_measurements(observation))
            true.append(info)
        # all but the last joint of the path stand away from 0
        assert (np.abs(true[0]["motor_angle_rad"][:-1]) > 10.0).all()
        for k in range(steps + 1):
            of = true[max(k - 3, 0)]
            angle, link, torque = (of[key] for key in keys)
            np.testing.assert_array_equal(read[k].motor_angle, angle)
            np.testing.assert_array_equal(read[k].link_angle, link)
            np.testing.assert_array_equal(read[k].output_torque, torque)
            assert k > 3 or not read[k].motor_speed.any()
        assert (true[1]["motor_angle_rad"] != true[0]["motor_angle_rad"]).all()


@pytest.mark.parametrize("own", [True, False])
def test_friction_is_what_the_argument_says(own, tmp_path):
    """A scene and a joint with friction of their own say less than the argument."""
    text = (models_path() / "scenes" / "ur5e-catalogue.toml").read_text("utf-8")
    text = text.replace("friction = false\n", "")
    said = f"friction = {str(own).lower()}\n"
    for table in ("[defaults]\n", "[joints.elbow_joint]\n"):
        text = text.replace(table, table + said)
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    for friction in (True, False):
        env = ArmTrackingEnv(scene=str(path), friction=friction)
        model = env.core.plant.model
        names = [model.tendon(k).name for k in range(model.ntendon)]
        found = [name for name in names if name.endswith("_friction")]
        assert len(found) == (6 if friction else 0)


@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"scene": 5}, ("scene", "5", "name", "path", "arm")),
        ({"friction": "no"}, ("friction", "'no'", "True", "False")),
        (
            {"kinematic_error_arcmin": "1"},
            ("kinematic_error_arcmin", "'1' arcmin", ">= 0"),
        ),
        (
            {"sensors": {"delay_periods": 10**9}},
            ("delay_periods", "1000000000", "2000 periods"),
        ),
        (
            {"level": "linear", "randomise": {"losses": 0.1}},
            ("losses", "0.1", "linear", "load_inertia", "full"),
        ),
        ({"scene": "ur5e-payload-step"}, ("'ur5e-payload-step'", "disturbances")),
        (
            {"scene": "bench-chirp"},
            ("'bench-chirp'", "controller", "'computed_torque'", "pd"),
        ),
        ({"scene": "nothing"}, ("'nothing'", "models/scenes", "bench", "list scenes")),
        ({"action": "speed"}, ("action", "'speed'", "torque", "setpoint")),
        ({"error_scale_mm": 0.0}, ("error_scale_mm", "0.0 mm", "> 0")),
        ({"loop": 1}, ("'loop'", "scene", "level", "effort_weight")),
    ],
)
def test_what_cannot_be_an_episode_gives_one_line(keys, match):
    """What, where, and what is accepted."""
    with pytest.raises(InputError, match=naming(*match)):
        ArmTrackingEnv(**keys)


def test_an_output_bearing_is_refused(tmp_path):
    """Rather than left out in silence."""
    text = (models_path() / "scenes" / "ur5e-catalogue.toml").read_text("utf-8")
    path = tmp_path / "scene.toml"
    table = "[joints.elbow_joint.output_bearing]\ntilt_stiffness_Nm_arcmin = 70.0\n"
    path.write_text(f"{text}\n{table}", encoding="utf-8")
    found = naming("'ur5e-catalogue'", "output_bearing", "none")
    with pytest.raises(InputError, match=found):
        ArmTrackingEnv(scene=str(path))


def test_a_path_that_starts_moving_is_refused(tmp_path):
    """An episode starts at rest; the scene of the bench does not."""
    text = (models_path() / "scenes" / "bench.toml").read_text(encoding="utf-8")
    path = tmp_path / "moving.toml"
    path.write_text(text.replace('"reference-2d"', '"CSG-25-100"'), encoding="utf-8")
    with pytest.raises(InputError, match=naming("scene", "'bench'", "rest")):
        ArmTrackingEnv(scene=str(path))


def test_a_start_in_motion_is_refused_before_drives_are_built(monkeypatch):
    """A scene that no episode can have costs no finite elements."""
    built = []
    monkeypatch.setattr(arm_scene, "load_drive_once", built.append)
    with pytest.raises(InputError, match=naming("'bench'", "starts moving", "at rest")):
        ArmTrackingEnv(scene="bench")
    assert built == []

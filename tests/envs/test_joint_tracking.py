"""JointTracking-v0: interface, determinism, physics, limits."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import names, naming

from swgjoint.envs.joint_tracking import JointTrackingEnv, JointTrackingVectorEnv
from swgjoint.envs.limits import LIMITS
from swgjoint.envs.references import KINDS
from swgjoint.envs.sensors import Sensors
from swgjoint.envs.specimen import SpecimenTolerances, load_drive_once
from swgjoint.errors import InputError
from swgjoint.joint.variation import Variation
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import arcmin

NAME = "swgjoint.envs:swgjoint/JointTracking-v0"
SENSORS = tuple(Sensors.__dataclass_fields__)
TOLERANCES = tuple(SpecimenTolerances.__dataclass_fields__)
ALL = {"link_encoder": True, "torque_sensor": True}
EXACT = {
    "motor_counts": 0,
    "motor_noise_rad": 0.0,
    "link_counts": 0,
    "link_noise_rad": 0.0,
    "torque_noise_of_rated": 0.0,
    "delay_periods": 0,
}


def pd(env, observation, k, frequency=8.0):
    """Action of motor-side PD with known torque; broadcasts over a batch."""
    task, got = env.unwrapped.task, env.unwrapped.read_measurements(observation)
    ratio, rotor = task.joints.ratio, task.joints.rotor_inertia
    inertia = rotor + task.joints.link_inertia / ratio**2
    omega = 2.0 * np.pi * frequency
    torque = inertia * omega**2 * (ratio * task.position[k] - got.motor_angle)
    torque += 2.0 * inertia * omega * (ratio * task.velocity[k] - got.motor_speed)
    torque += task.link_torque[k] / ratio + ratio * rotor * task.acceleration[k]
    return np.clip(torque / task.joints.torque_limit, -1.0, 1.0)


def episode(env, seed, steps=None):
    """Observations, rewards and infos of one episode under PD."""
    observation, info = env.reset(seed=seed)
    rows = [(observation, 0.0, info)]
    for k in range(steps or env.unwrapped.core.steps):
        observation, reward, terminated, truncated, info = env.step(
            pd(env, observation, k)
        )
        rows.append((observation, reward, info))
        if terminated or truncated:
            break
    return rows, terminated, truncated


def test_the_joint_follows_and_its_error_is_explained():
    """At rest under load the link is off by torsion and error of its drive."""
    env = JointTrackingEnv(
        reference="point_to_point", sensors={**ALL, **EXACT}, friction=False
    )
    rows, terminated, truncated = episode(env, seed=2)
    assert truncated and not terminated and len(rows) == env.core.steps + 1
    info, task = rows[-1][2], env.task
    load = float(task.link_torque[-1, 0])
    assert info["output_torque_Nm"] == pytest.approx(load, rel=0.02)
    drive = task.joints.drives[0]
    theta, psi = info["motor_angle_rad"], info["link_angle_rad"]
    assert float(drive.forces(theta, psi)[1]) == pytest.approx(load, rel=0.02)
    error = (psi - theta / drive.ratio) / arcmin
    assert info["transmission_error_arcmin"] == pytest.approx(error, abs=1e-9)
    assert info["link_error_arcmin"] == pytest.approx(
        (psi - task.position[-1, 0]) / arcmin, abs=1e-9
    )
    # torsion under load dominates, and the drive is as stiff as its catalogue says
    assert abs(load) > 5.0
    assert -error * arcmin == pytest.approx(
        drive.mean_torsion(load), abs=1.01 * 0.5 * arcmin
    )


def test_reward_is_what_the_docstring_says():
    """Reward of every step from the true error and the torque."""
    env = JointTrackingEnv(error_scale_arcmin=2.0, effort_weight=0.3, episode_s=0.5)
    for _, reward, info in episode(env, seed=5)[0][1:]:
        error = info["link_error_arcmin"] / 2.0
        effort = info["motor_torque_Nm"] / float(env.core.limits.motor_torque[0])
        assert reward == pytest.approx(1.0 / (1.0 + error**2) - 0.3 * effort**2)


def test_sensors_have_resolution_and_delay():
    """Without noise a reading is the rounded angle of as many periods ago."""
    counts = 4096
    keys = {**EXACT, "motor_counts": counts, "delay_periods": 3}
    env = JointTrackingEnv(sensors={**keys, "link_encoder": True})
    rows, _, _ = episode(env, seed=1, steps=300)
    count = 2.0 * np.pi / counts
    read = np.array([env.read_measurements(o).motor_angle[0] for o, _, _ in rows])
    speed = np.array([env.read_measurements(o).motor_speed[0] for o, _, _ in rows])
    link = np.array([env.read_measurements(o).link_angle[0] for o, _, _ in rows])
    true = np.array([i["motor_angle_rad"] for _, _, i in rows])
    np.testing.assert_array_equal(read[3:], np.floor(true[:-3] / count) * count)
    np.testing.assert_allclose(speed[1:], np.diff(read) / 1e-3, atol=1e-9)
    np.testing.assert_array_equal(
        link[3:], [i["link_angle_rad"] for _, _, i in rows][:-3]
    )


def test_noise_has_the_stated_deviation():
    """Readings of a joint at rest scatter as their sensors say."""
    noise = {"motor_counts": 0, "motor_noise_rad": 1e-3, "torque_sensor": True}
    env = JointTrackingEnv(sensors=noise, load_of_rated=0.0, friction=False)
    before, rows = [env.reset(seed=1)], []
    for _ in range(95):
        rows.append((before[-1][-1], env.step(np.zeros(1))))
        before.append(rows[-1][1])
    off = [
        env.read_measurements(after[0]).motor_angle[0] - info["motor_angle_rad"]
        for info, after in rows
    ]
    assert np.std(off) == pytest.approx(1e-3, rel=0.3)
    rated = env.task.joints.drives[0].ratings.rated_torque
    torque = [
        env.read_measurements(after[0]).output_torque[0] - info["output_torque_Nm"]
        for info, after in rows
    ]
    assert np.std(torque) == pytest.approx(1e-3 * rated, rel=0.3)


def test_specimens_differ_within_their_tolerances():
    """Every episode has a drive of its own; the task knows the nominal one."""
    tolerances = {"stiffness": 0.1, "kinematic_error": 0.3, "losses": 0.2}
    batch = JointTrackingVectorEnv(40, randomise={**tolerances, "load_inertia": 0.05})
    batch.reset(seed=0)
    drawn = [v[0] for v in batch.core.variations]
    for key, top in tolerances.items():
        values = np.array([getattr(v, key) for v in drawn])
        assert 0.8 * top < np.abs(values).max() <= top
    loads = batch.core.load_inertia
    assert 0.04 < np.abs(loads - 1.0).max() <= 0.05
    assert batch.task.joints.link_inertia[0] == 1.0
    nominal = JointTrackingEnv().task.joints.drives[0]
    np.testing.assert_array_equal(
        batch.task.joints.drives[0].kinematic_error, nominal.kinematic_error
    )
    plain = JointTrackingEnv().core.plant
    assert plain.model.nuser_tendon == 0
    assert plain.batch.expanded("body_inertia") is None


@pytest.mark.parametrize(
    ("number", "action", "keys"),
    [
        (1, 0.1, {"max_angle_rad": 0.01, "max_speed_rad_s": 3.0, "episode_s": 3.0}),
        (2, 1.0, {}),
        (3, 1.0, {"torque_limit_Nm": 5.0, "load_inertia_kgm2": 200.0}),
        (4, 1.0, {"torque_limit_Nm": 5.0, "load_inertia_kgm2": 200.0}),
    ],
)
def test_broken_limits_end_an_episode(number, action, keys):
    """A constant torque breaks the limit that is nearest, and that is named."""
    drive = DriveMap.from_catalogue("CSG-25-100")
    if number == 4:  # teeth that skip early
        drive = replace(drive, ratings=replace(drive.ratings, ratcheting_torque=150.0))
    env = JointTrackingEnv(
        drive=drive, load_of_rated=0.0, rotor_inertia_kgm2=1e-3, **keys
    )
    env.reset(seed=0)
    for _ in range(env.core.steps):
        _, _, terminated, _, info = env.step(np.array([action]))
        if terminated:
            break
    assert terminated
    assert LIMITS[info["broken_limit"]] == LIMITS[number]


def test_a_controller_sees_all_episodes_of_a_batch():
    """The same PD, broadcast over a batch, follows all references."""
    batch = gymnasium.make_vec(NAME, num_envs=4, randomise=True)
    observation, _ = batch.reset(seed=1)
    errors = []
    for k in range(2000):
        observation, _, terminated, truncated, info = batch.step(
            pd(batch, observation, k)
        )
        errors.append(info["link_error_arcmin"])
        assert not terminated.any()
    assert truncated.all()
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (rms > 0.2).all() and (rms < 15.0).all()


@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"drives": "x"}, ("'drives'", "drive", "level", "effort_weight")),
        ({"level": "rigid"}, ("level", "'rigid'", "full", "linear")),
        (
            {"reference": "step"},
            ("reference", "'step'", "sinusoid", "multisine", "point_to_point"),
        ),
        ({"payload_kg": -1.0}, ("payload_kg", "-1.0 kg", ">= 0")),
        ({"sensors": {"noise": 1.0}}, ("sensor", "'noise'", *SENSORS)),
        (
            {"sensors": {"motor_counts": 0.5}},
            ("motor_counts", "0.5", "integer", ">= 0"),
        ),
        (
            {"randomise": {"mass": 0.1}},
            ("randomise", "'mass'", "True", "False", *TOLERANCES),
        ),
        (
            {"randomise": {"stiffness": 1.5}},
            ("tolerance", "stiffness", "1.5", "0", "1"),
        ),
        (
            {"episode_s": 0.1},
            ("episode_s", "0.1 s", "0.001 s", "0.5", "600 s", "1e6 periods"),
        ),
        ({"period_s": 1.0, "level": "linear"}, ("period_s", "1.0 s", "> 0", "0.05")),
        ({"drive": 5}, ("drive", "5", "catalogue", "map", "design", "DriveMap")),
        (
            {"reference": 5},
            ("reference", "5", "sinusoid", "multisine", "point_to_point"),
        ),
        (
            {"reference": ()},
            ("reference", "()", "sinusoid", "multisine", "point_to_point"),
        ),
        (
            {"reference": ("sinusoid", 5)},
            ("reference", "5", "sinusoid", "multisine", "point_to_point"),
        ),
        ({"randomise": 3}, ("randomise", "3", "True", "False", *TOLERANCES)),
        ({"randomise": None}, ("randomise", "None", "True", "False", *TOLERANCES)),
        ({"randomise": "yes"}, ("randomise", "'yes'", "True", "False", *TOLERANCES)),
        ({"randomise": {"losses": "0.1"}}, ("tolerance", "losses", "'0.1'", "0", "1")),
        (
            {"randomise": {"phase": "no"}},
            ("tolerance", "phase", "'no'", "True", "False"),
        ),
        ({"sensors": 5}, ("sensors", "5", "None", *SENSORS)),
        ({"sensors": {5: 1}}, ("sensor", "5", *SENSORS)),
        (
            {"sensors": {"motor_counts": "x"}},
            ("motor_counts", "'x'", "integer", ">= 0"),
        ),
        (
            {"sensors": {"link_encoder": "no"}},
            ("link_encoder", "'no'", "True", "False"),
        ),
        (
            {"sensors": {"delay_periods": np.nan}},
            ("delay_periods", "nan", "integer", ">= 0"),
        ),
        (
            {"sensors": {"delay_periods": 1.5}},
            ("delay_periods", "1.5", "integer", ">= 0"),
        ),
        (
            {"sensors": {"delay_periods": 10**9}},
            ("delay_periods", "1000000000", "2000 periods"),
        ),
        (
            {"kinematic_error_arcmin": "1"},
            ("kinematic_error_arcmin", "'1' arcmin", ">= 0"),
        ),
        ({"friction": "no"}, ("friction", "'no'", "True", "False")),
        ({"max_speed_rad_s": "1"}, ("max_speed_rad_s", "'1' rad/s", "> 0")),
        ({"episode_s": 10**400}, ("episode_s", "... s", "> 0")),
        ({"drive": "CSG-25"}, ("'CSG-25'", "SERIES-SIZE-RATIO", "CSG-25-100")),
    ],
)
def test_bad_arguments_give_one_line(keys, match):
    """What, the value, and what is accepted."""
    with pytest.raises(InputError, match=naming(*match)):
        JointTrackingEnv(**keys)
    assert Sensors.from_argument(None) == Sensors()


def test_whole_numbers_of_any_type_are_integers():
    """A delay of 1.0 periods is one of 1."""
    runs = []
    for delay in (2, 2.0, np.int64(2)):
        env = JointTrackingEnv(sensors={"delay_periods": delay, "motor_counts": 4096.0})
        env.reset(seed=3)
        runs.append([env.step(np.full(1, 0.05))[0] for _ in range(20)])
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0], runs[2])


@pytest.mark.parametrize("key", ["stiffness", "kinematic_error", "losses", "phase"])
def test_linear_drives_have_no_tolerances(key):
    """What one constant spring cannot carry is refused, in whatever form it comes."""
    value = True if key == "phase" else 0.1
    for said in ({key: value}, SpecimenTolerances(**{key: value})):
        with pytest.raises(
            InputError, match=naming("tolerance", "linear", "load_inertia", "full")
        ):
            JointTrackingEnv(level="linear", randomise=said)
    JointTrackingEnv(level="linear", randomise={key: 0})


@pytest.mark.parametrize("said", [True, {"load_inertia": 0.2}, {"stiffness": 0.0}])
def test_linear_joints_draw_the_load_alone(said):
    """Loads differ within their tolerance; drives are all nominal."""
    batch = JointTrackingVectorEnv(20, level="linear", randomise=said)
    batch.reset(seed=0)
    loads = batch.core.load_inertia
    assert 0.1 < np.abs(loads - 1.0).max() <= 0.2
    assert {v for (v,) in batch.core.variations} == {Variation()}


def test_momentum_balances_with_the_drawn_load():
    """Every link moves with its own inertia: i J_m w_m + J w grows by i u dt."""
    batch = JointTrackingVectorEnv(
        5, level="linear", randomise=True, load_of_rated=0.0, friction=False
    )
    batch.reset(seed=0)
    core, (low, high) = batch.core, (0.8, 1.2)
    inertia, ratio = core.load_inertia, core.joint.ratio
    assert low < inertia.min() < inertia.max() < high
    assert np.ptp(inertia) > 0.1
    for _ in range(50):
        batch.step(np.full((5, 1), 0.2))
    plant, rotor = core.plant, core.settings.rotor_inertia_kgm2
    momentum = (
        ratio * rotor * plant.motor_speed[:, 0] + inertia * plant.link_speed[:, 0]
    )
    impulse = ratio * 0.2 * core.limits.motor_torque[0] * 50e-3
    np.testing.assert_allclose(momentum, impulse, rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(
    episode_s=st.one_of(st.just(0.5), st.floats(0.5, 3.0)),
    speed=st.floats(0.01, 5.0),
    angle=st.floats(0.01, 10.0),
    period_s=st.sampled_from([5e-4, 1e-3, 3e-3, 1e-2]),
    kind=st.sampled_from([*KINDS]),
    load=st.floats(0.0, 3.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_no_reference_is_clipped(episode_s, speed, angle, period_s, kind, load, seed):
    """Whatever arguments are accepted, the bounds hold all that is commanded."""
    env = JointTrackingEnv(
        level="linear",
        episode_s=episode_s,
        max_speed_rad_s=speed,
        max_angle_rad=angle,
        period_s=period_s,
        reference=kind,
        load_of_rated=load,
        normalise=False,
    )
    high = env.observation_space.high[4:8]
    for k in range(5):
        plan = env.core.draw(np.random.default_rng([seed, k]))[1][:, :4, 0]
        assert np.isfinite(plan).all()
        # round-off of scaling a motion to its limit
        assert (np.abs(plan) <= high * (1.0 + 1e-12)).all()
    # the observation is that plan, unclipped
    env.reset(seed=seed)
    task = env.task
    for k in range(0, env.core.steps + 1, 50):
        env.core.instant[:] = k
        env.core._look()
        np.testing.assert_allclose(
            env.core.observation()[0, 4:7],
            [task.position[k, 0], task.velocity[k, 0], task.acceleration[k, 0]],
            rtol=1e-12,
        )


def test_missing_gymnasium_names_the_command(tmp_path):
    """Without the extra the import says how to install it."""
    code = "import sys; sys.modules['gymnasium'] = None; import swgjoint.envs"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 1
    assert names(done.stderr, "gymnasium", "pip install 'swgjoint[envs]'")


def test_an_environment_has_the_drive_that_the_file_holds_now(tmp_path, monkeypatch):
    """A map that was written anew, or another folder's of the same name, counts."""

    def stiffness():
        env = JointTrackingEnv(drive="d.swg")
        return env.core.plant.drives[0].drive.mean_stiffness

    for folder, first in (("a", 2e4), ("b", 3e4)):
        (tmp_path / folder).mkdir()
        monkeypatch.chdir(tmp_path / folder)
        for value in (first, 5e3, first):
            DriveMap.linear(value).save("d.swg")
            assert stiffness() == pytest.approx(value)


def test_a_drive_is_loaded_once_while_its_file_stays(tmp_path):
    """Environments of one drive share its map."""
    path = str(tmp_path / "d.swg")
    DriveMap.linear(2e4).save(path)
    assert load_drive_once(path) is load_drive_once(path)
    assert load_drive_once("CSG-25-100") is load_drive_once("CSG-25-100")

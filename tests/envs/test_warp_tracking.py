"""JointTracking in MuJoCo Warp against the vector environment, on the CPU device."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import naming

from swgjoint.envs.joint_tracking import JointTrackingVectorEnv
from swgjoint.errors import InputError
from swgjoint.units import arcmin

wp = pytest.importorskip(
    "warp", reason="not installed; to run this: pip install 'swgjoint[warp]'"
)
warp = pytest.importorskip("swgjoint.envs.warp")

MAP = str(Path(__file__).parents[2] / "notebooks/maps/reference-2d.swg")
EXACT = {"motor_noise_rad": 0.0, "motor_counts": 0}
"""Sensors whose readings are smooth functions of the state."""
WORLDS, SEED = 3, 7


def on_device(actions):
    return wp.array(np.asarray(actions, np.float32), dtype=float)


def pair(**keys):
    """The same episodes on the device and in the vector environment, begun."""
    env = warp.WarpJointTracking(WORLDS, episodes=WORLDS, seed=SEED, **keys)
    twin = JointTrackingVectorEnv(WORLDS, autoreset_mode="Disabled", **keys)
    begun, _ = twin.reset(seed=SEED)
    np.testing.assert_allclose(env.reset().numpy(), begun, atol=1e-6)
    return env, twin


def pd(core, observation):
    """PD controller of the motor with 8 Hz, critically damped."""
    s, ratio = core.settings, core.joint.ratio
    inertia = s.rotor_inertia_kgm2 + s.load_inertia_kgm2 / ratio**2
    error, speed = (observation * core.units)[:, 2:4].T
    w = 2.0 * np.pi * 8.0
    torque = inertia * (w**2 * error + 2.0 * w * speed)
    return np.clip(torque / core.limits.motor_torque[0], -1.0, 1.0)[:, None]


@pytest.mark.parametrize(
    "keys",
    [
        {"sensors": EXACT},
        {
            "randomise": True,
            "sensors": EXACT
            | {"link_encoder": True, "torque_sensor": True, "delay_periods": 2},
        },
        {"drive": MAP, "randomise": True, "period_s": 2e-3, "sensors": EXACT},
        {"drive": "CHA-14-50", "sensors": EXACT | {"delay_periods": 0}},
    ],
)
def test_the_vector_environment_is_the_twin(keys):
    """In a closed loop: same episodes, readings, rewards, torques, within rounding.

    The angle of the motor has a resolution of 1.5e-5 rad at 200 rad in single
    precision, hence its speed, over a period of 1 ms, one of 0.015 rad/s.
    """
    env, twin = pair(**keys)
    core, seen = twin.core, twin.core.observation()
    step = np.spacing(np.float32(core.limits.angle[0] * abs(core.joint.ratio)))
    known = env.observation.numpy()
    for _ in range(500):
        seen, reward, broken, over, info = twin.step(pd(core, seen))
        _, r, terminated, truncated = env.step(on_device(pd(core, known)))
        known = env.observation.numpy().astype(float)
        missed = np.abs(known - seen) * core.units
        speeds = np.isin(np.arange(len(core.units)), (1, 3))
        # up to two speeds of the last digits, and the loop's reaction to them
        assert missed[:, speeds].max() < 4.0 * step / core.period
        assert missed[:, [0, 2]].max() < 4.0 * step
        np.testing.assert_allclose(r.numpy(), reward, atol=2e-4)
        error = info["link_error_arcmin"] * arcmin
        np.testing.assert_allclose(env.link_error.numpy(), error, atol=2e-7)
        rated = core.joint.drive.ratings.rated_torque
        torque = info["output_torque_Nm"]
        np.testing.assert_allclose(env.output_torque.numpy(), torque, atol=1e-3 * rated)
        assert not (broken | over).any()
        assert not (terminated.numpy() | truncated.numpy()).any()


@pytest.mark.parametrize("number", [2, 3])
def test_limits_end_the_same_episodes(number):
    """In the same step and for the same reason; the next episode begins at once."""
    heavy = {"torque_limit_Nm": 5.0, "load_of_rated": 0.0}
    heavy |= {"load_inertia_kgm2": 200.0, "rotor_inertia_kgm2": 1e-3}
    env, twin = pair(**(heavy if number == 3 else {}))
    action = np.ones((WORLDS, 1))
    first = env.observation.numpy().copy()
    for _ in range(400):
        _, _, broken, _, info = twin.step(action)
        _, _, terminated, truncated = env.step(on_device(action))
        np.testing.assert_array_equal(terminated.numpy(), broken)
        np.testing.assert_array_equal(env.broken_limit.numpy(), info["broken_limit"])
        assert not truncated.numpy().any()
        if broken.any():
            break
    assert set(info["broken_limit"][broken]) == {number}
    after, last = env.observation.numpy(), env.final_observation.numpy()
    np.testing.assert_allclose(last, twin.core.observation(), atol=1e-3)
    for k in np.flatnonzero(broken):
        following = (k + 1) % WORLDS
        np.testing.assert_array_equal(after[k], first[following])
        assert env.episode.numpy()[k] == following


def test_worlds_play_the_episodes_in_turn():
    """A whole episode is truncated, and the next one is that of another world."""
    keys = {"episodes": 3, "episode_s": 0.5, "randomise": True, "load_of_rated": 0.0}
    env, other = (warp.WarpJointTracking(2, **keys) for _ in range(2))
    first = env.reset().numpy().copy()
    rest = on_device(np.zeros((2, 1)))
    for k in range(500):
        observation, reward, terminated, truncated = env.step(rest)
        assert truncated.numpy().all() == (k == 499)
        assert not terminated.numpy().any()
    np.testing.assert_array_equal(observation.numpy()[0], first[1])
    np.testing.assert_array_equal(env.episode.numpy(), [1, 2])

    # world 0 now plays as world 1 did, bit for bit
    other.reset()
    for _ in range(100):
        played, given, *_ = env.step(rest)
        before, got, *_ = other.step(rest)
        np.testing.assert_array_equal(played.numpy()[0], before.numpy()[1])
        assert given.numpy()[0] == got.numpy()[1]
    assert reward.numpy()[0] != reward.numpy()[1]


def test_a_chosen_world_begins_anew_alone():
    """Others continue as if nothing had happened."""
    env, other = (warp.WarpJointTracking(3, episodes=5) for _ in range(2))
    action = on_device(np.full((3, 1), 0.1))
    for one in (env, other):
        one.reset()
        for _ in range(20):
            one.step(action)
    env.reset(wp.array([False, True, False], dtype=wp.bool))
    np.testing.assert_array_equal(env.episode.numpy(), [0, 2, 2])
    for _ in range(20):
        played, before = (one.step(action)[0].numpy() for one in (env, other))
        np.testing.assert_array_equal(played[[0, 2]], before[[0, 2]])
        assert (played[1] != before[1]).any()


def test_an_action_that_is_not_a_number_shows():
    """The reward is not a number either; the world goes on, and others see nothing."""
    env = warp.WarpJointTracking(3, episodes=3)
    env.reset()
    for bad in (np.nan, np.inf, -np.inf):
        _, reward, *_ = env.step(on_device([[0.1], [bad], [0.1]]))
        np.testing.assert_array_equal(np.isfinite(reward.numpy()), [True, False, True])
        observation, reward, terminated, _ = env.step(on_device(np.zeros((3, 1))))
        assert np.isfinite(reward.numpy()).all()
        assert np.isfinite(observation.numpy()).all()
        assert not terminated.numpy().any()


def test_what_is_not_accepted():
    """Every refusal says what is accepted."""
    make = warp.WarpJointTracking
    for keys, words in (
        ({"level": "linear"}, ("level", "linear", "full")),
        ({"gauges": {"flexspline": "size-25-100"}}, ("gauges", "None")),
        ({"worlds": 0}, ("worlds", "0")),
        ({"episodes": 2000, "episode_s": 60.0}, ("2000", "episodes", "60001")),
        ({"typo": 1}, ("typo", "accepted")),
    ):
        with pytest.raises(InputError, match=naming(*words)):
            make(**({"worlds": 2, "episodes": 2} | keys))
    env = make(2, episodes=2)
    with pytest.raises(InputError, match=naming("step", "reset()")):
        env.step(on_device(np.zeros((2, 1))))
    with pytest.raises(InputError, match=naming("reset", "chosen")):
        env.reset(wp.array([True, False], dtype=wp.bool))
    env.reset()
    with pytest.raises(InputError, match=naming("action", "(2,)", "(2, 1)")):
        env.step(wp.zeros(2, dtype=float))

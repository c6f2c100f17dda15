"""The adapter for stable-baselines3 against single environments and its own classes.

Without the package, a stand-in for its base class serves the tests that need no more.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from types import ModuleType

import gymnasium
import numpy as np
import pytest
from messages import naming

import swgjoint.envs  # noqa: F401
from swgjoint.errors import InputError, MissingExtraError

PACKAGE = "stable_baselines3"
HAS_PACKAGE = importlib.util.find_spec(PACKAGE) is not None
NAME = "swgjoint/JointTracking-v0"
KEYS = {"episode_s": 0.5, "period_s": 4e-3, "randomise": True}
needs_package = pytest.mark.skipif(
    not HAS_PACKAGE, reason="stable-baselines3 not installed: pip install '.[rl]'"
)


class VecEnv:
    """What the adapter uses of the base class of stable-baselines3 2.9."""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs = num_envs
        self.observation_space = observation_space
        self.action_space = action_space
        self.reset_infos = [{} for _ in range(num_envs)]
        self._reset_seeds()
        self._reset_options()
        self.render_mode = self.get_attr("render_mode")[0]

    def _reset_seeds(self):
        self._seeds = [None] * self.num_envs

    def _reset_options(self):
        self._options = [{}] * self.num_envs

    def seed(self, seed):
        """Seed every episode."""
        self._seeds = [seed + k for k in range(self.num_envs)]

    def set_options(self, options):
        """Options of the next reset, the same for all episodes."""
        self._options = [options] * self.num_envs

    def step(self, actions):
        """One step."""
        self.step_async(actions)
        return self.step_wait()

    def _get_indices(self, indices):
        if indices is None:
            return range(self.num_envs)
        return [indices] if isinstance(indices, int) else indices


@pytest.fixture
def adapter(monkeypatch):
    """The module of the adapter, on the package or on the stand-in."""
    if not HAS_PACKAGE:
        for name in (PACKAGE, f"{PACKAGE}.common", f"{PACKAGE}.common.vec_env"):
            monkeypatch.setitem(sys.modules, name, ModuleType(name))
        sys.modules[f"{PACKAGE}.common.vec_env"].VecEnv = VecEnv
    monkeypatch.delitem(sys.modules, "swgjoint.envs.sb3", raising=False)
    yield importlib.import_module("swgjoint.envs.sb3")
    sys.modules.pop("swgjoint.envs.sb3", None)


def batch(count, **keys):
    return gymnasium.make_vec(
        NAME, num_envs=count, **{"autoreset_mode": "SameStep", **KEYS, **keys}
    )


def same(got, want):
    """Two infos of one episode, the last observation as stored."""
    assert got.keys() == want.keys()
    for key, value in want.items():
        np.testing.assert_array_equal(got[key], value, err_msg=key)


def test_it_equals_single_environments(adapter):
    """Observations, rewards, ends and infos of a loop over single environments."""
    count = 4
    many = adapter.BatchVecEnv(batch(count), every_info=True)
    singles = [gymnasium.make(NAME, **KEYS) for _ in range(count)]
    many.seed(7)
    got = many.reset()
    assert got.dtype == np.float32
    assert got.shape == (count, *many.observation_space.shape)
    begun = [env.reset(seed=7 + k) for k, env in enumerate(singles)]
    np.testing.assert_array_equal(got, np.float32([b[0] for b in begun]))
    for k in range(count):
        same(many.reset_infos[k], begun[k][1])
    rng, ends = np.random.default_rng(0), {"TimeLimit": 0, "limit": 0}
    size = np.linspace(0.02, 1.0, count)[:, None]
    for _ in range(270):
        actions = np.float32(size * rng.uniform(-0.9, 0.9, (count, 1)))
        observation, reward, done, infos = many.step(actions)
        assert reward.dtype == observation.dtype == np.float32
        assert all(many.observation_space.contains(one) for one in observation)
        for k, env in enumerate(singles):
            obs, value, terminated, truncated, info = env.step(actions[k])
            info["TimeLimit.truncated"] = truncated and not terminated
            assert done[k] == (terminated or truncated)
            if done[k]:
                ends["limit" if terminated else "TimeLimit"] += 1
                info["terminal_observation"] = np.float32(obs)
                obs, first = env.reset()
                same(many.reset_infos[k], first)
            np.testing.assert_array_equal(observation[k], np.float32(obs))
            assert reward[k] == np.float32(value)
            same(infos[k], info)
    assert min(ends.values()) >= 1


def test_infos_of_running_episodes_are_left_out(adapter):
    """By default infos have values at the end of an episode only."""
    many = adapter.BatchVecEnv(batch(3))
    many.seed(0)
    many.reset()
    ended = 0
    for _ in range(126):
        _, _, done, infos = many.step(np.zeros((3, 1)))
        for flag, info in zip(done, infos, strict=True):
            assert ("link_error_arcmin" in info) == flag
            assert ("terminal_observation" in info) == flag
            assert "TimeLimit.truncated" in info
        ended += done.sum()
    assert ended >= 1


def test_a_limit_in_the_last_step_is_no_time_limit(adapter, monkeypatch):
    """A value after the end then counts as zero, as for any limit."""
    many = adapter.BatchVecEnv(batch(2, load_of_rated=0.0))
    many.reset()
    step = many.batch.step

    def step_beyond(actions):
        observation, reward, _, truncated, info = step(actions)
        return observation, reward, np.array([True, False]) & truncated, truncated, info

    monkeypatch.setattr(many.batch, "step", step_beyond)
    for _ in range(125):
        _, _, done, infos = many.step(np.zeros((2, 1)))
    assert done.all()
    assert [info["TimeLimit.truncated"] for info in infos] == [False, True]


def test_seeds_are_used_once(adapter):
    """As in the package, the generators go on at the next reset."""
    many = adapter.BatchVecEnv(batch(2))

    def begin():
        """Observation of new episodes after their motion has begun."""
        many.reset()
        for _ in range(60):
            observation = many.step(np.zeros((2, 1)))[0]
        return observation

    runs = []
    for _ in range(2):
        many.seed(5)
        runs.append((begin(), begin()))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert np.abs(runs[0][0] - runs[0][1]).max() > 0.01


def test_attributes_and_methods(adapter):
    """One object answers for every index."""
    many = adapter.BatchVecEnv(batch(3))
    first = many.reset()
    assert many.get_attr("num_envs", [0, 2]) == [3, 3]
    assert many.env_is_wrapped(gymnasium.Wrapper) == [False] * 3
    (read,) = many.env_method("read_measurements", first, indices=1)
    angle = first[:, :1] * many.batch.core.units[0]
    np.testing.assert_array_equal(read.motor_angle, angle)
    many.set_attr("label", "a")
    assert many.batch.label == "a"
    with pytest.raises(InputError, match=naming("'label'", "1", "3")):
        many.set_attr("label", "b", indices=0)
    with pytest.raises(AttributeError):
        many.get_attr("nothing")
    assert many.get_images() == [None] * 3
    many.set_options({"reset_mask": 1})
    with pytest.raises(InputError, match=naming("options", "reset_mask")):
        many.reset()
    many.close()


def test_what_is_no_such_batch_is_refused(adapter):
    """Another mode, wrappers and single environments, each in one line."""
    with pytest.raises(InputError, match=naming("NextStep", "SameStep")):
        adapter.BatchVecEnv(batch(2, autoreset_mode="NextStep"))
    wrapped = gymnasium.wrappers.vector.RecordEpisodeStatistics(batch(2))
    for other in (wrapped, gymnasium.make(NAME)):
        with pytest.raises(InputError, match=naming(type(other).__name__, "SameStep")):
            adapter.BatchVecEnv(other)


def test_the_extra_is_named(monkeypatch):
    """Without the package the import says how to install it."""
    monkeypatch.setitem(sys.modules, f"{PACKAGE}.common.vec_env", None)
    monkeypatch.delitem(sys.modules, "swgjoint.envs.sb3", raising=False)
    with pytest.raises(MissingExtraError, match=naming("swgjoint[rl]")):
        importlib.import_module("swgjoint.envs.sb3")


@needs_package
def test_it_equals_the_loop_of_the_package(adapter):
    """``DummyVecEnv`` of the same environments returns the same, infos included."""
    from stable_baselines3.common.vec_env import DummyVecEnv

    loop = DummyVecEnv([lambda: gymnasium.make(NAME, **KEYS)] * 3)
    many = adapter.BatchVecEnv(batch(3), every_info=True)
    starts = []
    for env in (loop, many):
        env.seed(2)
        starts.append(env.reset())
    np.testing.assert_array_equal(np.float32(starts[0]), starts[1])
    rng, ended = np.random.default_rng(1), 0
    for _ in range(200):
        actions = rng.uniform(-0.9, 0.9, (3, 1)).astype(np.float32)
        want, got = loop.step(actions), many.step(actions)
        for a, b in zip(want[:3], got[:3], strict=True):
            np.testing.assert_array_equal(a.astype(b.dtype), b)
        for a, b in zip(want[3], got[3], strict=True):
            if "terminal_observation" in a:
                a["terminal_observation"] = np.float32(a["terminal_observation"])
                ended += 1
            same(b, a)
    assert ended >= 3


@needs_package
@pytest.mark.filterwarnings("default")
def test_algorithms_and_wrappers_accept_it(adapter):
    """PPO learns with statistics of episodes, SAC with normalised observations."""
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    monitored = VecMonitor(adapter.BatchVecEnv(batch(16)))
    on_policy = PPO("MlpPolicy", monitored, n_steps=64, batch_size=256, device="cpu")
    on_policy.learn(16 * 64 * 2)
    assert len(on_policy.ep_info_buffer) > 0
    assert len(evaluate_policy(on_policy, monitored, 4, return_episode_rewards=True)[0])
    normal = VecNormalize(adapter.BatchVecEnv(batch(4)))
    SAC("MlpPolicy", normal, learning_starts=40, device="cpu").learn(200)

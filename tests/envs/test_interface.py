"""What gymnasium asks of every environment, and that batches equal single ones."""

from __future__ import annotations

import inspect

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from messages import naming

from swgjoint.envs import ENVIRONMENTS
from swgjoint.envs.entries import table
from swgjoint.errors import InputError

ALL = {"link_encoder": True, "torque_sensor": True}
GAUGES = {"flexspline": "size-25-100", "position_mm": 13.0, "strain": "outline"}
SHORT = {
    "swgjoint/JointTracking-v0": {"episode_s": 0.5, "load_of_rated": 0.05},
    "swgjoint/RippleSuppression-v0": {"episode_s": 1.6, "period_s": 4e-3},
    "swgjoint/ArmTracking-v0": {"episode_s": 0.4},
}
"""Arguments with which episodes end within the tests."""
NAMES = pytest.mark.parametrize("name", ENVIRONMENTS)
EACH_KIND = [
    "swgjoint/JointTracking-v0",
    pytest.param("swgjoint/ArmTracking-v0", marks=pytest.mark.slow),
]
"""One of a joint; arms go the same way and take longer to make."""


def make(name, **keys):
    return gymnasium.make(f"swgjoint.envs:{name}", **keys)


def same(got, want):
    """Two results of ``step`` or ``reset`` of vector environments, bit by bit."""
    assert got[-1].keys() == want[-1].keys()
    for key, value in got[-1].items():
        if key == "final_info":
            same((value,), (want[-1][key],))
        elif key == "final_obs":
            for a, b in zip(value, want[-1][key], strict=True):
                np.testing.assert_array_equal(a, b)
        else:
            np.testing.assert_array_equal(value, want[-1][key], err_msg=key)
    for a, b in zip(got[:-1], want[:-1], strict=True):
        np.testing.assert_array_equal(a, b)


@NAMES
@pytest.mark.parametrize("randomise", [False, True])
def test_check_env(name, randomise):
    """Gymnasium's own checks raise no warning; pictures have a test of their own."""
    check_env(make(name, randomise=randomise).unwrapped, skip_render_check=True)


@NAMES
def test_tables_are_those_of_the_code(name):
    """The docstring's tables are made by the code."""
    gauges = {} if name.endswith("ArmTracking-v0") else {"gauges": GAUGES}
    env = make(name, sensors=ALL, **gauges).unwrapped
    blocks = inspect.cleandoc(type(env).__doc__).split("\n\n")
    assert table(env.core.action_entries) in blocks
    assert table(env.core.observation_entries) in blocks
    joints = len(env.core.joints.names)
    plain = make(name).unwrapped.observation_space.shape[0]
    assert env.observation_space.shape == (plain + 2 * joints + len(gauges),)


@NAMES
def test_one_seed_gives_one_run(name):
    """Two episodes of one seed are equal, of two seeds not."""
    env = make(name, randomise=True, sensors=ALL)
    runs = []
    for seed in (3, 3, 4):
        run = [env.reset(seed=seed)]
        rng = np.random.default_rng(0)
        size = env.action_space.shape
        run += [env.step(rng.uniform(-0.05, 0.05, size)) for _ in range(200)]
        runs.append(run)
    for a, b in zip(*runs[:2], strict=True):
        np.testing.assert_array_equal(a[0], b[0])
        assert a[1:-1] == b[1:-1]
        for key in a[-1]:
            np.testing.assert_array_equal(a[-1][key], b[-1][key])
    assert np.abs(runs[0][9][0] - runs[2][9][0]).max() > 0.0


@pytest.mark.parametrize(
    ("name", "level"),
    [
        *((name, "full") for name in ENVIRONMENTS),
        pytest.param(next(iter(ENVIRONMENTS)), "linear", marks=pytest.mark.slow),
    ],
)
def test_batch_equals_single_environments(name, level):
    """550 steps with restarts, specimens, sensors and delay agree to the last bit."""
    keys = {
        **SHORT[name],
        "level": level,
        "randomise": True,
        "sensors": {**ALL, "delay_periods": 2},
    }
    count = 5
    if name.endswith("ArmTracking-v0"):
        count = 2
    else:
        keys["gauges"] = GAUGES
    sync = SyncVectorEnv([lambda: make(name, **keys).unwrapped] * count)
    batch = gymnasium.make_vec(name, num_envs=count, threads=2, **keys)
    assert batch.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    rng, ended, broken = np.random.default_rng(0), np.zeros(count), np.zeros(count)
    got, want = batch.reset(seed=11), sync.reset(seed=11)
    same(got, want)
    # some wander until a limit breaks, some stay until the end
    size = np.linspace(0.02, 1.0, count)[:, None]
    for _ in range(550):
        actions = size * rng.uniform(-0.5, 0.9, batch.action_space.shape)
        got, want = batch.step(actions), sync.step(actions)
        same(got, want)
        ended += got[3]
        broken += got[2]
    # every episode began anew, and not in the last step
    assert (ended + broken >= 1).all() and (batch.unwrapped.core.instant > 0).all()
    if name.endswith("JointTracking-v0"):
        assert ended.sum() >= 1 and broken.sum() >= 1


@pytest.mark.parametrize("name", EACH_KIND)
@pytest.mark.parametrize(
    ("keys", "match"),
    [
        ({"num_envs": 0}, ("num_envs", "0", "integer", ">= 1")),
        ({"num_envs": 2.5}, ("num_envs", "2.5", "integer", ">= 1")),
        ({"threads": -3}, ("threads", "-3", "integer", ">= 0")),
        ({"threads": "2"}, ("threads", "'2'", "integer", ">= 0")),
    ],
)
def test_a_batch_of_no_size_is_refused(name, keys, match):
    """In one line of the package, not the engine's."""
    with pytest.raises(InputError, match=naming(*match)):
        gymnasium.make_vec(f"swgjoint.envs:{name}", **{"num_envs": 2, **keys})


@pytest.mark.parametrize(
    ("action", "match"),
    [
        (np.array([np.nan]), ("action", "finite", "1")),
        (np.zeros(2), ("action", "(1, 2)", "finite", "1")),
    ],
)
def test_an_action_that_is_none_is_refused(action, match):
    """Neither the engine nor broadcasting makes something of it."""
    env = make("swgjoint/JointTracking-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(InputError, match=naming(*match)):
        env.step(action)


def test_episodes_that_restart_at_once():
    """In the other mode, too, the batch is gymnasium's, last observations included."""
    name, count = "swgjoint/JointTracking-v0", 4
    keys = {**SHORT[name], "randomise": True}
    sync = SyncVectorEnv(
        [lambda: make(name, **keys).unwrapped] * count,
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
    batch = gymnasium.make_vec(name, count, autoreset_mode="SameStep", **keys)
    assert batch.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    batch.reset(seed=1), sync.reset(seed=1)
    rng, size, ended = np.random.default_rng(0), np.linspace(0.02, 1.0, count), 0
    for _ in range(550):
        actions = size[:, None] * rng.uniform(-0.9, 0.9, (count, 1))
        got, want = batch.step(actions), sync.step(actions)
        same(got, want)
        ended += int((got[2] | got[3]).sum())
    assert ended >= 3
    with pytest.raises(
        InputError,
        match=naming("autoreset_mode", "'Never'", "NextStep", "SameStep", "Disabled"),
    ):
        gymnasium.make_vec(name, 1, autoreset_mode="Never")


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_some_episodes_begin_anew(mode):
    """With a mask the batch is gymnasium's to the last bit, whatever the mode."""
    name, count = "swgjoint/JointTracking-v0", 4
    keys = {**SHORT[name], "period_s": 2e-3, "randomise": True}
    sync = SyncVectorEnv(
        [lambda: make(name, **keys).unwrapped] * count,
        autoreset_mode=AutoresetMode(mode),
    )
    batch = gymnasium.make_vec(name, count, autoreset_mode=mode, **keys)
    same(batch.reset(seed=1), sync.reset(seed=1))
    rng, size, masked = np.random.default_rng(0), np.linspace(0.02, 1.0, count), 0
    for k in range(275):
        actions = size[:, None] * rng.uniform(-0.9, 0.9, (count, 1))
        got, want = batch.step(actions), sync.step(actions)
        same(got, want)
        mask = got[2] | got[3]
        if k == 40:
            mask = np.array([True, False, True, False])
        if mask.any() and (mode == "Disabled" or k == 40):
            seed = 7 if k == 40 else None
            again = [
                one.reset(seed=seed, options={"reset_mask": mask})
                for one in (batch, sync)
            ]
            same(*again)
            masked += 1
    assert masked >= (2 if mode == "Disabled" else 1)


def test_manual_resets_are_asked_for():
    """An episode that has ended does not go on where the caller has to reset it."""
    batch = gymnasium.make_vec(
        "swgjoint.envs:swgjoint/JointTracking-v0",
        2,
        autoreset_mode="Disabled",
        **SHORT["swgjoint/JointTracking-v0"],
    )
    batch.reset(seed=0)
    actions = np.array([[0.0], [1.0]])
    while not batch.step(actions)[2].any():
        pass
    with pytest.raises(InputError, match=naming("ended", "1", "reset_mask")):
        batch.step(actions)
    batch.reset(options={"reset_mask": np.array([False, True])})
    batch.step(actions)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"mask": 1}, ("option", "'mask'", "reset_mask")),
        ({"reset_mask": [True, False]}, ("reset_mask", "[True, False]", "2", "True")),
        ({"reset_mask": np.ones(3, bool)}, ("reset_mask", "2", "True")),
        ({"reset_mask": np.zeros(2, bool)}, ("reset_mask", "2", "True")),
        ({"reset_mask": np.ones(2)}, ("reset_mask", "2", "True")),
    ],
)
def test_options_of_reset_are_checked(options, match):
    """A batch takes a mask of its size alone, a single environment no option."""
    name = "swgjoint.envs:swgjoint/JointTracking-v0"
    batch, single = gymnasium.make_vec(name, 2), gymnasium.make(name)
    batch.reset(seed=0)
    with pytest.raises(InputError, match=naming(*match)):
        batch.reset(options=options)
    with pytest.raises(InputError, match=naming("option", repr(next(iter(options))))):
        single.reset(options=options)


@NAMES
def test_an_episode_begins_with_a_reset(name):
    """Before it a step and a mask are refused in one line."""
    single, batch = make(name).unwrapped, gymnasium.make_vec(name, 2)
    mask = {"reset_mask": np.array([True, False])}
    for early in (
        lambda: single.step(np.zeros(single.action_space.shape)),
        lambda: batch.step(np.zeros(batch.action_space.shape)),
        lambda: batch.reset(options=mask),
    ):
        with pytest.raises(InputError, match=naming("episode", "reset()")):
            early()


@NAMES
@pytest.mark.parametrize("delay", [0, 5])
def test_tracking_errors_fill_their_range(name, delay):
    """No further than 50 arcmin of a link, and room for what a delay shows."""
    period = {} if name.endswith("ArmTracking-v0") else {"period_s": 2e-3}
    env = make(name, sensors={"delay_periods": delay}, **period).unwrapped
    n = len(env.core.joints.names)
    high = env.observation_space.high * env.core.units
    angle, speed = (high[k * n : (k + 1) * n] for k in (2, 3))
    ratio = np.abs(env.core.joints.ratio)
    fastest = 0.6 if n == 1 else np.abs(env.core._path[:, 1]).max()
    lag = ratio * fastest * delay * env.core.period
    reach = ratio * np.deg2rad(50.0 / 60.0)
    assert (angle >= reach + lag).all() and (angle <= 1.1 * (reach + lag)).all()
    assert (speed >= reach / 0.1).all() and (speed < 0.5 * 180.0).all()


@NAMES
def test_seeds_of_a_batch(name):
    """A list seeds every episode; without one the generators go on."""
    batch = gymnasium.make_vec(f"swgjoint.envs:{name}", num_envs=3, randomise=True)
    first, _ = batch.reset(seed=5)
    again, _ = batch.reset(seed=[5, 6, 7])
    np.testing.assert_array_equal(first, again)
    others, _ = batch.reset()
    assert np.abs(others - first).max() > 0.0


def test_seeds_of_numpy_are_integers():
    """One of them or an array is accepted like Python's; anything else is named."""
    env = gymnasium.make_vec("swgjoint.envs:swgjoint/JointTracking-v0", num_envs=2)
    wanted, _ = env.reset(seed=5)
    for seed in (np.int64(5), np.array([5, 6]), [np.uint32(5), 6]):
        np.testing.assert_array_equal(env.reset(seed=seed)[0], wanted)
    for seed in (5.0, "ab"):
        with pytest.raises(InputError, match="an integer"):
            env.reset(seed=seed)


@NAMES
def test_normalised_observations_lose_no_bit(name):
    """They lie between -1 and 1, are SI values over their units, and pay the same."""
    keys = {"randomise": True, "sensors": ALL}
    one, other = make(name, **keys).unwrapped, make(name, normalise=False, **keys)
    other = other.unwrapped
    space, units = one.observation_space, one.core.units
    assert (space.high <= 1.0).all() and (space.high > 0.5).all()
    assert (space.low == -space.high).all()
    np.testing.assert_array_equal(space.high * units, other.observation_space.high)
    assert (other.core.units == 1.0).all()
    got, want = one.reset(seed=2), other.reset(seed=2)
    rng, size = np.random.default_rng(0), one.action_space.shape
    for _ in range(100):
        np.testing.assert_array_equal(got[0] * units, want[0])
        read, true = (
            env.read_measurements(row[0]) for env, row in ((one, got), (other, want))
        )
        for key, value in vars(read).items():
            np.testing.assert_array_equal(value, vars(true)[key])
        action = rng.uniform(-0.3, 0.3, size)
        got, want = one.step(action), other.step(action)
        assert got[1:4] == want[1:4]

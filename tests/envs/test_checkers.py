"""Gymnasium's checker on every documented argument, worker processes, and memory."""

from __future__ import annotations

import gc
import inspect
import os
import re
from dataclasses import fields

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from swgjoint.envs import ENVIRONMENTS

BENCH = {
    "drive": "CSG-20-100",
    "level": "linear",
    "rotor_inertia_kgm2": 2e-4,
    "load_inertia_kgm2": 2.0,
    "payload_kg": 3.0,
    "friction": False,
    "kinematic_error_arcmin": 0.0,
    "torque_limit_Nm": 0.4,
    "max_speed_rad_s": 0.3,
    "period_s": 5e-3,
    "load_of_rated": 0.2,
    "sensors": {"link_encoder": True, "torque_sensor": True, "delay_periods": 2},
    "gauges": {"flexspline": "size-20-100", "position_mm": 11.0, "strain": "outline"},
    "randomise": {"load_inertia": 0.3},
    "normalise": False,
    "error_scale_arcmin": 2.0,
    "effort_weight": 0.0,
}
ARGUMENTS = {
    "swgjoint/JointTracking-v0": {
        **BENCH,
        "max_angle_rad": 0.5,
        "episode_s": 1.0,
        "reference": ("multisine", "sinusoid"),
    },
    "swgjoint/RippleSuppression-v0": {
        **BENCH,
        "max_angle_rad": 4.0,
        "episode_s": 2.0,
        "slowest": 0.5,
        "authority_of_rated": 0.1,
        "loop_Hz": 5.0,
        "loop_damping_ratio": 0.7,
        "ripple_scale_of_rated": 0.02,
        "identify": True,
    },
    "swgjoint/ArmTracking-v0": {
        "scene": "two-link",
        "reference": ("sinusoid", "multisine"),
        "max_speed_rad_s": 0.3,
        "max_angle_rad": 0.2,
        "max_distance_mm": 50.0,
        "payload_kg": (0.0, 1.5),
        "payload_centre_mm": (10.0, 0.0, 30.0),
        "level": "linear",
        "friction": False,
        "kinematic_error_arcmin": 0.5,
        "action": "setpoint",
        "authority_of_rated": 0.1,
        "shift_arcmin": 5.0,
        "episode_s": 1.0,
        "sensors": BENCH["sensors"],
        "randomise": True,
        "normalise": False,
        "error_scale_mm": 2.0,
        "effort_weight": 0.0,
    },
}
"""Another value than the default for every argument of every environment."""
EACH = [
    pytest.param(
        name,
        key,
        marks=pytest.mark.slow if name.endswith("ArmTracking-v0") else (),
    )
    for name, keys in ARGUMENTS.items()
    for key in keys
]


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_every_argument_is_here(name):
    """The table has all settings, the docstring describes them, and they differ."""
    env = gymnasium.make(name).unwrapped
    settings = {field.name: field.default for field in fields(env.settings_type)}
    keys = ARGUMENTS[name]
    assert keys.keys() == settings.keys()
    assert all(keys[key] != default for key, default in settings.items())
    described = arguments_of(type(env))
    if name.startswith("swgjoint/Ripple"):  # it refers to the others
        tracking = gymnasium.make("swgjoint/JointTracking-v0").unwrapped
        described |= arguments_of(type(tracking)) & set(settings)
    assert described == set(settings)


def arguments_of(kind):
    """Names of the arguments that a docstring describes."""
    text = inspect.cleandoc(kind.__doc__)
    return set(re.findall(r"^    (\w+): ", text[text.index("Args (") :], re.MULTILINE))


@pytest.mark.parametrize(("name", "key"), EACH)
def test_each_argument_passes_the_checker(name, key):
    """Alone, or with the one that it needs; gymnasium's checks raise no warning."""
    keys = [key, *({"payload_kg"} if key == "payload_centre_mm" else ())]
    env = gymnasium.make(name, **{one: ARGUMENTS[name][one] for one in keys})
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("level", ["linear", "full"])
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_all_arguments_together_pass_the_checker(name, level):
    """At either level of the drives; specimens of the whole drive at level full."""
    keys = {**ARGUMENTS[name], "level": level}
    if level == "full":
        keys["randomise"] = True
    check_env(gymnasium.make(name, **keys).unwrapped, skip_render_check=True)


@pytest.mark.parametrize(
    "name",
    [
        "swgjoint/JointTracking-v0",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in list(ENVIRONMENTS)[1:]
        ),
    ],
)
def test_all_kinds_of_vectors_agree(name):
    """In one process, in spawned ones, which load the plugin themselves, batched."""
    keys = {**ARGUMENTS[name], "level": "full", "randomise": True}
    runs = []
    for mode, vector in (
        ("sync", {}),
        ("async", {"context": "spawn"}),
        ("vector_entry_point", {}),
        (None, {}),
    ):
        env = gymnasium.make_vec(
            name, 2, vectorization_mode=mode, vector_kwargs=vector, **keys
        )
        observation, _ = env.reset(seed=3)
        rng, run = np.random.default_rng(0), [observation]
        for _ in range(30):
            action = rng.uniform(-0.3, 0.3, env.action_space.shape)
            run += env.step(action)[:4]
        runs.append(run)
        env.close()
    for other in runs[1:]:
        for a, b in zip(runs[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


def memory():
    """Memory of this process [MB]."""
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.slow
def test_a_million_steps_need_no_more_memory():
    """Of 1,024 joints with random actions: after a third of them it stays as it is."""
    batch = gymnasium.make_vec(
        "swgjoint/JointTracking-v0", 1024, threads=1, randomise=True
    )
    batch.reset(seed=0)
    rng, ended, before = np.random.default_rng(0), 0, np.inf
    for k in range(977):
        _, _, terminated, truncated, _ = batch.step(rng.uniform(-1, 1, (1024, 1)))
        ended += int((terminated | truncated).sum())
        if k == 325:
            before = memory()
    assert ended > 1000
    assert memory() < before + 5.0


@pytest.mark.parametrize("name", list(ENVIRONMENTS)[:2])
def test_episodes_and_environments_leave_nothing_behind(name):
    """Neither 400 short episodes nor 20 batches."""
    env = gymnasium.make(name, randomise=True).unwrapped
    env.reset(seed=0)

    def run_episodes():
        for _ in range(200):
            env.reset()
            env.step(np.zeros(1))
        return memory()

    def make_environments():
        for _ in range(10):
            other = gymnasium.make_vec(name, 4)
            other.reset()
            other.close()
        return memory()

    for repeat in (run_episodes, make_environments):
        first = repeat()
        assert repeat() < first + 5.0


@pytest.mark.filterwarnings("default")  # it recommends 32-bit actions
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_checker_of_stable_baselines3_passes(name):
    """With all arguments together and with the defaults; spawned processes agree."""
    missing = "stable-baselines3 not installed: pip install '.[rl]'"
    pytest.importorskip("stable_baselines3", reason=missing)
    from stable_baselines3.common.env_checker import check_env as check
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

    for keys in ({}, ARGUMENTS[name]):
        check(gymnasium.make(name, **keys).unwrapped, skip_render_check=True)
    full = f"swgjoint.envs:{name}"  # a spawned process has imported nothing
    makers = [lambda: gymnasium.make(full, **ARGUMENTS[name])] * 2
    runs = []
    for env in (DummyVecEnv(makers), SubprocVecEnv(makers, start_method="spawn")):
        env.seed(4)
        run = [env.reset()]
        for _ in range(10):
            run += env.step(np.full((2, *env.action_space.shape), 0.1))[:3]
        env.close()
        runs.append(run)
    for a, b in zip(*runs, strict=True):
        np.testing.assert_array_equal(np.float32(a), np.float32(b))  # as Dummy stores

"""Reward of policies trained with stable-baselines3 and its default settings.

    python tests/benchmarks/learning.py [--cases joint,ripple ...] [--seeds 3]
        [--minutes 10] [--jobs 2] [--json]

For each case and seed, the mean reward of whole episodes that no training has seen,
before and after the training, beside that of no action and, for JointTracking, of a PD
controller. The time limit is CPU time of one thread. It needs the extras ``envs`` and
``rl``.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from statistics import median

import gymnasium
import numpy as np

import swgjoint.envs  # noqa: F401

IDS = {
    "joint": "swgjoint/JointTracking-v0",
    "ripple": "swgjoint/RippleSuppression-v0",
    "arm": "swgjoint/ArmTracking-v0",
}
CASES = {
    **{name: (name, {}, "ppo") for name in IDS},
    **{f"{name}, SI": (name, {"normalise": False}, "ppo") for name in IDS},
    **{
        f"{name}, randomise": (name, {"randomise": True}, "ppo")
        for name in ("joint", "ripple")
    },
    "ripple, randomise, identify": (
        "ripple",
        {"randomise": True, "identify": True},
        "ppo",
    ),
    "arm, drawn": (
        "arm",
        {
            "reference": ("multisine", "point_to_point", "line", "arc", "spline"),
            "payload_kg": (0.0, 4.0),
        },
        "ppo",
    ),
    "joint, 10 ms, SAC": ("joint", {"period_s": 0.01}, "sac"),
}
"""Environment, its keywords and the algorithm."""
COUNT, TESTS, TEST_SEED = 16, 32, 10_000
"""Number of environments of a training, of test episodes, and their first seed."""


def rewards(env, act):
    """Reward of one whole episode of each environment under a policy (n,)."""
    observation, _ = env.reset(seed=TEST_SEED)
    total, going = np.zeros(env.num_envs), np.ones(env.num_envs, bool)
    while going.any():
        observation, reward, ended, cut, _ = env.step(act(observation))
        total += np.where(going, reward, 0.0)
        going &= ~(ended | cut)
    return total


def pd(env):
    """PD controller of JointTracking with 8 Hz at the motor, critically damped."""
    core = env.unwrapped.core
    ratio, s = abs(core.joint.drive.ratio), core.settings
    inertia = s.rotor_inertia_kgm2 + s.load_inertia_kgm2 / ratio**2
    limit = core.joint.drive.ratings.repeated_peak / ratio
    w = 2.0 * np.pi * 8.0

    def act(observation):
        error, speed = (observation * core.units)[:, 2:4].T
        torque = inertia * (w**2 * error + 2.0 * w * speed)
        return np.clip(torque / limit, -1.0, 1.0)[:, None]

    return act


def train(job):
    """Train one policy.

    Returns:
        Case, seed, steps, CPU seconds, and the rewards of no action, of PD, and of the
        policy before and after the training.
    """
    case, seed, minutes = job
    import torch
    from stable_baselines3 import PPO, SAC
    from stable_baselines3.common.callbacks import BaseCallback

    from swgjoint.envs.sb3 import BatchVecEnv

    torch.set_num_threads(1)
    name, keywords, algorithm = CASES[case]

    class Limit(BaseCallback):
        """End of the CPU time."""

        def _on_step(self):
            return time.process_time() < end

    batch = gymnasium.make_vec(IDS[name], COUNT, autoreset_mode="SameStep", **keywords)
    env = BatchVecEnv(batch)
    kind = PPO if algorithm == "ppo" else SAC
    model = kind("MlpPolicy", env, seed=seed, device="cpu")
    test = gymnasium.make_vec(IDS[name], TESTS, **keywords)

    def act(observation):
        return model.predict(observation, deterministic=True)[0]

    nothing = np.zeros((TESTS, *test.single_action_space.shape))
    result = {
        "case": case,
        "seed": seed,
        "no_action": float(rewards(test, lambda _: nothing).mean()),
        "pd": float(rewards(test, pd(test)).mean()) if name == "joint" else None,
        "before": float(rewards(test, act).mean()),
    }
    begin = time.process_time()
    end = begin + 60.0 * minutes
    model.learn(10**9, callback=Limit())
    result["cpu_s"] = time.process_time() - begin
    result["steps"] = model.num_timesteps
    result["after"] = float(rewards(test, act).mean())
    print(json.dumps(result), file=sys.stderr, flush=True)
    return result


def main():
    """Train all policies and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", action="append", choices=CASES, help="default: all")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--minutes", type=float, default=10.0, help="CPU time [min]")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    for key in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ[key] = "1"
    jobs = product(args.cases or CASES, range(args.seeds), [args.minutes])
    with ProcessPoolExecutor(args.jobs, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(train, jobs))
    if args.json:
        print(json.dumps(found))
        return
    for case in args.cases or CASES:
        rows = [row for row in found if row["case"] == case]
        after = [row["after"] for row in rows]
        by_pd = "" if rows[0]["pd"] is None else f", PD {rows[0]['pd']:.0f}"
        print(
            f"{case}: {median(r['before'] for r in rows):.0f} -> {min(after):.0f} to"
            f" {max(after):.0f} (no action {rows[0]['no_action']:.0f}{by_pd};"
            f" {median(r['steps'] for r in rows):.3g} steps)"
        )


if __name__ == "__main__":
    main()

"""Steps a second of JointTracking-v0: batched against gymnasium's SyncVectorEnv.

    python tests/benchmarks/env_throughput.py [--envs 256] [--threads 0] [--json]

Both take the same random actions in turns within one process; ratios are medians over
the rounds.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv

import swgjoint.envs  # noqa: F401
from swgjoint.envs.joint_tracking import JointTrackingEnv

NAME = "swgjoint/JointTracking-v0"


def rate(env: VectorEnv, actions: np.ndarray) -> float:
    """Environment steps per second. Actions have shape (steps, n, 1)."""
    begin = time.perf_counter()
    for action in actions:
        env.step(action)
    return len(actions) * env.num_envs / (time.perf_counter() - begin)


def compare(
    envs: int, threads: int, rounds: int, steps: int, **keys: Any
) -> dict[str, float]:
    """Rates of both and their ratio, medians."""
    batch = gymnasium.make_vec(NAME, num_envs=envs, threads=threads, **keys)
    sync = SyncVectorEnv([lambda: JointTrackingEnv(**keys)] * envs)
    rng, got = np.random.default_rng(0), []
    for one in (batch, sync):
        one.reset(seed=0)
    for _ in range(rounds):
        actions = rng.uniform(-0.05, 0.05, (steps, envs, 1))
        got.append((rate(batch, actions), rate(sync, actions[: max(1, steps // 5)])))
    rates = np.array(got)
    return {
        "batched_steps_per_s": float(np.median(rates[:, 0])),
        "sync_steps_per_s": float(np.median(rates[:, 1])),
        "ratio": float(np.median(rates[:, 0] / rates[:, 1])),
        "smallest_ratio": float((rates[:, 0] / rates[:, 1]).min()),
    }


def main() -> None:
    """Measure with nominal drives and with specimens."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--envs", type=int, default=256)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    size = (given.envs, given.threads, given.rounds, given.steps)
    got = {
        name: compare(*size, **keys)
        for name, keys in {
            "nominal": {},
            "randomised": {"randomise": True},
        }.items()
    }
    if given.json:
        print(json.dumps(got))
        return
    for name, row in got.items():
        print(
            f"{name:10s} {given.envs} environments: batched"
            f" {row['batched_steps_per_s']:8.0f}/s, sync"
            f" {row['sync_steps_per_s']:8.0f}/s, ratio {row['ratio']:.1f}"
            f" (smallest {row['smallest_ratio']:.1f})"
        )


if __name__ == "__main__":
    main()

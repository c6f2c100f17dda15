"""Steps a second of JointTracking-v0 in training: batched, single, and in gymnasium.

    python tests/benchmarks/env_throughput.py [--envs 1024] [--threads 0] [--json]

Actions are uniform between -1 and 1, as at the start of a training, so that episodes
end early and restart; the mean length of an episode is reported. All kinds take turns
within one process, and figures are medians over the rounds. Steps per CPU second (all
threads) hardly depend on what else the machine does; steps per second do.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv, VectorEnv

import swgjoint.envs  # noqa: F401
from swgjoint.envs.joint_tracking import JointTrackingEnv

NAME = "swgjoint/JointTracking-v0"


def rate(run: Callable[[], int], count: int) -> tuple[float, float, float]:
    """Steps per second, per CPU second, and episodes that ended, of ``count`` steps."""
    wall, cpu = time.perf_counter(), time.process_time()
    ended = run()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return count / wall, count / cpu, ended


def vector_run(env: VectorEnv, actions: np.ndarray) -> tuple[float, float, float]:
    """Rates of a vector environment. Actions have shape (steps, n, 1)."""

    def run() -> int:
        ended = 0
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            ended += int((terminated | truncated).sum())
        return ended

    return rate(run, len(actions) * env.num_envs)


def single_run(
    env: JointTrackingEnv, actions: np.ndarray
) -> tuple[float, float, float]:
    """Rates of a single environment. Actions have shape (steps, 1)."""

    def run() -> int:
        ended = 0
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
                ended += 1
        return ended

    return rate(run, len(actions))


def compare(
    envs: int, threads: int, rounds: int, steps: int, **keys: Any
) -> dict[str, float]:
    """Rates of all kinds, medians, and the ratio of the batch to gymnasium's loop."""
    batch = gymnasium.make_vec(NAME, num_envs=envs, threads=threads, **keys)
    few = min(envs, 64)
    sync = SyncVectorEnv([lambda: JointTrackingEnv(**keys)] * few)
    single = JointTrackingEnv(**keys)
    rng, got = np.random.default_rng(0), []
    for one in (batch, sync, single):
        one.reset(seed=0)
    # until the ends of the episodes have spread over the steps
    vector_run(batch, rng.uniform(-1.0, 1.0, (300, envs, 1)))
    for _ in range(rounds):
        actions = rng.uniform(-1.0, 1.0, (steps, envs, 1))
        got.append(
            (
                vector_run(batch, actions),
                vector_run(sync, actions[: max(1, steps // 5), :few]),
                single_run(single, actions[:, 0].repeat(20, axis=0)),
            )
        )
    rates = np.array(got)
    wall, cpu, _ = np.median(rates, axis=0).T
    ratios = rates[:, 0, 0] / rates[:, 1, 0]
    return {
        "batched_steps_per_s": float(wall[0]),
        "batched_steps_per_cpu_s": float(cpu[0]),
        "sync_steps_per_s": float(wall[1]),
        "single_steps_per_s": float(wall[2]),
        "single_steps_per_cpu_s": float(cpu[2]),
        "mean_episode": float(envs * steps / max(rates[:, 0, 2].mean(), 1.0)),
        "ratio": float(np.median(ratios)),
        "smallest_ratio": float(ratios.min()),
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


def main() -> None:
    """Measure with nominal drives and with specimens."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--envs", type=int, default=1024)
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
            f"{name:10s} {given.envs} environments, {row['mean_episode']:.0f} steps an"
            f" episode: batched {row['batched_steps_per_s']:.0f}/s"
            f" ({row['batched_steps_per_cpu_s']:.0f} per CPU second), sync"
            f" {row['sync_steps_per_s']:.0f}/s, ratio {row['ratio']:.1f} (smallest"
            f" {row['smallest_ratio']:.1f}), single {row['single_steps_per_s']:.0f}/s"
            f" ({row['single_steps_per_cpu_s']:.0f} per CPU second)"
        )


if __name__ == "__main__":
    main()

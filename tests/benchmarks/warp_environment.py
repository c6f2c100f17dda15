"""Steps a second of JointTracking in MuJoCo Warp, ends and resets included.

    python tests/benchmarks/warp_environment.py [--worlds 256,4096] [--device cuda:0]
        [--steps 400] [--json]

Random actions of -1 to 1 with ``randomise``, beside the vector environment of as many
episodes on the cores of the machine. Each figure is the median of interleaved rounds.
"""

from __future__ import annotations

import argparse
import json
import time
from statistics import median
from typing import Any

import numpy as np
import warp as wp

from swgjoint.envs.joint_tracking import JointTrackingVectorEnv
from swgjoint.envs.warp import WarpJointTracking


def measure(worlds: int, steps: int, rounds: int, device: str | None) -> dict[str, Any]:
    """Rates of both environments for a number of worlds."""
    rng, keys = np.random.default_rng(0), {"randomise": True}
    drawn = rng.uniform(-1.0, 1.0, (10, worlds, 1))
    env = WarpJointTracking(worlds, device=device, **keys)
    there = [wp.array(one, dtype=float, device=device) for one in drawn]
    other = JointTrackingVectorEnv(worlds, autoreset_mode="SameStep", **keys)
    env.reset()
    other.reset(seed=0)
    env.step(there[0])  # compiles the kernels
    rates, ended = [], 0
    for _ in range(rounds):
        wp.synchronize()
        begin = time.perf_counter()
        for k in range(steps):
            env.step(there[k % 10])
        wp.synchronize()
        middle = time.perf_counter()
        for k in range(steps):
            _, _, broken, over, _ = other.step(drawn[k % 10])
            ended += int(np.sum(broken | over))
        end = time.perf_counter()
        rates.append([worlds * steps / t for t in (middle - begin, end - middle)])
    here, on_cores = (median(column) for column in zip(*rates, strict=True))
    episode = worlds * steps * rounds / max(ended, 1)
    return {
        "worlds": worlds,
        "steps_per_s": here,
        "vector_steps_per_s": on_cores,
        "steps_of_an_episode": episode,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", default="256,4096")
    parser.add_argument("--device", default=None, help="Warp's default without it")
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    wp.config.quiet = True
    name = wp.get_device(given.device).name
    rows = [
        measure(int(worlds), given.steps, given.rounds, given.device)
        for worlds in given.worlds.split(",")
    ]
    if given.json:
        print(json.dumps({"device": name, "rows": rows}, indent=1))
        return
    for row in rows:
        print(
            f"{row['worlds']} worlds: {row['steps_per_s']:.3g} steps/s on {name},"
            f" {row['vector_steps_per_s']:.3g} on the cores"
            f" (episodes of {row['steps_of_an_episode']:.0f} steps)"
        )


if __name__ == "__main__":
    main()

"""What three minutes of ``swgjoint tune`` gain over PD by the textbook rule.

    python tests/benchmarks/tuning.py [--minutes 3] [--seeds 0,1] [--json]

Costs are those of seeds that no search has seen. Reported are the tuned controller, PD
with its two gains tuned alone, and the controller with gains by the rule, each over the
textbook's PD.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

from swgjoint.explore.tune.result import TuneSettings
from swgjoint.explore.tune.tune import tune
from swgjoint.units import arcmin


def measure(minutes: float, seed: int, controller: str, optimiser: str) -> dict:
    """One run of the tuning."""
    found = tune(
        TuneSettings(
            environment="JointTracking-v0",
            minutes=minutes,
            seed=seed,
            controller=controller,
            optimiser=optimiser,
        )
    )
    row: dict[str, Any] = {
        "seed": seed,
        "evaluations": found.to_json()["evaluations"],
        "wall_s": found.wall,
        "parameters": found.best.values,
    }
    for one in found.candidates:
        row[one.name] = {
            "held_out_arcmin": float(one.held_out.mean() / arcmin),
            "less_percent": 100.0 * found.improvement(one),
        }
    return row


def main() -> None:
    """Measure every seed, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--seeds", default="0,1")
    parser.add_argument("--controller", default="pd-flexible")
    parser.add_argument("--optimiser", default="de")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows = [
        measure(given.minutes, int(seed), given.controller, given.optimiser)
        for seed in given.seeds.split(",")
    ]
    if given.json:
        print(json.dumps(rows))
        return
    for row in rows:
        head = f"seed {row['seed']}: {row['evaluations']} candidates"
        print(f"{head}, {row['wall_s']:.0f} s")
        for name, one in row.items():
            if isinstance(one, dict) and "less_percent" in one:
                print(
                    f"  {name:22s} {one['held_out_arcmin']:6.3f} arcmin,"
                    f" {one['less_percent']:5.1f} % less"
                )


if __name__ == "__main__":
    main()

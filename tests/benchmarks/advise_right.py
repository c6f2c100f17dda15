"""Whether ``swgjoint advise`` is right: python tests/benchmarks/advise_right.py.

Ten scenes with a stated error. Every setting that advise tried is run again and
compared with another reference: RK4 of level ``full`` with the inputs of the middle of
each step, where advise extrapolates steps of its own scheme. Its choice must be within
the error and no cheaper setting that it tried may be, where costs within 5 % are equal.
The reference tells its own error by its run at twice the step. Exit status 1 if advise
was wrong anywhere.
"""

from __future__ import annotations

import argparse
import json
import sys

import mujoco

from swgjoint.explore.advise.advise import advise
from swgjoint.explore.advise.bound import parse_bound
from swgjoint.explore.advise.search import ALIKE
from swgjoint.pool import LocalPool, Lost
from swgjoint.sim.accuracy import Setting, attempt, errors
from swgjoint.sim.arm.scene import is_arm, scene_of_arm
from swgjoint.sim.scene.scene import Scene

CASES = (
    ("ur5e-catalogue", "0.1arcmin", ()),
    ("iiwa14-sweep", "0.02mm", ()),
    ("kinova-sweep", "6arcsec", ()),
    ("panda-sweep", "1arcmin", ()),
    ("two-link", "0.02arcmin", ()),
    ("iiwa7", "1e-4rad", ()),
    ("bench", "0.5arcmin", ("simulation.duration_s=1.5",)),
    ("ur5e-circle", "0.05mm", ("simulation.duration_s=2.5",)),
    ("ur5e-payload-step", "2arcmin", ()),
    (
        "bench-chirp",
        "0.2arcmin",
        ("controller.kind=pd", "defaults.friction=true", "simulation.duration_s=4.0"),
    ),
)
REFERENCE_STEPS = (1e-4, 4e-5, 2e-5, 1e-5)
"""The longest that RK4 takes, and half of it, which tells the error [s]."""


def judge(case: tuple[str, str, tuple[str, ...]]) -> dict[str, object]:
    """One scene: what advise said, and what the other reference says of it."""
    name, text, changes = case
    scene = (
        scene_of_arm(name, overrides=changes)
        if is_arm(name)
        else Scene.load_file(name, changes)
    )
    bound = parse_bound(text)
    said = advise(scene, bound)
    mujoco.set_mju_user_warning(lambda message: None)
    for step in REFERENCE_STEPS:
        runs = [
            attempt(scene, Setting(level="full", integrator="RK4", step=h)).run
            for h in (step, 0.5 * step)
        ]
        if None not in runs:
            break
    own = errors(runs[0], runs[1])[bound.quantity]
    rows = []
    for row in said["rows"]:
        if row["error"] is None:
            continue
        setting = Setting(
            level=row["level"], integrator=row["integrator"], step=row["step_s"]
        )
        got = errors(attempt(scene, setting).run, runs[1])[bound.quantity]
        rows.append((row["cost"], got, setting))
    mujoco.set_mju_user_warning(None)
    keys = ("level", "integrator", "step_s")
    chosen = Setting(level=said[keys[0]], integrator=said[keys[1]], step=said[keys[2]])
    error, cost = next((e, c) for c, e, s in rows if s == chosen)
    cheaper = [
        s.level + ", " + s.name
        for c, e, s in rows
        if ALIKE * c < cost and e <= bound.value
    ]
    return {
        "scene": name,
        "bound": text,
        **{key: said[key] for key in keys},
        "cost": cost,
        "expected": said["expected_error"],
        "error": error,
        "unit": bound.unit,
        "within": error <= bound.value,
        "cheaper_within": cheaper,
        "tried": len(rows),
        "reference_step_s": 0.5 * step,
        "reference_error": own,
        "wall_s": said["wall_s"],
    }


def main() -> int:
    """Print a line a scene, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="SCENE")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    cases = [case for case in CASES if not args.only or case[0] in args.only]
    executor = LocalPool(args.jobs)
    found = []
    for case, row in executor.run(judge, cases):
        if isinstance(row, Lost):
            raise SystemExit(f"{case[0]}: {row.reason}")
        found.append(row)
        if args.json:
            continue
        right = row["within"] and not row["cheaper_within"]
        print(
            f"{row['scene']:18} {row['bound']:>10} {row['level']:9}"
            f" {row['integrator']:8} {1e3 * row['step_s']:5g} ms"
            f" cost {row['cost']:6.3g} said {row['expected']:8.3g}"
            f" is {row['error']:8.3g} {row['unit']:6}"
            f" of {row['tried']:2} reference +-{row['reference_error']:.1g}"
            f" {'right' if right else 'WRONG'} {row['cheaper_within'] or ''}",
            flush=True,
        )
    if args.json:
        print(json.dumps(found, indent=2))
    return int(any(r["cheaper_within"] or not r["within"] for r in found))


if __name__ == "__main__":
    sys.exit(main())

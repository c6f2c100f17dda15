"""Hot paths before and after, for their notebook.

``python tests/benchmarks/profile_cost.py FILE --before CLONE`` runs a map in the plane,
a run in space and steps of a chain of joints with the package of CLONE (another commit,
its plugin built in place) and with the one that is installed, in turns and each in a
process of its own. CPU times and their ratios go to FILE, ``notebooks/hot-paths.json``,
where tasks that were not asked for stay; a time under load is no finding, a ratio in
turns is.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import swgjoint
from swgjoint.files import write_whole
from swgjoint.json_text import json_text
from swgjoint.provenance import provenance

COMMON = """
import json, time
import numpy as np
from swgjoint.gear.design.design import Design
marks = {}
def timed(name, work):
    begin = time.process_time()
    found = work()
    marks[name] = time.process_time() - begin
    return found
"""
TASKS = {
    "2d map": """
from swgjoint.drives.build_map import build_map
design = Design.load("reference-2d")
timed("map", lambda: build_map(design, model="2d", angles=4, cache=False))
""",
    "3d run": """
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.stress import SolidMaxima
design = Design.load("reference-3d-modified").with_changes({
    "drive.teeth_flexspline": 40, "drive.teeth_circular_spline": 42,
    "cup.length_mm": 14.0, "cup.bore_radius_mm": 7.0, "mesh.refinement": 0.5,
})
ring = timed("condensation", lambda: solid_sector_model(design, half=True))
follow = SolidContinuation(model=ring, ratio=design.ratio)
state = timed("deflection", follow.deflect)
state = timed("engagement and load", lambda: follow.to_torque(follow.engage(state), 5))
angle = 0.5 * np.pi / 42
state = timed("position", lambda: follow.to_angle(state, angle))
assert state.outcome.ok
timed("stresses", lambda: SolidMaxima.from_state(ring, state))
""",
    "joint step": """
import mujoco
from swgjoint.joint.attach import attach
from dataclasses import replace
from swgjoint.maps.drive_map import DriveMap
def with_harmonics(base, n):
    potential = np.repeat(base.potential[:1], n + 1, axis=0)
    ends = np.repeat(base.end_stiffness[:1], n + 1, axis=0)
    potential[1:] *= 0.02 / n
    ends[1:] *= 0.02 / n
    return replace(base, orders=np.array([(k, 0) for k in range(n + 1)]),
        potential=potential, end_stiffness=ends, kinematic_error=np.zeros((n + 1, 2)))
def chain(level):
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = 1e-3, [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    body = spec.worldbody
    base = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)
    drive = with_harmonics(base, 16)
    for k in range(6):
        body = body.add_body(name=f"link{k}", pos=[0, 0, 0.1])
        body.add_joint(name=f"j{k}", axis=[[0, 0, 1], [0, 1, 0]][k % 2])
        body.mass, body.inertia, body.explicitinertial = 0.5, [0.05] * 3, True
        attach(spec, joint=f"j{k}", drive=drive, level=level, rotor_inertia=1e-4,
            friction=False)
    model = spec.compile()
    return model, mujoco.MjData(model)
for level in ("rigid", "native", "full"):
    model, data = chain(level)
    data.qvel[:] = 1e-3
    mujoco.mj_step(model, data, 1000)
    least = []
    for _ in range(7):
        begin = time.process_time()
        mujoco.mj_step(model, data, 5000)
        least.append((time.process_time() - begin) / 5000)
    marks[level] = min(least)
""",
}


def once(task: str, package: Path) -> dict[str, float]:
    """CPU seconds of the parts of a task with one package."""
    code = COMMON + TASKS[task] + "print(json.dumps(marks))"
    more = {"PYTHONPATH": str(package), "SWGJOINT_CACHE": ""}
    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **more, **threads},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise SystemExit(f"{task} with {package}: {done.stderr[-2000:]}")
    found: dict[str, float] = json.loads(done.stdout)
    return found


def compared(task: str, packages: tuple[Path, Path], pairs: int) -> dict[str, Any]:
    """Medians of both and of their ratios, in turns, by part."""
    runs = [[once(task, package) for package in packages] for _ in range(pairs)]
    return {
        part: {
            "before_s": float(np.median([before[part] for before, _ in runs])),
            "after_s": float(np.median([after[part] for _, after in runs])),
            "ratio": float(np.median([b[part] / a[part] for b, a in runs])),
            "ratios": [b[part] / a[part] for b, a in runs],
        }
        for part in runs[0][0]
    }


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--before", type=Path, required=True, metavar="CLONE")
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--only", choices=TASKS, nargs="+", default=list(TASKS))
    given = parser.parse_args()
    packages = (given.before.resolve(), Path(swgjoint.__file__).resolve().parents[1])
    git = ("git", "-C", str(packages[0]), "log", "-1", "--format=%h %cs %s")
    commit = subprocess.run(git, capture_output=True, text=True, check=True)
    tasks = {}
    if given.file.is_file():
        tasks = json.loads(given.file.read_text(encoding="utf-8"))["tasks"]
    for task in given.only:
        tasks[task] = {
            "before": commit.stdout.strip(),
            "after": provenance(),
            "pairs": given.pairs,
            "parts": compared(task, packages, given.pairs),
        }
        result = {
            "what": "CPU seconds of hot paths before and after, runs in turns",
            "command": "python tests/benchmarks/profile_cost.py FILE --before CLONE",
            "tasks": tasks,
        }
        write_whole(given.file, json_text(result) + "\n")
        for part, one in tasks[task]["parts"].items():
            print(
                f"{task}, {part}: {one['before_s']:.3g} s before,"
                f" {one['after_s']:.3g} s after, {one['ratio']:.2f} times faster",
                flush=True,
            )


if __name__ == "__main__":
    main()

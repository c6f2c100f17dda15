"""Speed of whole scenes against real time: python tests/benchmarks/scene_speed.py.

Assembly, start, steps, signals and the recording that is written, with the maps at hand
and all modules imported; medians of some runs. What a recording adds is told as a share
of the run without one: CPU time of the process, and wall time where the recording is
begun during the run (``run_scene(recording=...)``), which takes a second core if there
is one (``taskset -c 0`` denies it). Not a test: nothing is asserted.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from swgjoint.drives.references import load_drive
from swgjoint.sim.scene.scene import Scene
from swgjoint.view.run import run_scene

DEFAULT = ("ur5e-sweep", "ur5e-catalogue", "ur5e-circle", "ur5e-payload-step")


def main() -> None:
    """One row per scene, as JSON with --json."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=DEFAULT)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--duration", type=float, help="of every scene [s]")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rows = [measure(name, args.runs, args.duration) for name in args.scenes]
    if args.json:
        print(json.dumps(rows))
        return
    for row in rows:
        print(
            f"{row['scene']:18s} {row['simulated_s']:6.1f} s simulated:"
            f" {row['with_recording']:5.1f} times real time with its recording"
            f" ({row['file_MB']:.1f} MB), {row['without']:5.1f} without,"
            f" {row['metrics_s']:.2f} s for the metrics,"
            f" {row['steps_per_s']:.3g} steps/s; the recording adds"
            f" {100 * row['recording_cpu_share']:.0f} % of CPU time,"
            f" {100 * row['recording_wall_share']:.0f} % of wall time beside the run"
        )


def measure(name: str, runs: int, duration: float | None) -> dict[str, float | str]:
    """Times of one scene, with and without its recording in turn."""
    changes = {} if duration is None else {"simulation.duration_s": duration}
    scene = Scene.load_file(name, changes)
    named = {section.drive for section in (scene.defaults, *scene.joints.values())}
    drives = {drive: load_drive(drive) for drive in named if drive}
    times, shares, speeds = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(runs + 1):
            # new files: one that takes the place of another waits for the disk
            path, other = (
                Path(folder) / f"{part}{k}.rrd" for part in ("run", "beside")
            )
            wall = time.perf_counter()
            run_scene(scene, drives=drives, recording=other)
            beside = time.perf_counter() - wall
            begin, wall = time.process_time(), time.perf_counter()
            run = run_scene(scene, drives=drives)
            ran, alone = time.process_time(), time.perf_counter() - wall
            run.to_rerun(path)
            written = time.process_time()
            run.metrics()
            done = time.process_time()
            if k:  # the first one imports
                times.append((ran - begin, written - begin, done - written))
                shares.append(((written - ran) / (ran - begin), beside / alone - 1.0))
                speeds.append(run.steps_per_second)
        size = path.stat().st_size / 1e6
    ran, written, figures = np.median(times, axis=0)
    simulated = float(run.time[-1])
    return {
        "scene": name,
        "simulated_s": simulated,
        "with_recording": simulated / written,
        "without": simulated / ran,
        "recording_cpu_share": float(np.median(shares, axis=0)[0]),
        "recording_wall_share": float(np.median(shares, axis=0)[1]),
        "metrics_s": float(figures),
        "file_MB": size,
        "steps_per_s": float(np.median(speeds)),
    }


if __name__ == "__main__":
    main()

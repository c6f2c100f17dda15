"""Parallel efficiency of a sweep of 2D designs on this machine.

    python tests/benchmarks/sweep_efficiency.py [--designs 200] [--jobs 2]

Runs a Latin hypercube of designs in the plane with processes and prints one JSON
object: work time over wall time and workers (start and imports of the processes are in
the wall time, not in the work), and the wall time of another run over what was kept.
Meaningful only on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile

from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.results import place_of
from swgjoint.explore.sweep.sweep import run_sweep
from swgjoint.faults import validate
from swgjoint.pool import LocalPool
from swgjoint.progress import StderrProgress
from swgjoint.toml_file import parse_toml

WANTED = 0.9
FILE = """
design = "reference-2d"

[meshing]
figures = ["von_mises_MPa", "transmission_error_pp_arcsec"]
positions = 6

[plan]
kind = "latin_hypercube"
designs = {designs}
seed = 1

[[plan.parameters]]
keys = ["wave_generator.minor_axis_coefficient"]
low = 0.98
high = 1.0

[[plan.parameters]]
keys = ["flexspline.rim_mm"]
low = 0.9
high = 1.3

[[plan.parameters]]
keys = ["flexspline.pressure_angle_deg", "circular_spline.pressure_angle_deg"]
low = 18.0
high = 22.0
"""


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--designs", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    text = FILE.format(designs=args.designs)
    file = validate(SweepFile, parse_toml(text, where="benchmark"), where="benchmark")
    with tempfile.TemporaryDirectory() as folder:
        place = place_of(folder)
        found = run_sweep(
            file,
            executor=LocalPool(args.jobs),
            place=place,
            progress=StderrProgress(),
        )
        again = run_sweep(file, executor=LocalPool(args.jobs), place=place)
    first = found.to_json()
    keys = ("designs", "done", "failed", "workers", "work_s", "wall_s", "efficiency")
    result = {key: first[key] for key in keys} | {
        "wanted": WANTED,
        "enough": first["efficiency"] >= WANTED,
        "again": {"computed": again.computed, "wall_s": again.wall_s},
        "load": os.getloadavg(),
        "cores": os.cpu_count(),
        "machine": platform.platform(),
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()

"""Kill commands at random times and give them again.

    python tests/benchmarks/interruptions.py [--kills 20] [--only sweep,map] [--seed 1]

For every command one run that nothing stops, then runs that SIGKILL ends after a random
part of its time, each followed by the same command. Prints a table: how many second
runs had the same result, how many units of work were kept at the kill (least, median,
most), how many of these were done again, how many that were begun before the kill were
begun once more (median, most: those in flight, one a process, with ``map`` the
equilibria of the last second, with ``sweep`` and ``optimise`` a task of 2 s of
designs), what was left behind. Work before the first unit and after the last one is
repeated, too. Inputs are coarse, so that a run takes seconds. Linux.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

sys.path.insert(0, str(Path(__file__).parents[1] / "shared"))

from interrupted import (
    CACHE,
    Case,
    Outcome,
    finished,
    interrupted,
    prepared,
    stored,
    units,
)

from swgjoint.cli.shared.text import table
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.store import arrays_content

FEW = {
    "mesh.refinement": 0.5,
    "drive.teeth_flexspline": 60,
    "drive.teeth_circular_spline": 62,
}
OLDER = "an older recording"
CUP = {
    "drive.teeth_flexspline": 40,
    "drive.teeth_circular_spline": 42,
    "cup.length_mm": 14.0,
    "cup.bore_radius_mm": 7.0,
    "mesh.refinement": 0.5,
}
SWEEP = """
design = "few.toml"
[meshing]
figures = ["von_mises_MPa", "transmission_error_pp_arcsec"]
positions = 3
[plan]
kind = "latin_hypercube"
designs = 16
seed = 1
[[plan.parameters]]
keys = ["flexspline.rim_mm"]
low = 0.9
high = 1.3
"""
OPTIMISE = """
design = "few.toml"
[meshing]
figures = ["von_mises_MPa", "torsional_stiffness_Nm_rad"]
positions = 2
[[objectives]]
figure = "von_mises_MPa"
[[objectives]]
figure = "torsional_stiffness_Nm_rad"
goal = "maximise"
[plan]
kind = "nsga2"
designs = 24
population = 8
[[plan.parameters]]
keys = ["flexspline.rim_mm"]
low = 0.9
high = 1.3
"""


def toml(name: str, changes: dict[str, float] = FEW) -> str:
    return Design.load(name).with_changes(changes).to_toml()


def whole_recording(folder: Path) -> bool:
    """The older one or the new one."""
    path = folder / "out" / "run.rrd"
    if path.read_bytes() == OLDER.encode():
        return True
    return any(True for _ in RrdReader(path).stream())


def map_arrays(folder: Path, _: dict[str, Any]) -> Any:
    drive = DriveMap.load(folder / "few.swg")
    arrays = {
        key: value.tolist()
        for key, value in vars(drive).items()
        if isinstance(value, np.ndarray)
    }
    return {**arrays, "info": drive.info}


def drives(folder: Path) -> dict[str, int]:
    """Drives of a lot that are kept, and when; the check of one of them is not."""
    found = stored(f"{CACHE}/lots/*.json")(folder)
    return {
        name: t for name, t in found.items() if '"seed"' in (folder / name).read_text()
    }


def generations(folder: Path) -> dict[str, float]:
    """Generations of a journal and the time that each took."""
    path = folder / "out" / "tune.npz"
    if not path.exists():
        return {}
    return {
        f"{key} {k}": float(seconds)
        for key, values in arrays_content(path.read_bytes()).items()
        if key.endswith(".seconds")
        for k, seconds in enumerate(values)
    }


PART = "swgjoint.maps.unfinished:Unfinished.read"
PARTS = stored(f"{CACHE}/unfinished/*/*.npz")
FEW_SOLVES = (
    "from swgjoint.fe.common import sampling; sampling.SOLID_SOLVES = 24;"
    " sampling.SOLID_ANGLES = sampling.SOLID_MOST_ANGLES = 2;"
    " sampling.SOLID_UNSEEN = (2, 1)"
)
FEW_ELEMENTS = "from swgjoint.fe.rings import model; model.ELEMENTS = 100"
CASES = (
    Case(
        name="sweep",
        arguments=("sweep", "sweep.toml", "--out", "out", "--jobs", "2"),
        inputs={"few.toml": toml("reference-2d"), "sweep.toml": SWEEP},
        unit="designs",
        begins="swgjoint.explore.sweep.figures:compute",
        kept=stored("out/results/*/*.json"),
    ),
    Case(
        name="optimise",
        arguments=("optimise", "optimise.toml", "--out", "out", "--jobs", "2"),
        inputs={"few.toml": toml("reference-2d"), "optimise.toml": OPTIMISE},
        unit="designs",
        begins="swgjoint.explore.sweep.figures:compute",
        kept=stored("out/results/*/*.json"),
    ),
    Case(
        name="lot",
        arguments=("lot", "few.toml", "--drives", "80", "--jobs", "2", "--out", "out"),
        inputs={"few.toml": toml("reference-2d-tolerances")},
        unit="drives",
        begins="swgjoint.explore.lot:_one",
        kept=drives,
    ),
    Case(
        name="map",
        arguments=("map", "few.toml", "-o", "few.swg"),
        inputs={"few.toml": toml("reference-2d")},
        unit="equilibria",
        begins=PART,
        kept=PARTS,
        result=map_arrays,
    ),
    Case(
        name="map-3d",
        arguments=("map", "cup.toml", "-o", "few.swg", "--model", "3d"),
        inputs={"cup.toml": toml("reference-3d-modified", CUP)},
        settings=FEW_SOLVES,
        unit="equilibria",
        begins=PART,
        kept=PARTS,
        result=map_arrays,
    ),
    Case(
        name="map-ring",
        arguments=("map", "size-25-100", "-o", "few.swg", "--model", "ring"),
        settings=FEW_ELEMENTS,
        unit="positions of the balls",
        begins=PART,
        kept=PARTS,
        result=map_arrays,
    ),
    Case(
        name="map-tolerances",
        arguments=("map", "few.toml", "-o", "few.swg"),
        inputs={"few.toml": toml("reference-2d-tolerances")},
        unit="equilibria, phases of a pitch",
        begins=PART,
        kept=PARTS,
        result=map_arrays,
    ),
    Case(
        name="meshing",
        arguments=(
            *("meshing", "cup.toml", "--half", "--steps", "8", "--turn", "0.02"),
            *("--torque", "5", "--out", "out"),
        ),
        inputs={"cup.toml": toml("reference-3d-modified", CUP)},
        unit="equilibria",
        begins="swgjoint.fe.solid.checkpoint:Checkpoint.read",
        kept=stored("out/states/*.npz"),
    ),
    Case(
        name="tune",
        arguments=(
            *("tune", "JointTracking-v0", "--evaluations", "96"),
            *("--set", "drive=CSG-20-100", "--out", "out"),
        ),
        unit="generations",
        begins="swgjoint.explore.tune.tune:_costs",
        kept=generations,
    ),
    Case(
        name="run",
        arguments=(
            *("run", "bench", "--drive", "CSG-25-100", "--out", "out"),
            *("--set", "simulation.duration_s=60"),
        ),
        unit="runs",
        begins="swgjoint.sim.run:set_start",
        inputs={"out/run.rrd": OLDER},
        kept=stored("out/[!r]*.rrd"),
        sound=whole_recording,
    ),
)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--only", default=",".join(case.name for case in CASES))
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    rows = []
    with tempfile.TemporaryDirectory(prefix="swgjoint-interruptions-") as top:
        for case in CASES:
            if case.name in args.only.split(","):
                rows.append(row(case, Path(top) / case.name, args.kills, rng))
    header = ("", "kills", "same result", "units", "kept at the kill")
    header += ("kept and done again", "begun twice", "litter", "processes left")
    header += ("whole run [s]",)
    print(table(rows, header=header))


def row(case: Case, top: Path, kills: int, rng: np.random.Generator) -> tuple[Any, ...]:
    folder = prepared(case, top / "whole")
    begin = time.monotonic()
    printed = finished(case, folder)
    wall = time.monotonic() - begin
    found: list[Outcome] = []
    k = 0
    while len(found) < kills:
        k += 1
        folder_k = prepared(case, top / f"kill-{k}")
        stop = partial(past, time.monotonic() + rng.uniform(0.02, 0.98) * wall)
        outcome = interrupted(case, folder_k, stop, (folder, printed))
        if outcome is None:
            continue  # it was quicker this time
        found.append(outcome)
        print(
            f"{case.name} {len(found)}/{kills}: kept {outcome.kept}, again"
            f" {outcome.again}, begun {outcome.begun}, twice {outcome.twice}, same"
            f" {outcome.same}, sound {outcome.sound}, litter {outcome.litter},"
            f" processes {outcome.left}",
            file=sys.stderr,
        )
    kept, twice = [one.kept for one in found], [one.twice for one in found]
    return (
        case.name,
        len(found),
        sum(one.same and one.sound for one in found),
        f"{units(folder)} {case.unit}",
        f"{min(kept)}, {statistics.median(kept):g}, {max(kept)}",
        sum(one.again for one in found),
        f"{statistics.median(twice):g}, {max(twice)}",
        sum(bool(one.litter) for one in found),
        sum(bool(one.left) for one in found),
        wall,
    )


def past(end: float) -> bool:
    return time.monotonic() > end


if __name__ == "__main__":
    main()

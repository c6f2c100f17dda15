"""Cost of the 2D simulation of meshing: python tests/benchmarks/meshing_scaling.py DIR.

Half a turn in 35 positions, all teeth unless ``--half``: CPU and wall time against the
number of teeth (family ``size-25-RRR``: one pitch diameter, teeth of its module, rated
torque), against mesh refinement and against torque (reference-2d). Writes
``meshing_scaling.json`` with the machine and its load, and a log-log picture with
fitted exponents. Set ``OMP_NUM_THREADS=1`` for times of one core. Not a test: nothing
is asserted; failures are kept with their outcome.
"""

from __future__ import annotations

import argparse
import io
import os
import platform
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import SwgError
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.files import write_whole
from swgjoint.gear.design import Design
from swgjoint.json_text import json_text, plain
from swgjoint.maps.catalogue import ratings_of

TEETH = (60, 80, 120, 160, 200, 300, 400)
REFINEMENTS = (1, 2, 3)
PARTS_OF_RATED = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)


class Clock:
    """CPU and wall time of the set-up and of the positions after the first."""

    def __init__(self) -> None:
        self.begin = (time.process_time(), time.perf_counter())
        self.ticks = [self.begin]

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Take the time; called after every position."""
        self.ticks.append((time.process_time(), time.perf_counter()))

    def times(self) -> dict[str, float]:
        """Seconds; the first position has no step before it and counts as set-up."""
        marks = np.array(self.ticks)
        setup, (cpu, wall) = marks[1] - marks[0], marks[-1] - marks[1]
        steps = max(len(marks) - 2, 1)
        return {
            "setup_cpu_s": float(setup[0]),
            "cpu_s": float(marks[-1, 0] - marks[0, 0]),
            "wall_s": float(marks[-1, 1] - marks[0, 1]),
            "cpu_s_per_position": float(cpu / steps),
            "wall_s_per_position": float(wall / steps),
        }


def measure(
    sweep: str, value: float, design: Design, torque: float, args: argparse.Namespace
) -> dict[str, Any]:
    """One simulation: size, times, iterations, outcome."""
    load, clock = os.getloadavg()[0], Clock()
    row: dict[str, Any] = {
        "sweep": sweep,
        "value": value,
        "design": design.drive.name,
        "teeth": design.drive.teeth_flexspline,
        "refinement": design.mesh.refinement,
        "torque_Nm": torque,
        "half": args.half,
        "load_before": load,
    }
    try:
        run = simulate_meshing(
            design,
            torque=torque,
            steps=args.steps,
            half=args.half,
            throw=False,
            progress=clock,
        )
    except SwgError as error:
        return row | {"outcome": str(error)}
    return row | {
        "nodes": run.nodes,
        "elements": run.elements,
        "iterations_per_position": float(np.mean([s.iterations for s in run.steps])),
        "pairs_in_contact": float(
            np.mean([s.pairs_in_contact for s in run.steps if s.outcome.ok] or [0])
        ),
        "positions_failed": sum(not s.outcome.ok for s in run.steps),
        "outcome": run.outcome.name.lower(),
        **clock.times(),
    }


def sweeps(args: argparse.Namespace) -> list[dict[str, Any]]:
    """All rows; a short run first, so that imports and caches are warm."""
    reference = Design.load("reference-2d")
    simulate_meshing(reference, torque=20.0, steps=2, half=True)
    rated = ratings_of(reference).rated_torque
    plan = [
        ("teeth", teeth, Design.load(f"size-25-{teeth // 2}"), None) for teeth in TEETH
    ]
    for n in REFINEMENTS:
        plan.append(
            ("refinement", n, reference.with_changes({"mesh.refinement": n}), rated)
        )
    for part in PARTS_OF_RATED:
        plan.append(("torque", part * rated, reference, part * rated))
    rows = []
    for sweep, value, design, torque in plan:
        if torque is None:
            torque = ratings_of(design).rated_torque
        rows.append(measure(sweep, value, design, torque, args))
        row = rows[-1]
        print(
            f"{sweep:10} {value:6g} {row['design']:14} {row['torque_Nm']:7.1f} N·m"
            f" {row.get('cpu_s_per_position', float('nan')):8.3f} s a position,"
            f" {row.get('iterations_per_position', 0):5.1f} iterations,"
            f" {row['outcome']}",
            flush=True,
        )
    return rows


def exponent(rows: list[dict[str, Any]], sweep: str) -> tuple[float, float] | None:
    """Fit cpu_s_per_position = c value^p over a sweep; p and c."""
    used = [r for r in rows if r["sweep"] == sweep and r.get("cpu_s_per_position")]
    used = [r for r in used if r["value"] > 0.0]
    if len(used) < 2:
        return None
    x, y = (np.log([r[k] for r in used]) for k in ("value", "cpu_s_per_position"))
    p, c = np.polyfit(x, y, 1)
    return float(p), float(np.exp(c))


def picture(result: dict[str, Any]) -> bytes:
    """PNG: CPU and wall time a position over each parameter, log-log."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 4.4), layout="constrained")
    labels = {
        "teeth": "teeth of the flexspline",
        "refinement": "mesh refinement",
        "torque": "torque [N·m]",
    }
    axes = figure.subplots(1, 3, sharey=True)
    for ax, (sweep, label) in zip(axes, labels.items(), strict=True):
        rows = [r for r in result["rows"] if r["sweep"] == sweep and r["value"] > 0.0]
        rows = [r for r in rows if "cpu_s_per_position" in r]
        x = np.array([r["value"] for r in rows])
        for key, style in (("cpu", "o-"), ("wall", "x:")):
            y = [r[f"{key}_s_per_position"] for r in rows]
            ax.loglog(x, y, style, label=f"{key} time")
        if (fit := result["exponents"].get(sweep)) is not None:
            ax.loglog(
                x, fit[1] * x ** fit[0], "k--", lw=0.8, label=f"power {fit[0]:.2f}"
            )
        ax.set_xticks(x, [f"{v:g}" for v in x])
        ax.xaxis.minorticks_off()
        ax.set_xlabel(label)
        ax.grid(alpha=0.3)
        ax.legend(fontsize="small")
    axes[0].set_ylabel("one position [s]")
    size = "half model" if result["half"] else "all teeth"
    figure.suptitle(
        f"2D simulation of meshing, {size}, {result['steps']} positions;"
        f" {result['machine']}, load {result['load']:.1f} on {result['cores']} cores",
        fontsize="medium",
    )
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110)
    return out.getvalue()


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path, metavar="DIR")
    parser.add_argument("--steps", type=int, default=35)
    parser.add_argument("--half", action="store_true", help="half models")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    rows = sweeps(args)
    found = {
        sweep: exponent(rows, sweep) for sweep in ("teeth", "refinement", "torque")
    }
    result = {
        "steps": args.steps,
        "half": args.half,
        "machine": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": float(np.mean([row["load_before"] for row in rows])),
        "threads": os.environ.get("OMP_NUM_THREADS"),
        "versions": {name: version(name) for name in ("numpy", "scipy")},
        "exponents": {sweep: fit for sweep, fit in found.items() if fit is not None},
        "rows": rows,
    }
    for sweep, fit in result["exponents"].items():
        print(f"time a position ~ {sweep}^{fit[0]:.2f}")
    write_whole(args.out / "meshing_scaling.json", json_text(plain(result)) + "\n")
    write_whole(args.out / "meshing_scaling.png", picture(result))


if __name__ == "__main__":
    main()

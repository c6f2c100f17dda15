"""``swgjoint demo``: from the tooth geometry of two drives to a moving arm."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from swgjoint.cli.run import joint_table, notes, verdict_lines
from swgjoint.cli.shared.ripple_text import ripple_line
from swgjoint.cli.shared.text import table
from swgjoint.files import Outputs, output_folder

SCENE = "ur5e-sweep"
DRIVES = {"bought": "size-25-100-bought", "coarse": "size-25-100-bought-coarse"}
"""Bundled designs that are compared; they differ in one tolerance."""
MODEL = "ring"
"""Fidelity of their maps, the fastest one that has play, errors and friction."""
FOLDER = "swgjoint-demo"
"""Default output folder."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the output folder."""
    parser.add_argument(
        "--out",
        metavar="DIR",
        default=FOLDER,
        help="write run.rrd, demo.png and report.html to this folder; default"
        f" ./{FOLDER}",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Build both maps and run the arm with each of them and with rigid joints.

    Returns:
        ``scene``, ``map`` (key figures of both maps), ``metrics`` (of the three runs,
        with ``tool_against_rigid`` and ``contains``), ``files`` (recording, picture,
        report), ``wall_s``.
    """
    start = time.perf_counter()
    folder = output_folder(args.out)
    from swgjoint.drives.references import load_drive
    from swgjoint.joint import plugin
    from swgjoint.sim.figures.metrics import against_rigid
    from swgjoint.sim.scene.scene import Scene
    from swgjoint.view.run import run_scene

    plugin.load()  # reports another MuJoCo before maps are built
    maps = {}
    for number, name in enumerate(DRIVES.values()):
        # the first line appears before the first result of a map, seconds later
        args.progress("drives", number, len(DRIVES))
        maps[name] = load_drive(name, model=MODEL, progress=args.progress)
    scene = Scene.load_file(SCENE)
    scenes = {label: scene.with_drive(drive) for label, drive in DRIVES.items()}
    scenes["rigid"] = next(iter(scenes.values())).with_level("rigid")
    runs = {
        label: run_scene(changed, drives=maps, name=label, progress=args.progress)
        for label, changed in scenes.items()
    }
    rigid = runs["rigid"]
    metrics = {
        label: {
            **result.metrics(),
            "tool_against_rigid": against_rigid(result, rigid),
            "contains": result.contains,
        }
        for label, result in runs.items()
    }
    files = _write(folder, runs, rigid, args.progress)
    return {
        "scene": scene.name,
        "map": {
            label: {
                "design": drive,
                "level": maps[drive].level,
                "stiffness_Nm_rad": maps[drive].mean_stiffness,
                "harmonics": len(maps[drive].orders) - 1,
                "torque_range_Nm": maps[drive].torque_range,
                "rated_torque_Nm": maps[drive].ratings.rated_torque,
                "info": dict(maps[drive].info),
            }
            for label, drive in DRIVES.items()
        },
        "metrics": metrics,
        "files": files,
        "wall_s": time.perf_counter() - start,
    }


def _write(folder: Path, runs: Any, rigid: Any, progress: Any) -> list[str]:
    from swgjoint.view.plots.runs import comparison_png
    from swgjoint.view.recording.recording import write_recording
    from swgjoint.view.report.report import write_report

    outputs, shown = Outputs(folder), {}

    def picture(path: Path) -> Path:
        comparison_png(runs, path, rigid=rigid)
        shown["Torsion, error, ripple, its orders and tool error"] = path.read_bytes()
        return path

    progress("recording and picture", 0, 2)
    outputs.hand_over("run.rrd", lambda path: write_recording(runs, path, rigid=rigid))
    progress("recording and picture", 1, 2)
    outputs.hand_over("demo.png", picture)
    progress("recording and picture", 2, 2)
    outputs.hand_over(
        "report.html",
        lambda path: write_report(runs, path, pictures=shown, progress=progress),
    )
    return outputs.files


def status(result: dict[str, Any]) -> int:
    """Return 1 if a run is not valid, else 0."""
    from swgjoint.sim.figures.verdict import VALID

    return int(any(m["verdict"] != VALID for m in result["metrics"].values()))


def report(result: dict[str, Any]) -> str:
    """Format tables of the drives, joints and tool, and the names of the files."""
    lines = []
    for label, item in result["map"].items():
        low, high = item["torque_range_Nm"]
        lines.append(
            f"{label}: {item['design']}, {item['level']} finite elements,"
            f" {item['stiffness_Nm_rad']:.4g} N·m/rad, {item['harmonics']} harmonics,"
            f" {low:.3g} to {high:.3g} N·m"
        )
    for label, metrics in result["metrics"].items():
        verdict, *reasons = verdict_lines(metrics)
        lines += ["", f"UR5e, {label}: {verdict}", *reasons]
        lines.append(joint_table(metrics["joints"]))
        lines += [*notes(metrics["joints"]), ripple_line(metrics)]
    rows = [
        (
            label,
            *[
                f"{metrics['tool_against_rigid'][key]:.4f}"
                for key in ("mean_mm", "rms_mm", "max_mm", "pp_mm")
            ],
            f"{metrics['steps_per_s']:.0f}",
        )
        for label, metrics in result["metrics"].items()
    ]
    header = ("", "mean", "rms", "largest", "pp at speed", "steps/s")
    lines += [
        "",
        "tool position relative to the rigid arm [mm]:",
        table(rows, header=header),
        "",
    ]
    lines += [f"wrote {path}" for path in result["files"]]
    watch = [
        f"; to replay the run: swgjoint view {f}"
        for f in result["files"]
        if ".rrd" in f
    ]
    lines += [f"{result['wall_s']:.1f} s{''.join(watch)}"]
    return "\n".join(lines)

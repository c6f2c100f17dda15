"""``swgjoint map``: from a design to a ``.swg`` file."""

from __future__ import annotations

import argparse
import time
from typing import Any

from swgjoint.cli.text import table
from swgjoint.files import check_output_file


def configure(parser: argparse.ArgumentParser) -> None:
    """Design, output file, model."""
    parser.add_argument("design", metavar="DESIGN", help="design file or bundled name")
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="map to write, .swg"
    )
    parser.add_argument(
        "--model",
        choices=("ring", "2d", "3d"),
        help="fidelity; default 3d for a design with a cup, else 2d",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Build the map (or take it from the cache) and save it.

    Returns:
        ``residual``, ``energy_check`` and ``harmonics`` of the map's record,
        ``stiffness_Nm_rad``, ``torque_range_Nm``, ``level``, ``files``, ``wall_s``.
    """
    start = time.perf_counter()
    path = check_output_file(args.output, ".swg")
    from swgjoint.gear.design import Design

    design = Design.load(args.design)
    # the finite elements take half a second to import: not before the design is sound
    from swgjoint.fe.build_map import build_map

    drive = build_map(design, model=args.model, progress=args.progress)
    drive.save(path)
    info = dict(drive.info)
    return {
        "design": drive.name,
        "level": drive.level,
        "residual": info.pop("residual", None),
        "energy_check": info.pop("energy_check", None),
        "harmonics": info.pop("harmonics", None)
        or [{"alpha": int(p), "beta": int(q)} for p, q in drive.orders],
        "stiffness_Nm_rad": drive.mean_stiffness,
        "torque_range_Nm": drive.torque_range,
        "info": info,
        "files": [str(path)],
        "wall_s": time.perf_counter() - start,
    }


def report(result: dict[str, Any]) -> str:
    """Key figures and where the file is."""
    low, high = result["torque_range_Nm"]
    rows = [
        ("level", result["level"]),
        ("harmonics", len(result["harmonics"])),
        ("stiffness to rated torque [N·m/rad]", result["stiffness_Nm_rad"]),
        ("sampled torque [N·m]", f"{low:.4g} to {high:.4g}"),
        *_flat("residual", result["residual"]),
        *_flat("energy check", result["energy_check"]),
        ("wall time [s]", result["wall_s"]),
    ]
    return f"map of {result['design']}: {result['files'][0]}\n{table(rows)}"


def _flat(name: str, value: Any) -> list[tuple[str, Any]]:
    if isinstance(value, dict):
        return [row for key, v in value.items() for row in _flat(f"{name} {key}", v)]
    return [] if value is None else [(name, value)]

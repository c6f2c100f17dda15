"""``swgjoint compare``: drives or levels side by side in one scene."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.text import table
from swgjoint.errors import InputError
from swgjoint.files import output_folder, write_whole
from swgjoint.json_text import json_text

COLUMNS = {
    "argument": "",
    "level": "level",
    "ripple_rms_percent": "ripple rms %",
    "ripple_pp_percent": "pp %",
    "transmission_error_arcmin": "trans. error pp arcmin",
    "K1_Nm_rad": "K1 N·m/rad",
    "von_mises_MPa": "von Mises MPa",
    "peak_torque_of_rating": "peak of rating",
    "wall_s": "s",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """What to compare, where, how to sort, what to ask for."""
    parser.add_argument(
        "arguments",
        metavar="A",
        nargs="+",
        help="designs, .swg maps, catalogue drives, or levels such as full",
    )
    parser.add_argument(
        "--scene", default="bench", help="scene file or bundled name; default bench"
    )
    parser.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="overrides",
        help="change a key of the scene; repeatable",
    )
    parser.add_argument("--model", choices=("ring", "2d", "3d"), help="of designs")
    parser.add_argument("--sort", metavar="KEY", help="best first by this figure")
    parser.add_argument(
        "--spec",
        metavar="FILE",
        help="TOML file with a table [spec] of limits; exit status 1 if one is missed",
    )
    parser.add_argument("--out", metavar="DIR", help="write compare.json and a picture")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the scene for every argument.

    Returns:
        ``scene``, ``rows``, ``spec``, ``passed`` (null without a spec), ``files``.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.sim.scene import Scene
    from swgjoint.study.compare import (
        LOWER,
        SORTABLE,
        compare,
        comparison_picture,
        read_spec,
    )

    if args.sort is not None and args.sort not in SORTABLE:
        raise InputError(f"--sort {args.sort}; accepted: {', '.join(SORTABLE)}")
    spec = read_spec(args.spec) if args.spec else None
    scene = Scene.load_file(args.scene, args.overrides)
    rows = compare(
        args.arguments, scene, model=args.model, spec=spec, progress=args.progress
    )
    if args.sort is not None:
        sign = -1.0 if args.sort in LOWER else 1.0
        known = [row for row in rows if getattr(row, args.sort) is not None]
        known.sort(key=lambda row: sign * float(getattr(row, args.sort)))
        rows = known + [row for row in rows if row not in known]
    result: dict[str, Any] = {
        "scene": scene.name,
        "rows": [row.to_json() for row in rows],
        "spec": spec,
        "passed": None if spec is None else not any(row.missed for row in rows),
        "files": [],
    }
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        picture = comparison_picture(rows, scene.name)
        result["files"] = [
            str(write_whole(folder / "compare.png", picture)),
            str(write_whole(folder / "compare.json", json_text(result) + "\n")),
        ]
    return result


def status(result: dict[str, Any]) -> int:
    """1 where a limit of the spec is missed."""
    return int(result["passed"] is False)


def report(result: dict[str, Any]) -> str:
    """One line an argument, then what misses the spec."""
    rows = [[row[key] for key in COLUMNS] for row in result["rows"]]
    lines = [
        f"scene {result['scene']}, worst joint",
        table(rows, header=tuple(COLUMNS.values())),
    ]
    for row in result["rows"]:
        for key in row["missed"]:
            value = row[key]
            told = "not told" if value is None else f"{value:.4g}"
            limit = result["spec"][key]
            lines.append(f"{row['argument']}: {key} {told}, limit {limit:g}")
    if result["passed"]:
        lines.append("every limit of the spec is kept")
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])

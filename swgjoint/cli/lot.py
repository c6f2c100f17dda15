"""``swgjoint lot``: accuracy, ripple and yield of a production lot."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.text import table
from swgjoint.csv_text import csv_text
from swgjoint.errors import InputError
from swgjoint.files import Outputs, output_folder

MAX_DRIVES = 100_000
MAX_JOBS = 256


def configure(parser: argparse.ArgumentParser) -> None:
    """Design, number of drives, how errors are drawn, spec, output folder."""
    parser.add_argument(
        "design", metavar="DESIGN", help="design with a [tolerances] table"
    )
    parser.add_argument(
        "--drives", type=int, default=500, metavar="N", help="default %(default)s"
    )
    parser.add_argument(
        "--sizes",
        choices=("limit", "uniform"),
        default="limit",
        help="limit: errors as large as the tolerances (worst case, default);"
        " uniform: errors drawn between zero and the tolerances",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        help="seed of the first drive; default %(default)s",
    )
    parser.add_argument(
        "--spec",
        metavar="FILE",
        help="TOML file with a table [spec] of limits: transmission_accuracy_arcmin,"
        " ripple_rms_percent, torsional_stiffness_Nm_rad",
    )
    parser.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="processes; default 2"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="write lot.json, lot.csv and lot.png there"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Draw and solve the drives.

    Returns:
        See :func:`swgjoint.explore.lot.run_lot`, and ``files``.
    """
    for name, value, most in (
        ("drives", args.drives, MAX_DRIVES),
        ("jobs", args.jobs, MAX_JOBS),
        ("seed", args.seed, 2**31 - 1 - max(args.drives, 0)),
    ):
        if not 1 <= value <= most:
            raise InputError(f"--{name} {value}; accepted: 1 to {most}")
    folder = output_folder(args.out) if args.out else None
    from swgjoint.explore.compare.compare import read_spec
    from swgjoint.explore.lot import FIGURES, LOWER, run_lot
    from swgjoint.gear.design.design import Design
    from swgjoint.view.plots.lot import lot_picture

    spec = read_spec(args.spec, FIGURES) if args.spec else None
    result = run_lot(
        Design.load(args.design),
        count=args.drives,
        seed=args.seed,
        sizes=args.sizes,
        spec=spec,
        jobs=args.jobs,
        progress=args.progress,
    )
    result = {**result, "files": []}
    if folder is not None:
        outputs = Outputs(folder)
        outputs.write("lot.csv", lambda: csv_text(result["rows"]))
        outputs.write("lot.png", lambda: lot_picture(result, lower=LOWER))
        outputs.write_json("lot.json", result)
    return result


def report(result: dict[str, Any]) -> str:
    """Percentiles of every figure, then the yield."""
    columns = ("p1", "p5", "p50", "p95", "p99", "mean", "std")
    rows = [
        [key, *(found[column] for column in columns)]
        for key, found in result["figures"].items()
        if found is not None
    ]
    count = len(result["rows"])
    lines = [table(rows, header=("", *columns)), ""] if rows else []
    if result["failed"]:
        lines.append(f"{result['failed']} of {count} drives have no equilibrium")
    off = result["validity"]["superposition_error"]
    told = "unknown" if off is None else f"{100.0 * off:.1f} % of its peak to peak"
    lines.append(f"error of the superposition, first drive against full solves: {told}")
    if result["yield"] is not None:
        found = result["yield"]
        lines.append(f"yield: {_share(found)} of {count} drives, {result['sizes']}")
        lines += [
            f"  {key} {result['spec'][key]:g} alone: {_share(one)}"
            for key, one in found["by_limit"].items()
        ]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*lines, f"{result['wall_s']:.0f} s"])


def _share(found: dict[str, Any]) -> str:
    low, high = 100.0 * found["low"], 100.0 * found["high"]
    return f"{100.0 * found['part']:.1f} % ({low:.1f} to {high:.1f})"

"""``swgjoint bench``: error against run time."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.text import table
from swgjoint.files import output_folder


def configure(parser: argparse.ArgumentParser) -> None:
    """Part, design, output folder."""
    parser.add_argument(
        "part",
        nargs="?",
        choices=("fe",),
        default="fe",
        help="fe: finite elements in the plane and in space, coarse to fine",
    )
    parser.add_argument(
        "--design",
        metavar="DESIGN",
        default="reference-3d-modified",
        help="with a cup; default %(default)s",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="write the table and the picture there"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the benchmark.

    Returns:
        See :func:`swgjoint.study.fe_cost.run_fe_cost`.
    """
    folder = output_folder(args.out) if args.out else None
    from swgjoint.gear.design import Design

    design = Design.load(args.design)
    from swgjoint.study.fe_cost import run_fe_cost

    return run_fe_cost(design=design, folder=folder, progress=args.progress)


def report(result: dict[str, Any]) -> str:
    """One line a setting: time, then value and error of every quantity."""
    rows = result["rows"]
    quantities = list(dict.fromkeys(row["quantity"] for row in rows))
    units = {row["quantity"]: row["unit"] for row in rows}
    lines: dict[tuple[str, str], list[Any]] = {}
    for row in rows:
        line = lines.setdefault(
            (row["model"], row["setting"]), [row["wall_s"], row["outcome"]]
        )
        line += [row["value"], row["error"]]
    header = ["model", "setting", "s"]
    for quantity in quantities:
        header += [quantity, f"error {units[quantity]}"]
    body = [
        (*key, wall, *values)
        if values[0] is not None
        else (*key, outcome, *[None] * (2 * len(quantities)))
        for key, (wall, outcome, *values) in lines.items()
    ]
    text = [
        f"{result['design']} against {rows[0]['reference']}",
        table(body, header=tuple(header)),
    ]
    text += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*text, f"{result['wall_s']:.0f} s"])

"""``swgjoint stability``: numerical stability of stiff and extreme joints."""

from __future__ import annotations

import argparse
from typing import Any

from swgjoint.cli.shared.common_options import add_jobs, check_jobs
from swgjoint.cli.shared.text import table
from swgjoint.files import output_folder


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: size of the grid, processes, output folder."""
    parser.add_argument(
        "--full",
        action="store_true",
        help="run the whole grid of stiffnesses, inertias and steps instead of a part",
    )
    add_jobs(parser)
    parser.add_argument(
        "--out", metavar="DIR", help="write the table and the plot to this folder"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the study.

    Returns:
        The result of :func:`swgjoint.bench.stability.stability.run_stability`.

    Raises:
        InputError: If ``--jobs`` is out of range.
    """
    check_jobs(args.jobs)
    folder = output_folder(args.out) if args.out else None
    from swgjoint.bench.stability.stability import run_stability

    return run_stability(
        full=args.full, jobs=args.jobs, folder=folder, progress=args.progress
    )


def report(result: dict[str, Any]) -> str:
    """Format the number of outcomes by situation and scheme, then a summary."""
    from swgjoint.bench.stability.rows import OUTCOMES
    from swgjoint.bench.stability.stability import summary

    rows = [
        [name, *(count.get(outcome, 0) for outcome in OUTCOMES)]
        for name, count in result["counts"].items()
    ]
    lines = [table(rows, header=("situation: scheme", *OUTCOMES)), ""]
    lines += summary(result)
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*lines, f"{result['wall_s']:.0f} s"])


def status(result: dict[str, Any]) -> int:
    """Return 1 if a run failed without reporting it, else 0."""
    return int(bool(result["unexplained"]))

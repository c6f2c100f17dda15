"""``swgjoint sweep``: evaluate many designs and store each result."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.places import configure_places, places_of
from swgjoint.cli.shared.text import short_headers, table
from swgjoint.cli.shared.validity_text import validity_lines
from swgjoint.csv_text import csv_text
from swgjoint.json_text import json_text

if TYPE_CHECKING:
    from swgjoint.explore.sweep.results import ResultStore
    from swgjoint.explore.sweep.sweep import SweepResult

SHOWN = 40
"""Largest number of rows of the table in the terminal."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: sweep file, executor, store of the results."""
    parser.epilog = "Repeat the same command to resume an interrupted sweep."
    parser.add_argument("file", metavar="FILE", help="sweep file or bundled name")
    configure_places(
        parser,
        out="store the results in this folder, and write sweep.csv, sweep.parquet,"
        " sweep.png and sweep.json",
    )
    parser.add_argument(
        "--retry-failed",
        action="store_true",
        help="recompute designs that failed in an earlier run; designs whose process"
        " was terminated are always recomputed",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Compute the designs whose results are not stored yet.

    Returns:
        Numbers of designs: ``designs`` (all), ``done`` (with figures), ``failed``
        (without figures), ``reused`` (stored by earlier runs, failed or not) and
        ``computed`` (in this run). Also ``workers``, ``work_s``, ``wall_s``,
        ``efficiency`` (work divided by wall time and workers), ``parameters``,
        ``figures``, ``validity`` (by task), ``rows``, ``files``.
    """
    from swgjoint.explore.sweep.file import SweepFile
    from swgjoint.explore.sweep.sweep import run_sweep

    place, executor_of = places_of(args)
    file = SweepFile.load(args.file)
    with executor_of(file) as executor:
        outcome = run_sweep(
            file,
            executor=executor,
            place=place,
            retry_failed=args.retry_failed,
            progress=args.progress,
        )
    result = {"sweep": args.file, **outcome.to_json(), "files": []}
    if args.out is not None and place is not None:
        result["files"] = _write(place, outcome, result)
    return result


def _write(
    place: ResultStore, outcome: SweepResult, result: dict[str, Any]
) -> list[str]:
    """Write the tables with one row per design, a plot and JSON."""
    from swgjoint.explore.sweep.results import parquet_bytes, write_to
    from swgjoint.view.plots.sweep import sweep_picture

    rows = outcome.rows()
    files = write_to(
        place,
        {
            "sweep.csv": csv_text(rows).encode,
            "sweep.parquet": lambda: parquet_bytes(rows),
            "sweep.png": lambda: sweep_picture(outcome),
        },
    )
    last = "sweep.json"  # written last, because it lists the other files
    content = {**result, "files": [*files, place.path_of(last)]}
    return files + write_to(place, {last: (json_text(content) + "\n").encode})


def status(result: dict[str, Any]) -> int:
    """Return 1 if no design has figures, else 0; single failures are only reported."""
    return int(result["done"] == 0)


def report(result: dict[str, Any]) -> str:
    """Format one line per design, ranges, failures with reasons, and the counts."""
    names = [*result["parameters"], *result["figures"]]
    rows = result["rows"]
    shown = rows if len(rows) <= SHOWN else rows[: SHOWN - 1]
    lines = [
        table(
            [
                (
                    k + 1,
                    *(_short(row[name]) for name in names),
                    row["outcome"],
                    row["work_s"],
                )
                for k, row in enumerate(shown)
            ],
            header=("", *short_headers(names), "outcome", "work [s]"),
        )
    ]
    if len(shown) < len(rows):
        lines.append(
            f"... and {len(rows) - len(shown)} more rows; --out DIR writes all of them"
        )
    lines += _ranges(result)
    reasons: dict[str, list[int]] = {}
    for k, row in enumerate(rows):
        if row["reason"]:
            reasons.setdefault(f"{row['outcome']}: {row['reason']}", []).append(k + 1)
    for reason, numbers in list(reasons.items())[:SHOWN]:
        more = ", ..." if len(numbers) > 8 else ""
        lines.append(f"{', '.join(map(str, numbers[:8]))}{more}: {reason}")
    lines += validity_lines(result["validity"])
    share = result["efficiency"]
    busy = ""
    if share is not None:
        busy = (
            f"; {result['workers']} workers were busy {100 * share:.0f} % of the time"
        )
    lines.append(
        f"{result['done']} designs done, {result['failed']} failed; {result['reused']}"
        f" of them reused, {result['computed']} computed in {result['wall_s']:.1f} s"
        + busy
    )
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])


def _short(value: Any) -> Any:
    return f"{value[:21]}..." if isinstance(value, str) and len(value) > 24 else value


def _ranges(result: dict[str, Any]) -> list[str]:
    """Format the smallest and largest value of every figure with their rows."""
    ranges = []
    for name in result["figures"]:
        values = [(r[name], k + 1) for k, r in enumerate(result["rows"])]
        numbers = [(v, k) for v, k in values if v is not None]
        if len(numbers) > 1:
            (low, at_low), (high, at_high) = min(numbers), max(numbers)
            ranges.append((name, low, at_low, high, at_high))
    header = ("", "smallest", "in row", "largest", "in row")
    return ["", table(ranges, header=header), ""] if ranges else []

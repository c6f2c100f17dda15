"""``swgjoint sweep``: evaluate many designs and keep each result."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from swgjoint.cli.shared.places import configure_places, places_of
from swgjoint.cli.shared.text import short_headers, table
from swgjoint.csv_text import csv_text
from swgjoint.json_text import json_text

if TYPE_CHECKING:
    from swgjoint.explore.sweep.results import ResultStore
    from swgjoint.explore.sweep.sweep import SweepResult

SHOWN = 40
"""Rows of the table in the terminal."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Sweep file, where it is computed, where results are kept."""
    parser.epilog = "Repeat the same command to resume an interrupted sweep."
    parser.add_argument("file", metavar="FILE", help="sweep file or bundled name")
    configure_places(
        parser,
        out="keep results there, with sweep.csv, sweep.parquet, sweep.png and"
        " sweep.json",
    )
    parser.add_argument(
        "--retry-failed",
        action="store_true",
        help="recompute designs that failed in an earlier run; designs lost with a"
        " terminated process are always recomputed",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Compute what is not kept yet.

    Returns:
        ``designs``, ``done`` (with figures), ``failed`` (without), ``reused`` (of
        both, kept from earlier runs), ``computed`` in this run, ``workers``,
        ``work_s``, ``wall_s``, ``efficiency`` (work over wall time and workers),
        ``parameters``, ``figures``, ``validity`` (by task), ``rows``, ``files``.
    """
    from swgjoint.explore.sweep.file import SweepFile
    from swgjoint.explore.sweep.sweep import run_sweep

    place, executor_of = places_of(args)
    file = SweepFile.load(args.file)
    with executor_of(file) as executor:
        found = run_sweep(
            file,
            executor=executor,
            place=place,
            retry_failed=args.retry_failed,
            progress=args.progress,
        )
    result = {"sweep": args.file, **found.to_json(), "files": []}
    if args.out is not None and place is not None:
        result["files"] = _write(place, found, result)
    return result


def _write(place: ResultStore, found: SweepResult, result: dict[str, Any]) -> list[str]:
    """One row a design as tables, the picture, and the whole as JSON."""
    from swgjoint.explore.sweep.results import parquet_bytes, write_to
    from swgjoint.view.plots.sweep import sweep_picture

    rows = found.rows()
    files = write_to(
        place,
        {
            "sweep.csv": csv_text(rows).encode,
            "sweep.parquet": lambda: parquet_bytes(rows),
            "sweep.png": lambda: sweep_picture(found),
        },
    )
    last = "sweep.json"  # which names them all
    content = {**result, "files": [*files, place.path_of(last)]}
    return files + write_to(place, {last: (json_text(content) + "\n").encode})


def status(result: dict[str, Any]) -> int:
    """1 where no design at all has figures; single failures are rows."""
    return int(result["done"] == 0)


def report(result: dict[str, Any]) -> str:
    """One line a design, failures with their reason, then the counts."""
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
        lines.append(f"... and {len(rows) - len(shown)} more, all with --out DIR")
    lines += _ranges(result)
    reasons: dict[str, list[int]] = {}
    for k, row in enumerate(rows):
        if row["reason"]:
            reasons.setdefault(f"{row['outcome']}: {row['reason']}", []).append(k + 1)
    for reason, numbers in list(reasons.items())[:SHOWN]:
        more = ", ..." if len(numbers) > 8 else ""
        lines.append(f"{', '.join(map(str, numbers[:8]))}{more}: {reason}")
    for task, label in result["validity"].items():
        absent = [f"{part}: {what}" for part, what in label["not_modelled"].items()]
        told = "; ".join([f"level {label['level']}, {label['torque']}", *absent])
        lines.append(f"validity of {task}: {told}")
    share = result["efficiency"]
    busy = "" if share is None else f", {100 * share:.0f} % of {result['workers']} busy"
    lines.append(
        f"{result['done']} designs done, {result['failed']} failed; {result['reused']}"
        f" of them reused, {result['computed']} computed in {result['wall_s']:.1f} s"
        + busy
    )
    return "\n".join([*lines, *(f"wrote {name}" for name in result["files"])])


def _short(value: Any) -> Any:
    return f"{value[:21]}..." if isinstance(value, str) and len(value) > 24 else value


def _ranges(result: dict[str, Any]) -> list[str]:
    """Least and largest value of every figure, and the rows that have them."""
    found = []
    for name in result["figures"]:
        values = [(r[name], k + 1) for k, r in enumerate(result["rows"])]
        numbers = [(v, k) for v, k in values if v is not None]
        if len(numbers) > 1:
            (low, at_low), (high, at_high) = min(numbers), max(numbers)
            found.append((name, low, at_low, high, at_high))
    header = ("", "least", "in row", "largest", "in row")
    return ["", table(found, header=header), ""] if found else []

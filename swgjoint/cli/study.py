"""``swgjoint study``: our values beside those of a source."""

from __future__ import annotations

import argparse
import time
from importlib import import_module
from typing import Any

from swgjoint.cli.text import table
from swgjoint.errors import InputError
from swgjoint.files import output_folder

STUDIES = {
    "thesis": (
        "swgjoint.study.thesis:run_thesis",
        "stresses of the thesis, chapters 4 to 6, with the 2D model",
    ),
    "ring": (
        "swgjoint.study.ring:run_ring",
        "deflection of a plain ring between two rollers, thesis appendix A",
    ),
    "articles": (
        "swgjoint.study.articles:run_articles",
        "force, deflection, stress and fatigue of three articles, with the 3D model",
    ),
    "catalogue": (
        "swgjoint.study.catalogue:run_catalogue",
        "stiffness, losses and ratcheting of a family of drives beside a catalogue",
    ),
    "response": (
        "swgjoint.study.response:run_response",
        "two-mass frequency response of a joint beside its closed form",
    ),
    "control": (
        "swgjoint.study.control_ladder:run_control",
        "controllers of one joint from PD to learning, on ten specimens of a drive",
    ),
}
"""Name -> function that takes a StudyOptions and returns a StudyResult, and what it
compares; imported only when chosen."""

MAX_JOBS = 256


def configure(parser: argparse.ArgumentParser) -> None:
    """Study, its parts, processes, output folder."""
    listing = "; ".join(f"{name}: {text}" for name, (_, text) in STUDIES.items())
    parser.add_argument("name", metavar="NAME", choices=STUDIES, help=listing)
    parser.add_argument(
        "--only",
        metavar="PART,...",
        help="run these sections or tables of the source; response and control:"
        " these drives",
    )
    parser.add_argument(
        "--model", choices=("2d", "3d"), help="fidelity; default: that of the study"
    )
    parser.add_argument(
        "--jobs", type=int, default=2, metavar="N", help="processes; default 2"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="write the tables, the report and the plots there"
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the study.

    Returns:
        ``study``, ``rows`` (each with ``case``, ``quantity``, ``unit``,
        ``source_value``, ``ours``, ``converged``, ``reason`` and the study's own
        columns), the study's own keys, ``summary``, ``files``, ``wall_s``.
    """
    start = time.perf_counter()
    if not 1 <= args.jobs <= MAX_JOBS:
        raise InputError(f"--jobs {args.jobs}; accepted: 1 to {MAX_JOBS}")
    folder = output_folder(args.out) if args.out else None
    from swgjoint.study.rows import StudyOptions

    module, _, function = STUDIES[args.name][0].partition(":")
    found = getattr(import_module(module), function)(
        StudyOptions(
            only=tuple(p.strip() for p in (args.only or "").split(",") if p.strip()),
            model=args.model,
            jobs=args.jobs,
            folder=folder,
            progress=args.progress,
        )
    )
    return {
        "study": args.name,
        "rows": [row.to_json() for row in found.rows],
        **found.more,
        "summary": list(found.summary),
        "files": list(found.files),
        "wall_s": time.perf_counter() - start,
    }


def report(result: dict[str, Any]) -> str:
    """All rows, then what they add up to."""
    keys = ("case", "quantity", "unit", "source_value", "ours", "converged")
    header = ("case", "quantity", "unit", "source", "ours", "converged")
    rows = [[row[key] for key in keys] for row in result["rows"]]
    lines = [table(rows, header=header), "", *result["summary"]]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*lines, f"{result['wall_s']:.0f} s"])

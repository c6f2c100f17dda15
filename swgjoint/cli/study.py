"""``swgjoint study``: compare swgjoint with published values."""

from __future__ import annotations

import argparse
import time
from typing import Any

from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.files import output_folder
from swgjoint.validation.runner import STUDIES, run_study

MAX_JOBS = 256
LEAST_INERTIA, MOST_INERTIA = 1e-9, 1e6
"""Of a rotor or a load [kg·m²]."""
MAX_SEEDS = 10_000


def configure(parser: argparse.ArgumentParser) -> None:
    """Study, its parts, processes, output folder."""
    listing = "; ".join(f"{name}: {study.title}" for name, study in STUDIES.items())
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
        "--load-inertia",
        type=float,
        metavar="KGM2",
        help="response: of the load about the output [kg·m²]; default: the rotor's,"
        " seen from there",
    )
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        metavar="KGM2",
        help="response: of motor rotor and wave generator about the input [kg·m²];"
        " default 1e-4",
    )
    parser.add_argument(
        "--closed-form",
        action="store_true",
        help="response: frequencies from stiffness and inertias alone, at once",
    )
    parser.add_argument(
        "--seeds",
        type=int,
        metavar="N",
        help="control: specimens of a drive; default 10, a minute each",
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
    _check_response_options(args)
    if args.seeds is not None and args.name != "control":
        raise InputError(
            f"--seeds {args.seeds} of study {args.name}, which draws no specimens;"
            " accepted: with study control"
        )
    if args.seeds is not None and not 1 <= args.seeds <= MAX_SEEDS:
        raise InputError(f"--seeds {args.seeds}; accepted: 1 to {MAX_SEEDS}")
    folder = output_folder(args.out) if args.out else None
    from swgjoint.validation.rows import StudyOptions

    found = run_study(
        args.name,
        StudyOptions(
            only=tuple(p.strip() for p in (args.only or "").split(",") if p.strip()),
            model=args.model,
            jobs=args.jobs,
            seeds=args.seeds,
            folder=folder,
            load_inertia=args.load_inertia,
            rotor_inertia=args.rotor_inertia,
            closed_form=args.closed_form,
            progress=args.progress,
        ),
    )
    return {
        "study": args.name,
        "rows": [row.to_json() for row in found.rows],
        **found.more,
        "summary": list(found.summary),
        "files": list(found.files),
        "wall_s": time.perf_counter() - start,
    }


def _check_response_options(args: argparse.Namespace) -> None:
    """Inertias are positive, and options of the response belong to it."""
    given = {
        "load-inertia": args.load_inertia,
        "rotor-inertia": args.rotor_inertia,
        "closed-form": args.closed_form or None,
    }
    named = [key for key, value in given.items() if value is not None]
    if named and args.name != "response":
        raise InputError(f"--{named[0]} with {args.name}; accepted: with response")
    for key in named:
        value = given[key]
        if value is not True and not LEAST_INERTIA <= value <= MOST_INERTIA:
            raise InputError(
                f"--{key} {value:g} kg·m²; accepted: {LEAST_INERTIA:g} to"
                f" {MOST_INERTIA:g} kg·m²"
            )


def report(result: dict[str, Any]) -> str:
    """All rows, then what they add up to."""
    keys = ("case", "quantity", "unit", "source_value", "ours", "converged")
    header = ("case", "quantity", "unit", "source", "ours", "converged")
    rows = [[row[key] for key in keys] for row in result["rows"]]
    lines = [table(rows, header=header), "", *result["summary"]]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*lines, f"{result['wall_s']:.0f} s"])

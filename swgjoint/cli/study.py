"""``swgjoint study``: compare swgjoint with published values."""

from __future__ import annotations

import argparse
import time
from typing import Any

from swgjoint.cli.shared.common_options import add_jobs, check_jobs
from swgjoint.cli.shared.text import table
from swgjoint.errors import InputError
from swgjoint.files import output_folder
from swgjoint.validation.runner import STUDIES, run_study

LEAST_INERTIA, MOST_INERTIA = 1e-9, 1e6
"""Bounds on the inertia of a rotor or a load [kg·m²]."""
MAX_SEEDS = 10_000


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: study, parts, options of single studies, output folder."""
    listing = "; ".join(f"{name}: {study.title}" for name, study in STUDIES.items())
    parser.epilog = (
        "The thesis is E. Yague-Spaude, Computational Design, Simulation of Meshing,"
        " and Stress Analysis of Strain Wave Gear Drives, Rochester Institute of"
        " Technology, 2021."
    )
    parser.add_argument("name", metavar="NAME", choices=STUDIES, help=listing)
    parser.add_argument(
        "--only",
        metavar="PART,...",
        help="run only these sections or tables of the source; for response and"
        " control: only these drives",
    )
    parser.add_argument(
        "--model",
        choices=("2d", "3d"),
        help="fidelity; the default depends on the study",
    )
    add_jobs(parser)
    parser.add_argument(
        "--load-inertia",
        type=float,
        metavar="KGM2",
        help="response: inertia of the load about the output [kg·m²]; default: inertia"
        " of the rotor reflected to the output",
    )
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        metavar="KGM2",
        help="response: inertia of motor rotor and wave generator about the input"
        " [kg·m²]; default: 1e-4",
    )
    parser.add_argument(
        "--closed-form",
        action="store_true",
        help="response: only compute the frequencies in closed form from stiffness and"
        " inertias, without simulation",
    )
    parser.add_argument(
        "--seeds",
        type=int,
        metavar="N",
        help="control: number of specimens of each drive; default: 10, a minute each",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write the tables, the report and the plots to this folder",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Run the study.

    Returns:
        ``study``, ``rows`` (each with ``case``, ``quantity``, ``unit``,
        ``source_value``, ``ours``, ``converged``, ``reason`` and columns of the single
        study), keys of the single study, ``summary``, ``files``, ``wall_s``.

    Raises:
        InputError: If an option is out of range or does not apply to the study.
    """
    start = time.perf_counter()
    check_jobs(args.jobs)
    _check_response_options(args)
    if args.seeds is not None and args.name != "control":
        raise InputError(
            f"--seeds {args.seeds} does not apply to study {args.name}, which draws no"
            " specimens; accepted with study control"
        )
    if args.seeds is not None and not 1 <= args.seeds <= MAX_SEEDS:
        raise InputError(f"--seeds {args.seeds}; accepted: 1 to {MAX_SEEDS}")
    folder = output_folder(args.out) if args.out else None
    from swgjoint.validation.rows import StudyOptions

    study = run_study(
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
        "rows": [row.to_json() for row in study.rows],
        **study.more,
        "summary": list(study.summary),
        "files": list(study.files),
        "wall_s": time.perf_counter() - start,
    }


def _check_response_options(args: argparse.Namespace) -> None:
    """Check that options of ``response`` are used with it and are in range."""
    options = {
        "load-inertia": args.load_inertia,
        "rotor-inertia": args.rotor_inertia,
        "closed-form": args.closed_form or None,
    }
    named = [key for key, value in options.items() if value is not None]
    if named and args.name != "response":
        raise InputError(
            f"--{named[0]} does not apply to study {args.name}; accepted with study"
            " response"
        )
    for key in named:
        value = options[key]
        if value is not True and not LEAST_INERTIA <= value <= MOST_INERTIA:
            raise InputError(
                f"--{key} {value:g} kg·m²; accepted: {LEAST_INERTIA:g} to"
                f" {MOST_INERTIA:g} kg·m²"
            )


def report(result: dict[str, Any]) -> str:
    """Format all rows, then the summary."""
    keys = ("case", "quantity", "unit", "source_value", "ours", "converged")
    header = ("case", "quantity", "unit", "source", "swgjoint", "converged")
    rows = [[row[key] for key in keys] for row in result["rows"]]
    lines = [table(rows, header=header), "", *result["summary"]]
    lines += [f"wrote {name}" for name in result["files"]]
    return "\n".join([*lines, f"{result['wall_s']:.0f} s"])

"""Arguments that several commands share: drive, fidelity, number of processes."""

from __future__ import annotations

import argparse

from swgjoint.errors import InputError

MAX_JOBS = 256
"""Largest accepted number of processes."""


def add_drive(parser: argparse.ArgumentParser) -> None:
    """Add the argument ``drive``: a map, a design or a catalogue drive."""
    parser.add_argument(
        "drive",
        metavar="FILE|DESIGN|NAME",
        help="map (.swg), design file, bundled name, or catalogue name (CSG-25-100)",
    )


def add_model(parser: argparse.ArgumentParser, of: str) -> None:
    """Add ``--model``.

    Args:
        parser: Parser of the command.
        of: What has the fidelity, for the help text.
    """
    parser.add_argument(
        "--model",
        choices=("ring", "2d", "3d"),
        help=f"fidelity of {of}: ring (thin ring, fastest), 2d or 3d (finite"
        " elements); default: 3d for a design with a cup, else 2d",
    )


def add_jobs(parser: argparse.ArgumentParser) -> None:
    """Add ``--jobs``."""
    parser.add_argument(
        "--jobs",
        type=int,
        default=2,
        metavar="N",
        help="number of processes; default: 2",
    )


def check_jobs(jobs: int) -> None:
    """Check the value of ``--jobs``.

    Raises:
        InputError: If it is out of range.
    """
    if not 1 <= jobs <= MAX_JOBS:
        raise InputError(f"--jobs {jobs}; accepted: 1 to {MAX_JOBS}")

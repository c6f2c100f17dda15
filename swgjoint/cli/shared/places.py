"""Options that select where designs are computed and where results are stored."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import TYPE_CHECKING

from swgjoint.errors import InputError

if TYPE_CHECKING:
    from swgjoint.explore.sweep.results import ResultStore
    from swgjoint.explore.sweep.tasks import AskedFile
    from swgjoint.pool import Executor

MAX_JOBS = 1024
"""Largest accepted number of processes."""


def configure_places(parser: argparse.ArgumentParser, *, out: str) -> None:
    """Add the options ``--jobs``, ``--scheduler`` and ``--out``.

    Args:
        parser: Parser that receives the options.
        out: Help text for ``--out``: what the folder receives.
    """
    parser.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="number of processes on this machine; default: number of cores, or the"
        " [cluster] table of FILE",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="compute on the workers of a dask scheduler, given as an address such as"
        " tcp://host:8786 or as a scheduler file (.json)",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help=f"{out}; a folder or any fsspec address (s3://...); default: store results"
        " in the user's cache and write no files",
    )


def places_of(
    args: argparse.Namespace,
) -> tuple[ResultStore | None, Callable[[AskedFile], AbstractContextManager[Executor]]]:
    """Interpret the options of :func:`configure_places`.

    Args:
        args: Parsed arguments.

    Returns:
        Store of the results (None if there is neither ``--out`` nor a cache), and a
        function that opens the executor for a sweep or optimisation file.

    Raises:
        InputError: If ``--jobs`` is out of range or combined with ``--scheduler``.
    """
    if args.jobs is not None and not 1 <= args.jobs <= MAX_JOBS:
        raise InputError(f"--jobs {args.jobs}; accepted: 1 to {MAX_JOBS}")
    if args.jobs is not None and args.scheduler is not None:
        raise InputError("--jobs together with --scheduler; accepted: only one of them")
    from swgjoint.explore.sweep.executor import chosen_executor
    from swgjoint.explore.sweep.results import place_of
    from swgjoint.store import cache_folder

    kept = args.out
    if kept is None and (cache := cache_folder()) is not None:
        kept = str(cache / "sweeps")
    place = None if kept is None else place_of(kept)
    return place, partial(chosen_executor, jobs=args.jobs, scheduler=args.scheduler)

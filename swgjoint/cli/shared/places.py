"""Where many designs are computed, and where what comes of them is kept."""

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


def configure_places(parser: argparse.ArgumentParser, *, out: str) -> None:
    """Processes or scheduler, and the folder; ``out`` says what that receives."""
    parser.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="processes of this machine; default: its cores, or the [cluster] of FILE",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="compute on the workers of a dask scheduler, such as tcp://host:8786, or"
        " of a scheduler file (.json)",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help=f"{out}: a folder or any fsspec address (s3://...); default: results in"
        " the user's cache, no files",
    )


def places_of(
    args: argparse.Namespace,
) -> tuple[ResultStore | None, Callable[[AskedFile], AbstractContextManager[Executor]]]:
    """Where records are kept, and what computes the designs of a file.

    Raises:
        InputError: If the options are not accepted.
    """
    if args.jobs is not None and not 1 <= args.jobs <= MAX_JOBS:
        raise InputError(f"--jobs {args.jobs}; accepted: 1 to {MAX_JOBS}")
    if args.jobs is not None and args.scheduler is not None:
        raise InputError("--jobs and --scheduler; accepted: one of them")
    from swgjoint.explore.sweep.executor import chosen_executor
    from swgjoint.explore.sweep.results import place_of
    from swgjoint.store import cache_folder

    kept = args.out
    if kept is None and (cache := cache_folder()) is not None:
        kept = str(cache / "sweeps")
    place = None if kept is None else place_of(kept)
    return place, partial(chosen_executor, jobs=args.jobs, scheduler=args.scheduler)

"""Independent runs on several processes, one thread of linear algebra each."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

from swgjoint.progress import Progress, silent

Task = TypeVar("Task")
Found = TypeVar("Found")

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def run_all(
    function: Callable[[Task], Found],
    tasks: Sequence[Task],
    *,
    jobs: int = 1,
    stage: str = "runs",
    progress: Progress = silent,
) -> list[Found]:
    """Results in the order of the tasks, which are started in that order too.

    Args:
        function: Picklable; called in a fresh process (spawn) unless ``jobs`` is 1.
        tasks: Put long ones first.
        jobs: Processes.
        stage: Name for the progress.
        progress: Called first of all and after every task.
    """
    found: dict[int, Found] = {}
    progress(stage, 0, len(tasks))
    if jobs == 1 or len(tasks) < 2:
        for k, task in enumerate(tasks):
            found[k] = function(task)
            progress(stage, k + 1, len(tasks))
        return [found[k] for k in range(len(tasks))]
    with ProcessPoolExecutor(
        max_workers=min(jobs, len(tasks)),
        mp_context=get_context("spawn"),
        initializer=_one_thread,
    ) as pool:
        futures = {pool.submit(function, task): k for k, task in enumerate(tasks)}
        try:
            for done, future in enumerate(as_completed(futures), start=1):
                found[futures[future]] = future.result()
                progress(stage, done, len(tasks))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [found[k] for k in range(len(tasks))]


def _one_thread() -> None:
    """Small dense products gain nothing from threads that fight for the cores."""
    for name in _THREADS:
        os.environ[name] = "1"

"""Run independent tasks in parallel processes with one linear-algebra thread each."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any, Protocol, TypeVar

from swgjoint.errors import ComputationError
from swgjoint.memory import keep_freed_memory
from swgjoint.progress import Progress, silent

CACHE = "SWGJOINT_CACHE"
"""Environment variable that names the cache folder."""
WATCH_S = 1.0
"""Interval at which a worker checks that its parent is alive [s]."""

Task = TypeVar("Task")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Lost:
    """Placeholder for the result of a task whose process died at both attempts."""

    reason: str
    """Explanation for messages."""


class Executor(Protocol):
    """Object that runs tasks in parallel."""

    @property
    def workers(self) -> int:
        """Number of processes that compute at the same time."""

    def run(
        self, function: Callable[[Task], Found], tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Found | Lost]]:
        """Yield every task with its result, in the order of completion.

        Args:
            function: Picklable function of one task; its exceptions end the run.
            tasks: Tasks, drawn one by one when a process is about to need the next.
        """


@dataclass(frozen=True)
class LocalPool:
    """Processes of this machine (joblib, loky); a single worker is this process itself.

    The kernel may kill a process when memory runs out, and so may a user. The tasks
    that were running at that time are repeated one at a time, which identifies the task
    that caused the failure. Ctrl-C interrupts this process alone, which then ends the
    others.
    """

    workers: int
    """Number of processes that compute at the same time."""

    def run(
        self, function: Callable[[Task], Found], tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Found | Lost]]:
        """Yield every task with its result, in the order of completion.

        Args:
            function: Picklable function of one task; its exceptions end the run.
            tasks: Tasks, drawn one by one when a process is about to need the next.
        """
        from joblib.externals.loky.process_executor import BrokenProcessPool

        waiting: dict[int, Task] = {}  # tasks without a result, in the order drawn
        left: Iterator[tuple[int, Task]] = enumerate(tasks)

        def drawn() -> Iterator[tuple[int, Task]]:
            for number, task in left:
                waiting[number] = task
                yield number, task

        while True:
            try:
                # starts the first tasks, of which one may end its process at once
                with _parallel(self.workers, function, drawn()) as results:
                    for number, found in results:
                        yield waiting.pop(number), found
                return
            except BrokenProcessPool:
                pass
            # tasks start in the order in which they were drawn, so that the first ones
            # without a result were running
            suspects = list(waiting.items())[: self.workers]
            left = chain(list(waiting.items())[self.workers :], left)
            waiting.clear()
            for number, task in suspects:
                try:
                    with _parallel(2, function, [(number, task)]) as results:
                        ((_, found),) = results
                except BrokenProcessPool:
                    yield (
                        task,
                        Lost(
                            "its process died twice, the second time while running"
                            " alone: out of memory, or killed"
                        ),
                    )
                else:
                    yield task, found


@contextmanager
def _parallel(
    jobs: int,
    function: Callable[[Task], Found],
    tasks: Iterable[tuple[int, Task]],
) -> Iterator[Iterator[tuple[int, Found]]]:
    """Results in the order of completion; leaving the block ends unfinished tasks."""
    from joblib import Parallel, delayed, parallel_config

    # several threads that compete for CPUs do not speed up small dense products
    with parallel_config(
        backend="loky",
        n_jobs=jobs,
        inner_max_num_threads=1,
        initializer=_prepare_worker,
        initargs=(os.getpid(),),
    ):
        parallel = Parallel(
            return_as="generator_unordered",
            batch_size=1,
            max_nbytes=None,  # tasks are small: no arrays in files
        )
    call, cache = delayed(_numbered), os.environ.get(CACHE)
    found: Generator[tuple[int, Found], None, None] | None = None
    try:
        with _without_interrupts():
            found = parallel(
                call(function, number, task, cache) for number, task in tasks
            )
        yield found
    finally:
        if found is not None:
            with _quiet_end():
                found.close()


@contextmanager
def _quiet_end() -> Iterator[None]:
    """End unfinished tasks without the messages of joblib and loky.

    joblib warns about these tasks. The thread of loky that hands tasks to processes
    raises a ``KeyError`` if it is about to hand over a task that has just been
    cancelled, after it has ended the processes.
    """
    shown = threading.excepthook

    def hook(failure: Any) -> None:
        manager = getattr(failure.thread, "name", "") == "ExecutorManagerThread"
        if not (manager and issubclass(failure.exc_type, KeyError)):
            shown(failure)

    threading.excepthook = hook
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        threading.excepthook = shown


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Start processes that do not receive the SIGINT of Ctrl-C.

    A terminal sends it to all processes of a command, and a process that is still
    importing modules would print a traceback. New processes inherit the blocked signal,
    and so do the threads that start further ones. Other threads of this process may
    receive it: it takes effect at the end of the block, because a half-started process
    would print a traceback, too.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as loky_tracker

    # starting these processes of the standard library and of loky unblocks the signal
    resource_tracker.ensure_running()
    loky_tracker.ensure_running()
    in_main = threading.current_thread() is threading.main_thread()
    handler = signal.getsignal(signal.SIGINT) if in_main else None
    received = []
    if handler is not None:
        signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if handler is not None:
            signal.signal(signal.SIGINT, handler)
        if received:
            signal.raise_signal(signal.SIGINT)


def _numbered(
    function: Callable[[Task], Found], number: int, task: Task, cache: str | None
) -> tuple[int, Found]:
    # a process that is reused from an earlier run may still have its cache folder
    if cache is None:
        os.environ.pop(CACHE, None)
    else:
        os.environ[CACHE] = cache
    return number, function(task)


def _prepare_worker(parent: int) -> None:
    """Keep freed memory, and end this process soon after its parent has ended.

    No process would receive the result, and intermediate results are already stored.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)

    keep_freed_memory()
    threading.Thread(target=watch, daemon=True).start()


def run_all(
    function: Callable[[Task], Found],
    tasks: Sequence[Task],
    *,
    jobs: int = 1,
    stage: str = "runs",
    progress: Progress = silent,
) -> list[Found]:
    """Run all tasks and return their results in the order of the tasks.

    Args:
        function: Picklable function of one task, called in a worker process unless
            there is only one job or one task.
        tasks: Tasks, started in this order; put long ones first.
        jobs: Number of processes.
        stage: Name of the stage for the progress.
        progress: Called before the first task and after every task.

    Raises:
        ComputationError: If a task kills its process.
    """
    found: dict[int, Any] = {}
    progress(stage, 0, len(tasks))
    pool = LocalPool(max(1, min(jobs, len(tasks))))
    for (k, _), result in pool.run(partial(_of_pair, function), enumerate(tasks)):
        if isinstance(result, Lost):
            raise ComputationError(f"{stage}: task {k + 1}: {result.reason}")
        found[k] = result
        progress(stage, len(found), len(tasks))
    return [found[k] for k in range(len(tasks))]


def _of_pair(function: Callable[[Task], Found], pair: tuple[int, Task]) -> Found:
    return function(pair[1])

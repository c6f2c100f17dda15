"""Executors of a sweep: this machine, a dask scheduler or a SLURM cluster."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from swgjoint.errors import ComputationError, InputError, MissingExtraError
from swgjoint.explore.sweep.tasks import AskedFile, SlurmCluster
from swgjoint.pool import Executor, LocalPool, Lost

Task = TypeVar("Task")
Found = TypeVar("Found")

AHEAD = 3
"""Number of tasks submitted per worker thread: one runs, two wait."""
CONNECT_S = 15.0
"""Time limit for connecting to a scheduler [s]."""
ONE_THREAD = tuple(
    f"export {name}_NUM_THREADS=1" for name in ("OMP", "OPENBLAS", "MKL")
)
"""Shell commands that limit linear algebra to one thread."""


@dataclass(frozen=True)
class DaskPool:
    """Workers of a dask scheduler.

    If a worker dies, its tasks go to another worker. The scheduler gives up a task
    after more than ``allowed-failures`` deaths of its workers (a setting of the
    scheduler, 3 by default). Each of these tasks is then tried again alone; if the
    worker dies again, the task is lost. Workers with a nanny, which is dask's default,
    use one thread for linear algebra.
    """

    client: Any
    """Client of the scheduler (``distributed.Client``)."""

    @property
    def workers(self) -> int:
        """Threads of all workers that have joined so far, at least one."""
        threads: dict[str, int] = self.client.nthreads()
        return max(1, sum(threads.values()))

    def run(
        self, function: Callable[[Task], Found], tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Found | Lost]]:
        """See :class:`swgjoint.pool.Executor`.

        Args:
            function: Importable function of one task.
            tasks: Tasks, consumed as workers become free.

        Raises:
            ComputationError: If the scheduler stops or a worker raises an error.
        """
        try:
            yield from self._run(function, iter(tasks))
        except OSError as error:
            raise ComputationError(
                f"connection to the scheduler lost: {error}; finished results are kept"
            ) from None

    def _run(
        self, function: Callable[[Task], Found], left: Iterator[Task]
    ) -> Iterator[tuple[Task, Found | Lost]]:
        if not self.client.nthreads():
            warnings.warn("waiting: the scheduler has no workers yet", stacklevel=3)
        suspects: list[Task] = []
        for task, found in self._run_at(lambda: AHEAD * self.workers, function, left):
            if isinstance(found, Lost):
                suspects.append(task)
            else:
                yield task, found
        # one at a time, so that a task that kills its worker affects no other task
        yield from self._run_at(lambda: 1, function, iter(suspects))

    def _run_at(
        self,
        most: Callable[[], int],
        function: Callable[[Task], Found],
        left: Iterator[Task],
    ) -> Iterator[tuple[Task, Found | Lost]]:
        from distributed import KilledWorker, as_completed

        out: dict[str, Task] = {}
        ready = as_completed(loop=self.client.loop, raise_errors=False)

        def hand_out() -> None:
            for task in islice(left, max(0, most() - len(out))):
                future = self.client.submit(function, task, pure=False)
                out[future.key] = task
                ready.add(future)

        hand_out()
        for future in ready:
            if future.status in ("lost", "pending"):
                # the worker with the result died, so the scheduler repeats the task
                ready.add(future)
                continue
            task = out.pop(future.key)
            try:
                found: Found | Lost = future.result()
            except KilledWorker as error:
                found = Lost(f"its workers died repeatedly: {error}")
            except Exception as error:
                if future.status != "error":  # the scheduler has forgotten it
                    raise ConnectionError(f"task {future.status}") from error
                raise ComputationError(
                    f"a worker failed: {type(error).__name__}: {error}"
                ) from None
            yield task, found
            hand_out()


@contextmanager
def dask_pool(address: str) -> Iterator[DaskPool]:
    """Connect to a dask scheduler.

    Args:
        address: Address such as ``tcp://host:8786``, or path of a scheduler file.

    Raises:
        InputError: If no scheduler answers at the address.
        MissingExtraError: If dask is not installed.
    """
    try:
        from distributed import Client
    except ImportError:
        raise _missing() from None
    try:
        there = _address(address)
        client = Client(there, timeout=CONNECT_S, set_as_default=False)
    # missing file, unknown protocol, refused connection or too deeply nested JSON
    except (OSError, ValueError, RecursionError) as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"scheduler {address!r}: {text}") from None
    with client:
        yield DaskPool(client)


def _address(reference: str) -> str:
    """Check the address of a scheduler, or read it from a scheduler file.

    With an invalid address, dask's client would hang for half a minute.

    Raises:
        OSError: If the scheduler file cannot be read.
        ValueError: If the address is invalid.
    """
    from distributed.comm import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    address: Any = reference
    if reference.endswith(".json"):
        content = json.loads(Path(reference).read_bytes())
        address = content.get("address") if isinstance(content, dict) else None
        if not isinstance(address, str):
            raise ValueError("expected a dask scheduler file with an address")
    scheme, location = parse_address(address)
    get_backend(scheme)
    try:
        parse_host_port(location)
    except ValueError:
        raise ValueError(
            f"no host and port in {address!r}; accepted: for example tcp://host:8786"
        ) from None
    return str(address)


def slurm_cluster(settings: SlurmCluster) -> Any:
    """Create the SLURM cluster of the settings; no job is submitted yet.

    Raises:
        MissingExtraError: If dask-jobqueue is not installed.
    """
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise _missing() from None
    return SLURMCluster(
        queue=settings.queue,
        account=settings.account,
        cores=settings.cores,
        processes=settings.cores,
        memory=f"{settings.memory_GB:g}GB",
        walltime=settings.walltime,
        job_name="swgjoint-sweep",
        job_script_prologue=[*ONE_THREAD, *settings.prologue],
        job_extra_directives=list(settings.directives),
        scheduler_options={"dashboard_address": ":0"},  # 8787 may be in use
    )


def _missing() -> MissingExtraError:
    return MissingExtraError(
        "sweeps on a cluster need dask: pip install 'swgjoint[cluster]'"
    )


@contextmanager
def chosen_executor(
    file: AskedFile, *, jobs: int | None = None, scheduler: str | None = None
) -> Iterator[Executor]:
    """Choose the executor: a dask scheduler, local processes or a SLURM cluster.

    If none of these is specified, one process runs on every core of this machine.

    Args:
        file: File whose ``cluster`` is used if neither keyword is specified.
        jobs: Number of processes on this machine.
        scheduler: Address or file of a dask scheduler; takes precedence over ``jobs``.

    Raises:
        InputError: If no scheduler answers at the address.
        MissingExtraError: If dask is needed but not installed.
    """
    if scheduler is not None:
        with dask_pool(scheduler) as pool:
            yield pool
    elif jobs is None and file.cluster is not None:
        with slurm_cluster(file.cluster) as cluster:
            from distributed import Client

            cluster.scale(jobs=file.cluster.jobs)
            with Client(cluster, set_as_default=False) as client:
                yield DaskPool(client)
    else:
        from joblib import cpu_count

        yield LocalPool(jobs or cpu_count())

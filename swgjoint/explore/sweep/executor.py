"""Where a sweep is computed: this machine, a dask scheduler, or a SLURM cluster."""

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
"""Tasks at the scheduler for each thread of a worker: one runs, two wait."""
CONNECT_S = 15.0
ONE_THREAD = tuple(
    f"export {name}_NUM_THREADS=1" for name in ("OMP", "OPENBLAS", "MKL")
)


@dataclass(frozen=True)
class DaskPool:
    """Workers of a dask scheduler.

    A task whose worker dies goes to another one. The scheduler gives up the tasks that
    waited at more than ``allowed-failures`` deaths (3, a setting of the scheduler);
    each of them is tried again alone, and lost if its worker dies then, too. Workers
    with a nanny, which is dask's default, use one thread of algebra.
    """

    client: Any

    @property
    def workers(self) -> int:
        """Threads of all workers that have joined so far, at least one."""
        threads: dict[str, int] = self.client.nthreads()
        return max(1, sum(threads.values()))

    def run(
        self, function: Callable[[Task], Found], tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Found | Lost]]:
        """See :class:`swgjoint.pool.Executor`."""
        try:
            yield from self._run(function, iter(tasks))
        except OSError as error:
            raise ComputationError(
                f"the scheduler is gone: {error}; what is finished is kept"
            ) from None

    def _run(
        self, function: Callable[[Task], Found], left: Iterator[Task]
    ) -> Iterator[tuple[Task, Found | Lost]]:
        if not self.client.nthreads():
            warnings.warn("the scheduler has no workers yet: waiting", stacklevel=3)
        suspects: list[Task] = []
        for task, found in self._run_at(lambda: AHEAD * self.workers, function, left):
            if isinstance(found, Lost):
                suspects.append(task)
            else:
                yield task, found
        # one by one, so that a task that kills its worker takes no other task with it
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
                # its worker died with the result: the scheduler computes it again
                ready.add(future)
                continue
            task = out.pop(future.key)
            try:
                found: Found | Lost = future.result()
            except KilledWorker as error:
                found = Lost(f"its worker died again and again: {error}")
            except Exception as error:
                if future.status != "error":  # the scheduler has forgotten it
                    raise ConnectionError(f"task {future.status}") from error
                raise ComputationError(
                    f"a worker cannot compute: {type(error).__name__}: {error}"
                ) from None
            yield task, found
            hand_out()


@contextmanager
def dask_pool(address: str) -> Iterator[DaskPool]:
    """Workers of the scheduler at an address or of a scheduler file.

    Raises:
        InputError: If nothing answers there.
    """
    try:
        from distributed import Client
    except ImportError:
        raise _missing() from None
    try:
        there = _address(address)
        client = Client(there, timeout=CONNECT_S, set_as_default=False)
    # no such file or protocol, refused; a file that is nested without end
    except (OSError, ValueError, RecursionError) as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"scheduler {address!r}: {text}") from None
    with client:
        yield DaskPool(client)


def _address(given: str) -> str:
    """The address given or of a scheduler file.

    A client that was made with one that is none waits half a minute for itself.

    Raises:
        OSError: If there is no such file.
        ValueError: If it is no address.
    """
    from distributed.comm import parse_address, parse_host_port
    from distributed.comm.registry import get_backend

    found: Any = given
    if given.endswith(".json"):
        content = json.loads(Path(given).read_bytes())
        found = content.get("address") if isinstance(content, dict) else None
        if not isinstance(found, str):
            raise ValueError("no address in it; accepted: the file of a dask scheduler")
    scheme, location = parse_address(found)
    get_backend(scheme)
    try:
        parse_host_port(location)
    except ValueError:
        raise ValueError(
            f"no host and port in {found!r}; accepted: such as tcp://host:8786"
        ) from None
    return str(found)


def slurm_cluster(settings: SlurmCluster) -> Any:
    """The cluster of the settings, with no job submitted yet."""
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
        scheduler_options={"dashboard_address": ":0"},  # 8787 may be somebody's
    )


def _missing() -> MissingExtraError:
    return MissingExtraError(
        "sweeps on a cluster need dask: pip install 'swgjoint[cluster]'"
    )


@contextmanager
def chosen_executor(
    file: AskedFile, *, jobs: int | None = None, scheduler: str | None = None
) -> Iterator[Executor]:
    """The scheduler, the number of jobs on this machine, or what the file says.

    Without any of them, one job on every core of this machine.
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

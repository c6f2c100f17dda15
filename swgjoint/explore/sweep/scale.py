"""How long a sweep takes on more workers, from measured times of its tasks."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """A simulated sweep."""

    workers: int
    wall: float
    """From the order to the last result [s]."""
    work: float
    """Sum over the tasks [s]."""

    @property
    def efficiency(self) -> float:
        """Work over wall time and workers [-]."""
        return self.work / (self.wall * self.workers)


def schedule(
    task_times: ArrayLike, workers: int, *, start: float = 0.0, handing: float = 0.0
) -> Schedule:
    """List scheduling: whichever worker is free first takes the next task.

    One process hands out the tasks, one after the other, which bounds how many workers
    it can feed: to about the time of a task over that of handing it out. Without that
    time no order of n tasks ends later than ``work/m + (1 - 1/m) longest`` on m workers
    (Graham 1966, "Bounds for certain multiprocessing anomalies", Bell System Technical
    Journal 45).

    Args:
        task_times: Work of the tasks in the order in which they are handed out (n,)
            [s].
        workers: Processes that compute.
        start: Until the workers are ready: processes, imports [s].
        handing: For one task and its result, in the process that hands out [s].
    """
    times = np.asarray(task_times, dtype=float).ravel().tolist()
    free = [start] * workers
    clock = end = 0.0
    for time in times:
        clock = max(free[0], clock) + handing
        heapq.heapreplace(free, clock + time)
        end = max(end, clock + time)
    return Schedule(workers=workers, wall=end, work=sum(times))


def tasks_of(design_times: ArrayLike, seconds: float) -> list[float]:
    """Times of tasks that hold as many designs as fill some seconds on average."""
    times = np.asarray(design_times, dtype=float).ravel()
    size = max(1, round(seconds / float(times.mean())))
    return [float(times[k : k + size].sum()) for k in range(0, times.size, size)]

"""Predicted run time of a sweep on more workers, from measured task times."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """A simulated sweep."""

    workers: int
    """Number of computing processes."""
    wall: float
    """Time from the start to the last result [s]."""
    work: float
    """Total computing time of the tasks [s]."""

    @property
    def efficiency(self) -> float:
        """Work divided by wall time and workers [-]."""
        return self.work / (self.wall * self.workers)


def schedule(
    task_times: ArrayLike, workers: int, *, start: float = 0.0, handing: float = 0.0
) -> Schedule:
    """List scheduling: the worker that is free first takes the next task.

    One process hands out the tasks one after the other. The number of workers that it
    can keep busy is therefore limited to about the time of a task divided by the time
    to hand it out. If handing out takes no time, tasks in any order finish within
    ``work/m + (1 - 1/m) longest`` on m workers (Graham 1966, "Bounds for certain
    multiprocessing anomalies", Bell System Technical Journal 45).

    Args:
        task_times: Computing time of each task, in the order of handing out, shape
            (n,) [s].
        workers: Number of computing processes.
        start: Time until the workers are ready: process start and imports [s].
        handing: Time that the main process spends on one task and its result [s].
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
    """Group designs into tasks of about equal duration, and return the task times [s].

    Args:
        design_times: Computing time of each design, shape (n,) [s].
        seconds: Mean duration of a task [s].
    """
    times = np.asarray(design_times, dtype=float).ravel()
    size = max(1, round(seconds / float(times.mean())))
    return [float(times[k : k + size].sum()) for k in range(0, times.size, size)]

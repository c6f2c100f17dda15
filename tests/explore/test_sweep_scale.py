"""Simulated schedules: laws, and a measured pool."""

from __future__ import annotations

import sys
import time

import cloudpickle
import numpy as np
import pytest

from swgjoint.explore.sweep.scale import schedule, tasks_of
from swgjoint.pool import LocalPool

# a process of the pool cannot import this file by its name
cloudpickle.register_pickle_by_value(sys.modules[__name__])


def test_one_worker_does_one_thing_after_the_other():
    """Start, and for every task its handing out and its work."""
    found = schedule([1.0, 2.0, 3.0], 1, start=0.5, handing=0.1)
    assert found.wall == pytest.approx(0.5 + 6.0 + 3 * 0.1)
    assert found.efficiency == pytest.approx(6.0 / 6.8)


def test_equal_tasks_come_in_rounds():
    """Seven tasks on three workers take three rounds."""
    assert schedule([2.0] * 7, 3).wall == 6.0
    assert schedule([2.0] * 6, 3).efficiency == 1.0


@pytest.mark.parametrize("workers", [1, 2, 7, 40])
def test_graham_s_bound(workers):
    """No schedule beats its share or longest task, none takes longer than both."""
    times = np.random.default_rng(3).lognormal(sigma=1.0, size=200)
    wall = schedule(times, workers).wall
    share, longest = times.sum() / workers, times.max()
    assert max(share, longest) <= wall * (1.0 + 1e-12)
    assert wall <= share + (1.0 - 1.0 / workers) * longest + 1e-9


def test_one_process_can_feed_so_many_workers():
    """Beyond task over handing time the handing out is all of the wall time."""
    few = schedule([1.0] * 2000, 20, handing=0.01)
    many = schedule([1.0] * 2000, 1000, handing=0.01)
    assert few.efficiency > 0.97
    assert many.wall == pytest.approx(2000 * 0.01 + 1.0)


def test_designs_are_put_into_tasks_of_seconds():
    """No work is lost, and tasks last as long as they should on average."""
    times = np.random.default_rng(5).uniform(0.05, 0.15, size=1000)
    tasks = tasks_of(times, 2.0)
    assert sum(tasks) == pytest.approx(times.sum())
    assert np.mean(tasks) == pytest.approx(2.0, rel=0.05)


def timed_sleep(seconds):
    """How long a task that waits has taken."""
    begin = time.perf_counter()
    time.sleep(seconds)
    return time.perf_counter() - begin


def test_no_measured_pool_beats_the_simulated_time():
    """Two processes, tasks of different lengths, the start of the processes apart."""
    pool = LocalPool(2)
    list(pool.run(timed_sleep, [0.0] * 4))  # processes are up
    wanted = np.random.default_rng(1).uniform(0.05, 0.4, size=16).tolist()
    begin = time.perf_counter()
    found = list(pool.run(timed_sleep, wanted))
    wall = time.perf_counter() - begin
    taken = dict(found)
    simulated = schedule([taken[seconds] for seconds in wanted], 2)
    assert simulated.wall <= wall  # what comes on top depends on the machine

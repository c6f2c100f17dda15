"""Independent runs on processes: order, errors, threads."""

from __future__ import annotations

import math
import os

import pytest

from swgjoint.study.pool import run_all


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_keep_the_order_of_the_tasks(jobs):
    """Results come back by task, whichever is ready first; progress counts them."""
    seen = []
    found = run_all(
        math.sqrt,
        [9.0, 4.0, 1.0],
        jobs=jobs,
        stage="roots",
        progress=lambda *args: seen.append(args),
    )
    assert found == [3.0, 2.0, 1.0]
    assert seen == [("roots", k, 3) for k in (0, 1, 2, 3)]


def test_an_error_ends_the_run():
    """An exception in a process reaches the caller."""
    with pytest.raises(ValueError, match="math domain error"):
        run_all(math.sqrt, [1.0, -1.0, 4.0], jobs=2)


def test_processes_use_one_thread(monkeypatch):
    """Linear algebra in the processes has one thread, whatever the shell says."""
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    found = run_all(os.getenv, ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"], jobs=2)
    assert found == ["1", "1"]

"""Independent runs on processes: order, errors, threads."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cloudpickle
import pytest
from messages import naming

from swgjoint.errors import ComputationError
from swgjoint.pool import LocalPool, Lost, run_all

# a process of the pool cannot import this file by its name
cloudpickle.register_pickle_by_value(sys.modules[__name__])


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


def test_processes_have_the_cache_of_now(monkeypatch):
    """Also those that an earlier run has left."""
    for name in ("one", "two"):
        monkeypatch.setenv("SWGJOINT_CACHE", name)
        keys = ["SWGJOINT_CACHE"] * 3
        assert run_all(os.getenv, keys, jobs=2) == [name] * 3


def test_an_error_ends_the_run():
    """An exception in a process reaches the caller."""
    with pytest.raises(ValueError, match="math domain error"):
        run_all(math.sqrt, [1.0, -1.0, 4.0], jobs=2)


def test_processes_use_one_thread(monkeypatch):
    """Linear algebra in the processes has one thread, whatever the shell says."""
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    found = run_all(os.getenv, ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"], jobs=2)
    assert found == ["1", "1"]


def deadly(task):
    """Kills its process where it is asked to, at the first attempt or always."""
    number, folder = task
    mark = Path(folder) / str(number)
    if number == 7 or (number == 3 and not mark.exists()):
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_task_that_kills_its_process_is_lost_alone(tmp_path):
    """What dies again is lost; what died once, and all others, are computed."""
    tasks = [(number, str(tmp_path)) for number in range(10)]
    found = list(LocalPool(2).run(deadly, tasks))
    lost = [task[0] for task, result in found if isinstance(result, Lost)]
    assert lost == [7]
    kept = {task[0]: result for task, result in found if task[0] != 7}
    assert kept == {number: number for number in range(10) if number != 7}
    assert len(found) == 10


def test_a_process_may_die_before_all_tasks_have_started(tmp_path):
    """The next task then finds the pool broken; no result is missing."""

    def drawn():
        yield from ((number, str(tmp_path)) for number in (7, 1))
        while not (tmp_path / "7").exists():
            time.sleep(0.05)
        time.sleep(1.0)  # until the death of its process is known
        yield from ((number, str(tmp_path)) for number in (2, 3))

    found = {task[0]: result for task, result in LocalPool(2).run(deadly, drawn())}
    assert isinstance(found.pop(7), Lost)
    assert found == {1: 1, 2: 2, 3: 3}


def slow_root(number):
    time.sleep(0.01)
    return math.sqrt(number)


def test_tasks_are_drawn_as_they_are_needed():
    """An unbounded list of tasks can be run: no more are drawn than are in hand."""
    drawn = []

    def tasks():
        for number in range(40):
            drawn.append(number)
            yield number

    found = LocalPool(2).run(slow_root, tasks())
    next(found)
    assert len(drawn) < 20
    assert len(list(found)) == 39
    assert len(drawn) == 40


def test_a_dead_process_of_a_study_is_one_line(tmp_path):
    """A study cannot do without a result: the death of its process is an error."""
    with pytest.raises(
        ComputationError, match=naming("runs", "task 2", "process", "memory")
    ):
        run_all(deadly, [(1, str(tmp_path)), (7, str(tmp_path))], jobs=2)


def test_a_run_may_be_left():
    """Who takes no more results gets no warning about those that are ready."""
    found = LocalPool(2).run(slow_root, range(30))
    assert next(found)[1] is not None
    found.close()


PARENT = """
import os, sys, time
from swgjoint.pool import run_all

run_all(os.mkdir, sys.argv[1:], jobs=2)
run_all(time.sleep, [60.0] * 2, jobs=2)
"""


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for processes in /proc")
@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGKILL])
def test_processes_end_with_their_parent(tmp_path, stop):
    """Whatever ends it, and in the middle of a task: nobody would take the result."""
    folders = [tmp_path / "one", tmp_path / "two"]
    parent = subprocess.Popen([sys.executable, "-P", "-c", PARENT, *map(str, folders)])
    while not all(folder.is_dir() for folder in folders):
        assert parent.poll() is None
        time.sleep(0.05)
    children = children_of(parent.pid)
    assert len(children) >= 2
    parent.send_signal(stop)
    parent.wait()
    end = time.monotonic() + 20.0
    while alive := [pid for pid in children if is_running(pid)]:
        assert time.monotonic() < end, alive
        time.sleep(0.1)


def children_of(pid: int) -> list[int]:
    text = "".join(p.read_text() for p in Path(f"/proc/{pid}/task").glob("*/children"))
    return [int(child) for child in text.split()]


def is_running(pid: int) -> bool:
    try:
        return (
            Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
        )
    except FileNotFoundError:
        return False

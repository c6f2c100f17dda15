"""Sweeps on a dask cluster of processes of this machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from messages import names, naming

from swgjoint.errors import ComputationError, InputError
from swgjoint.explore.sweep.executor import DaskPool, dask_pool, slurm_cluster
from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.sweep import run_sweep
from swgjoint.explore.sweep.tasks import SlurmCluster
from swgjoint.faults import validate
from swgjoint.pool import LocalPool, Lost
from swgjoint.toml_file import parse_toml

pytest.importorskip("distributed", reason="needs swgjoint[cluster]")

MESHING = """
design = "reference-2d"
[meshing]
figures = ["von_mises_MPa", "wave_generator_torque_pp_Nm"]
positions = 2
[plan]
kind = "grid"
[[plan.parameters]]
keys = ["mesh.refinement"]
values = [0.5]
[[plan.parameters]]
keys = ["flexspline.pressure_angle_deg", "circular_spline.pressure_angle_deg"]
values = [18.0, 19.0, 59.0, 20.0, 21.0, 22.0]
"""

LONG = 300.0
"""Limit of a wait [s]: what takes longer hangs."""


@pytest.fixture(scope="module")
def file() -> SweepFile:
    return validate(SweepFile, parse_toml(MESHING, where="x"), where="x")


def figures(found) -> list[dict]:
    return [{k: v for k, v in row.items() if k != "work_s"} for row in found.rows()]


@pytest.fixture(scope="module")
def here(file):
    """What this process computes."""
    return figures(run_sweep(file, executor=LocalPool(1)))


@contextmanager
def cluster(folder, **settings):
    """A scheduler and two workers, each a process of its own; the scheduler file."""
    told = folder / "scheduler.json"
    common = ["--scheduler-file", str(told), "--no-dashboard"]
    common += ["--host", "127.0.0.1"]
    # one thread of algebra is the nanny's doing, not the shell's
    env = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}

    def started(kind, *options):
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", *common, *options],
            cwd=folder,
            env=env | settings,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    processes = [started("scheduler", "--port", "0")]
    try:
        end = time.monotonic() + LONG
        while not told.exists():
            assert time.monotonic() < end
            assert processes[0].poll() is None
            time.sleep(0.05)
        processes += [started("worker", "--nthreads", "1") for _ in range(2)]
        yield str(told)
    finally:
        for process in reversed(processes):
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@contextmanager
def joined(scheduler):
    """The pool with both workers, back if a test has killed them."""
    with dask_pool(scheduler) as pool:
        pool.client.wait_for_workers(2, timeout=LONG)
        yield pool


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """The file of a cluster with the settings that dask comes with."""
    with cluster(tmp_path_factory.mktemp("dask")) as told:
        yield told


def test_a_cluster_gives_what_one_process_gives(file, here, scheduler):
    """Identical rows, to the last bit, a design that cannot be built among them."""
    with joined(scheduler) as pool:
        assert pool.workers == 2
        found = run_sweep(file, executor=pool)
        threads = pool.client.run(os.getenv, "OPENBLAS_NUM_THREADS")
    assert figures(found) == here
    outcomes = [record.outcome for record in found.records]
    assert outcomes == ["ok", "ok", "infeasible", "ok", "ok", "ok"]
    assert "does not reach the tip" in found.records[2].reason
    assert set(threads.values()) == {"1"}


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(file, here, scheduler):
    """A worker that dies in the middle of a design: all are there, and the same."""
    killed = []
    with joined(scheduler) as pool:
        workers = list(pool.client.run(os.getpid).values())

        def progress(stage, done, total):
            # both are at work then: five designs take finite elements
            if done == 1:
                os.kill(workers[0], signal.SIGKILL)
                killed.append((done, total))

        found = run_sweep(file, executor=pool, progress=progress)
    assert killed == [(1, 6)]
    assert figures(found) == here


@pytest.mark.slow
def test_a_task_that_kills_every_worker_is_lost(scheduler):
    """After the deaths that the scheduler allows the task is given up, not the rest."""

    # inside, so that it travels by value: workers cannot import this file
    def die(task):
        if task == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return task

    with joined(scheduler) as pool:
        found = dict(pool.run(die, range(4)))
    assert isinstance(found.pop(2), Lost)
    assert found == {0: 0, 1: 1, 3: 3}


@pytest.mark.slow
def test_a_result_that_dies_with_its_worker_is_computed_again(scheduler):
    """All four are done, three not fetched, when both workers are killed."""
    with joined(scheduler) as pool:
        pids = pool.client.run(os.getpid).values()
        found = pool.run(str, range(4))
        first, text = next(found)
        states = pool.client.futures.values()
        wait_for(lambda: all(state.status == "finished" for state in states))
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
        wait_for(lambda: any(state.status == "lost" for state in states))
        rest = dict(found)
    assert {first: text, **rest} == {k: str(k) for k in range(4)}


@pytest.mark.slow
def test_what_waits_beside_a_deadly_task_is_not_lost(tmp_path):
    """A scheduler that gives up at once blames what its dead worker still had to do."""

    def die(task):
        if task == 0:
            time.sleep(0.5)  # another one waits at the worker by now
            os.kill(os.getpid(), signal.SIGKILL)
        return task

    given_up = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with cluster(tmp_path, **given_up) as told, joined(told) as pool:
        found = dict(pool.run(die, range(6)))
    assert isinstance(found.pop(0), Lost)
    assert found == {k: k for k in range(1, 6)}


def wait_for(condition):
    """Until it holds."""
    end = time.monotonic() + LONG
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_scheduler_that_goes_is_one_line():
    """The sweep ends with what is finished kept."""

    class Gone:
        def nthreads(self):
            raise ConnectionResetError("reset by peer")

    with pytest.raises(ComputationError, match=naming("scheduler", "reset by peer")):
        list(DaskPool(Gone()).run(os.getenv, ["HOME"]))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nosuch://x", "none.json"])
def test_a_scheduler_that_is_not_there_is_one_line(address, monkeypatch):
    """Nothing answers, no such protocol, no such file."""
    monkeypatch.setattr("swgjoint.explore.sweep.executor.CONNECT_S", 1.0)
    with (
        pytest.raises(InputError, match=naming("scheduler", f"'{address}'")),
        dask_pool(address),
    ):
        pass


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("nonsense", ("host", "port", "tcp://host:8786")),
        ("", ("host", "port", "tcp://host:8786")),
        ("tcp://host:port", ("host", "port", "tcp://host:8786")),
        ("{}.json", ("address", "dask")),
        ("[1].json", ("address", "dask")),
        ("{.json", ("line 1", "column 2")),
        pytest.param(100_000 * "[" + ".json", ("recursion",), id="nested"),
    ],
)
def test_what_is_no_address_makes_no_client(address, told, tmp_path, monkeypatch):
    """A client that fails while it is made leaves a traceback after half a minute."""
    monkeypatch.setattr("distributed.Client", None)
    if address.endswith(".json"):
        content, address = address.removesuffix(".json"), str(tmp_path / "told.json")
        Path(address).write_text(content)
    with pytest.raises(InputError) as caught, dask_pool(address):
        pass
    assert names(str(caught.value), "scheduler", f"{address!r}", *told)


def test_the_job_script_of_a_cluster():
    """What SLURM is asked for, and one thread of algebra before the workers start."""
    pytest.importorskip("dask_jobqueue", reason="needs swgjoint[cluster]")
    settings = SlurmCluster(
        jobs=4,
        cores=16,
        memory_GB=32.0,
        walltime="02:30:00",
        queue="short",
        account="gears",
        prologue=("module load python",),
        directives=("--exclusive",),
    )
    with slurm_cluster(settings) as cluster:
        lines = cluster.job_script().splitlines()
    for line in (
        "#SBATCH -J swgjoint-sweep",
        "#SBATCH -p short",
        "#SBATCH -A gears",
        "#SBATCH --cpus-per-task=16",
        "#SBATCH --mem=30G",
        "#SBATCH -t 02:30:00",
        "#SBATCH --exclusive",
        "export OPENBLAS_NUM_THREADS=1",
        "module load python",
    ):
        assert line in lines, line
    start = next(k for k, line in enumerate(lines) if "distributed" in line)
    assert lines.index("export OMP_NUM_THREADS=1") < start
    assert "--nworkers 16" in lines[start]
    assert "--nthreads 1" in lines[start]

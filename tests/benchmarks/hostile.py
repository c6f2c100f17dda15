"""Any number of hostile inputs in processes with limits, and a table of what came.

``python tests/benchmarks/hostile.py COUNT [--seed S] [--processes N] [--kind KIND]
[--keep DIR]`` runs COUNT inputs, as many of each kind, each within 10 s of CPU time
and 2 GB of address space, and writes those that break a law to DIR, by default to a
temporary folder.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# the memory allocator of recordings reserves address space that it does not use, 1 GB
# at a time, which the limit of an input would count [KiB]
os.environ.setdefault("MIMALLOC_ARENA_RESERVE", "65536")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "shared"))

from hostile import KINDS, draw
from hostile.laws import OutOfTime, answer, broken_laws

from swgjoint.cli.main import COMMANDS

LIMIT_S = 10
"""CPU time of one input."""
KILL_S = 60
"""Time after which a process is ended that does not answer its alarm."""
MEMORY = 2 << 30
"""Address space that an input may add to that of its process."""
COLUMNS = (
    *("accepted", "line", "status 1", "traceback"),
    *("crash", "hang > 10 s", "> 2 GB", "other law"),
)


@dataclass
class Worker:
    """A process, its line, what it has in hand and since when."""

    process: Any
    line: Connection
    task: tuple[str, int] | None = None
    since: float = 0.0


def _on_alarm(*_: Any) -> None:
    raise OutOfTime


def limit_memory() -> None:
    """Let the address space of this process grow by no more than the limit."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))


def work(line: Connection) -> None:
    """Answer cases until there are no more."""
    signal.signal(signal.SIGPROF, _on_alarm)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)  # what the engine prints from C
    os.environ["MPLBACKEND"] = "agg"
    while (task := line.recv()) is not None:
        case = draw(*task)
        limit_memory()
        signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
        faults: list[str] = []
        told = ""
        try:
            with tempfile.TemporaryDirectory() as folder:
                found = answer(case, Path(folder))
            signal.setitimer(signal.ITIMER_PROF, 0)
            outcome, told = found.outcome, found.raised or found.err[-2000:]
            faults = broken_laws(case, found)
            if "out of memory" in found.err or "MemoryError" in found.raised:
                outcome = "> 2 GB"
            elif faults and outcome != "traceback":
                outcome = "other law"
        except OutOfTime:
            outcome = "hang > 10 s"
        except MemoryError:
            outcome = "> 2 GB"
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        line.send((outcome, faults, told))


def load() -> None:
    """Import what is imported late, so that no limit stops it half way."""
    for name in ("matplotlib.figure", "matplotlib.backends.backend_agg", "mujoco"):
        import_module(name)
    for name in COMMANDS:
        import_module(f"swgjoint.cli.{name}")


def start() -> Worker:
    """A process that waits for work."""
    context = get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=work, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    return Worker(process, ours)


def keep(folder: Path, task: tuple[str, int], outcome: str, told: Any) -> None:
    """Write a case that broke a law, with what it broke."""
    case = draw(*task)
    name = "".join(c if c.isalnum() else "-" for c in case.kind)
    here = folder / f"{name}-{case.seed}"
    here.mkdir(parents=True, exist_ok=True)
    for file, data in case.files.items():
        (here / file).write_bytes(data)
    text = {"argv": case.argv, "outcome": outcome, "told": told}
    (here / "case.json").write_text(json.dumps(text, indent=1), encoding="utf-8")


def main() -> int:
    """Run, print the table, exit 1 where a law is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--kind", choices=KINDS, action="append")
    parser.add_argument("--keep", type=Path)
    args = parser.parse_args()
    folder = args.keep or Path(tempfile.mkdtemp(prefix="hostile-"))
    kinds = args.kind or list(KINDS)
    first = args.seed * 1_000_000
    tasks = [
        (kinds[k % len(kinds)], first + k // len(kinds)) for k in range(args.count)
    ]
    begin = time.perf_counter()
    counts = {kind: Counter[str]() for kind in kinds}
    waiting = tasks[::-1]
    load()
    workers = [start() for _ in range(args.processes)]
    while True:
        for worker in workers:
            if worker.task is None and waiting:
                worker.task, worker.since = waiting.pop(), time.perf_counter()
                worker.line.send(worker.task)
        busy = [worker for worker in workers if worker.task is not None]
        if not busy:
            break
        ready = wait([worker.line for worker in busy], timeout=1.0)
        for k, worker in enumerate(workers):
            task = worker.task
            if task is None:
                continue
            outcome, faults, told = "", [], ""
            if worker.line in ready:
                try:
                    outcome, faults, told = worker.line.recv()
                    worker.task = None
                except EOFError:
                    outcome = "crash"
            elif time.perf_counter() - worker.since > KILL_S:
                outcome = "hang > 10 s"
            if not outcome:
                continue
            # gone, silent, or stopped in the middle of an import
            if worker.task is not None or outcome in ("hang > 10 s", "> 2 GB"):
                worker.process.kill()
                worker.process.join()
                workers[k] = start()
            counts[task[0]][outcome] += 1
            worker.task = None
            if faults or outcome in COLUMNS[3:]:
                keep(folder, task, outcome, [faults, told])
    for worker in workers:
        worker.line.send(None)
        worker.process.join(5)
    show(counts)
    print(f"{args.count} inputs, {time.perf_counter() - begin:.0f} s; kept in {folder}")
    bad = sum(of[name] for of in counts.values() for name in COLUMNS[3:])
    return int(bad > 0)


def show(counts: dict[str, Counter[str]]) -> None:
    """A table with a line for each kind and their sum."""
    print("| kind | tried |", " | ".join(COLUMNS), "|")
    print("|---" * (2 + len(COLUMNS)) + "|")
    total: Counter[str] = sum(counts.values(), Counter())
    for kind, of in [*counts.items(), ("sum", total)]:
        cells = [kind, of.total(), *(of[name] for name in COLUMNS)]
        print("|", " | ".join(map(str, cells)), "|")


if __name__ == "__main__":
    sys.exit(main())

"""Sweeps over many designs: every result is stored, so a sweep can be resumed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from swgjoint.errors import ComputationError
from swgjoint.explore.sweep.figures import LOST, Record, compute_all
from swgjoint.explore.sweep.file import SweepFile
from swgjoint.explore.sweep.points import Point, points_of
from swgjoint.explore.sweep.results import ResultStore, flat, read_record, write_record
from swgjoint.explore.sweep.validity import validity_of
from swgjoint.maps.cache import code_version
from swgjoint.pool import Executor, Lost
from swgjoint.progress import Progress, silent

TASK_S = 2.0
"""Duration of a task [s]: long compared with its overhead, but cheap to repeat."""


@dataclass(frozen=True, kw_only=True)
class SweepResult:
    """Records of all designs of a sweep."""

    file: SweepFile
    points: tuple[Point, ...]
    records: tuple[Record, ...]
    """Outcome and figures of every point, in the order of the points."""
    reused: int
    """Number of points whose record was stored by an earlier run."""
    computed: int
    """Number of different designs computed in this run."""
    workers: int
    """Number of processes that computed at the same time."""
    work_s: float
    """Total computing time of the designs computed in this run [s]."""
    wall_s: float
    """Wall time of this run [s]."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(p.column for p in self.file.plan.parameters)

    @property
    def efficiency(self) -> float | None:
        """Work divided by wall time and workers [-]; None if nothing was computed."""
        if not self.computed:
            return None
        return self.work_s / (self.wall_s * self.workers)

    def rows(self) -> list[dict[str, Any]]:
        """One row per design: parameters, outcome, figures, reason, computing time."""
        return [
            {
                **{name: flat(value) for name, value in point.values.items()},
                "outcome": record.outcome,
                **{name: record.figures.get(name) for name in self.file.figures},
                "reason": record.reason,
                "work_s": record.work_s,
            }
            for point, record in zip(self.points, self.records, strict=True)
        ]

    def to_json(self) -> dict[str, Any]:
        """The JSON object of ``swgjoint sweep``, without files."""
        done = sum(record.ok for record in self.records)
        return {
            "designs": len(self.points),
            "done": done,
            "failed": len(self.points) - done,
            "reused": self.reused,
            "computed": self.computed,
            "workers": self.workers,
            "work_s": self.work_s,
            "wall_s": self.wall_s,
            "efficiency": self.efficiency,
            "parameters": list(self.columns),
            "figures": list(self.file.figures),
            "validity": validity_of(self.file),
            "rows": self.rows(),
        }


def run_sweep(
    file: SweepFile,
    *,
    executor: Executor,
    place: ResultStore | None = None,
    retry_failed: bool = False,
    progress: Progress = silent,
) -> SweepResult:
    """Compute all designs that are not stored yet.

    Every record, including that of a failed design, is stored as soon as it is
    computed, under a key derived from its inputs. An interrupted sweep therefore
    resumes where it stopped, and an extended sweep computes only the additional
    designs. Designs that failed because of the machine (``lost``) are not stored; the
    next run computes them again.

    Args:
        file: Sweep file.
        executor: Executor that computes the designs.
        place: Store of the records; None stores none.
        retry_failed: Whether designs that failed in earlier runs are computed again.
        progress: Called with the stage, the number of computed designs and their total.

    Raises:
        InputError: If the base design or scene cannot be read.
        ComputationError: If the executor cannot continue, for instance because the
            connection to the scheduler is lost.
    """
    begin = time.perf_counter()
    points = points_of(file)
    records: dict[str, Record] = {}
    todo: dict[str, Point] = {}
    for point in points:
        if (key := point.key) is None or key in todo or key in records:
            continue
        kept = None if place is None else read_record(place, key)
        if kept is None or (retry_failed and not kept.ok):
            todo[key] = point
        else:
            records[key] = kept
    known = set(records)
    progress("designs", 0, len(todo))
    for key, record in _computed(todo, executor):
        records[key] = record
        if place is not None and record.outcome != LOST:
            write_record(place, key, record, todo[key].values)
        progress("designs", len(records) - len(known), len(todo))
    found = tuple(
        Record(outcome="refused", reason=point.fault)
        if point.key is None
        else records[point.key]
        for point in points
    )
    return SweepResult(
        file=file,
        points=tuple(points),
        records=found,
        reused=sum(p.key in known for p in points),
        computed=len(todo),
        workers=executor.workers,
        work_s=sum(records[key].work_s for key in todo),
        wall_s=time.perf_counter() - begin,
    )


def _computed(
    todo: dict[str, Point], executor: Executor
) -> Iterator[tuple[str, Record]]:
    """Every design with its record, in order of completion."""
    queue = list(reversed(todo.values()))
    alone: list[Point] = []  # designs of lost tasks, to be computed one by one
    count, spent = 0, 0.0

    def tasks() -> Iterator[tuple[Point, ...]]:
        while alone or queue:
            if alone:
                yield (alone.pop(),)
                continue
            # as many designs as fill the duration of a task, once the time of a design
            # is known; the last designs are spread over all workers
            fitting = round(TASK_S * count / spent) if spent else 1
            fair = len(queue) // (4 * max(executor.workers, 1))
            yield tuple(queue.pop() for _ in range(max(1, min(fitting, fair))))

    while alone or queue:
        for task, found in executor.run(compute_all, tasks()):
            if isinstance(found, Lost):
                if len(task) > 1:
                    alone.extend(task)
                else:
                    yield _key(task[0]), Record(outcome=LOST, reason=found.reason)
                continue
            code, computed = found
            if code != code_version():
                raise ComputationError(
                    "a worker runs another version of swgjoint, numpy, scipy or"
                    " scikit-fem than this process, or a version changed during the"
                    " sweep; finished results are kept"
                )
            for point, record in zip(task, computed, strict=True):
                count, spent = count + 1, spent + record.work_s
                yield _key(point), record


def _key(point: Point) -> str:
    assert point.key is not None  # points without a key are not computed
    return point.key

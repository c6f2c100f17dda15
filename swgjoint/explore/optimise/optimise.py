"""Multi-objective search for Pareto-optimal designs.

Every generation of the search is a sweep. It uses the executors of sweeps and stores
every design as soon as it is computed; a second run of the same file reuses the stored
designs.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from swgjoint.errors import ComputationError
from swgjoint.explore.optimise.file import OptimisationFile
from swgjoint.explore.optimise.front import (
    Candidate,
    beats,
    front_of,
    not_worse,
    objectives_of,
    pick_spread,
)
from swgjoint.explore.optimise.search import search
from swgjoint.explore.sweep.figures import LOST
from swgjoint.explore.sweep.keys import BASE
from swgjoint.explore.sweep.points import Values
from swgjoint.explore.sweep.results import ResultStore, flat
from swgjoint.explore.sweep.sweep import SweepResult, run_sweep
from swgjoint.explore.sweep.validity import validity_of
from swgjoint.gear.design.design import Design
from swgjoint.pool import Executor
from swgjoint.progress import Progress, silent

NAME = 80
"""Largest number of characters of the start's name in the names of front designs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """Result of a search."""

    file: OptimisationFile
    tried: tuple[Candidate, ...]
    """All computed designs, in the order in which the search requested them."""
    front: tuple[Candidate, ...]
    """Pareto-optimal designs, sorted by the first objective."""
    start: Candidate
    """Design from which the search started."""
    beside: tuple[Candidate, ...]
    """Designs to compare with the front."""
    generations: int
    sweeps: tuple[SweepResult, ...]
    """All sweeps of the search: compared designs, generations and confirmations."""
    wall_s: float
    """Wall time [s]."""

    def to_json(self) -> dict[str, Any]:
        """The JSON object of ``swgjoint optimise``, without files."""
        file, ok = self.file, sum(c.record.ok for c in self.tried)
        rivals = (self.start, *self.beside)
        names = [self._name(c) for c in rivals]
        known = dict(zip(names, rivals, strict=True))
        known |= {f"front {k + 1}": c for k, c in enumerate(self.front)}
        return {
            "evaluations": len(self.tried),
            "failed": len(self.tried) - ok,
            "generations": self.generations,
            "reused": sum(s.reused for s in self.sweeps),
            "computed": sum(s.computed for s in self.sweeps),
            "workers": self.sweeps[0].workers,
            "work_s": sum(s.work_s for s in self.sweeps),
            "wall_s": self.wall_s,
            "objectives": {o.figure: o.goal for o in file.objectives},
            "parameters": [p.column for p in file.plan.parameters],
            "figures": list(file.figures),
            "validity": validity_of(file.sweep({BASE: [file.design]}, confirm=False)),
            "start": self._row(self.start),
            "beside": [self._row(c) for c in self.beside],
            "front": [
                {
                    **self._row(c),
                    "not_worse_than": [
                        name
                        for name, rival in zip(names, rivals, strict=True)
                        if not_worse(file, c, rival)
                    ],
                    "beaten_by": [
                        name for name, one in known.items() if beats(file, one, c)
                    ],
                }
                for c in self.front
            ],
            "rows": [self._row(c) for c in self.tried],
        }

    def designs(self, source: str) -> list[Design]:
        """Designs of the front, named after the start design.

        ``source`` is the optimisation file that the designs name as their source.
        """
        assert self.start.design is not None
        base = self.start.design.drive.name[:NAME]
        found = []
        for k, candidate in enumerate(self.front):
            assert candidate.design is not None
            names = {
                "drive.name": f"{base}-front-{k + 1:02d}",
                "drive.source": f"swgjoint optimise {source}, from {base}",
            }
            found.append(candidate.design.with_changes(names))
        return found

    def _name(self, candidate: Candidate) -> str:
        return str(candidate.values.get(BASE, ""))

    def _row(self, candidate: Candidate) -> dict[str, Any]:
        record, confirmed = candidate.record, candidate.confirmed
        # figures that decide: those of the more accurate computation, if there are any
        best = confirmed if confirmed is not None and confirmed.ok else record
        row: dict[str, Any] = {
            **{name: flat(value) for name, value in candidate.values.items()},
            "outcome": record.outcome,
            **{name: record.figures.get(name) for name in self.file.figures},
            "reason": record.reason,
            "missed": [k for k, v in self.file.violations(best.figures).items() if v]
            if best.ok
            else [],
            "confirmed": None
            if confirmed is None
            else {
                "outcome": confirmed.outcome,
                **{name: confirmed.figures.get(name) for name in self.file.figures},
                "reason": confirmed.reason,
            },
        }
        return row


def optimise(
    file: OptimisationFile,
    *,
    executor: Executor,
    place: ResultStore | None = None,
    progress: Progress = silent,
) -> Optimum:
    """Search, then compute some designs of the front again with higher accuracy.

    Without ``minutes`` in its plan, the same file gives the same designs, wherever they
    are computed and however often the search is stopped and resumed. Stored designs are
    not computed twice.

    Args:
        file: Objectives, limits and parameters.
        executor: Executor that computes the designs.
        place: Store of the records; None stores none.
        progress: Called with the stage, the number of finished designs and their total.

    Returns:
        The front, all designs that were tried, and the compared designs.

    Raises:
        InputError: If a design cannot be read.
        ComputationError: If the start design has no figures, no design of the search
            is within the limits, a design is lost, or the executor cannot continue.
        MissingExtraError: If the optimiser is not installed.
    """
    begin = time.perf_counter()
    sweeps: list[SweepResult] = []

    def computed(
        columns: Mapping[str, list[Any]], report: Progress, *, confirm: bool = False
    ) -> list[Candidate]:
        found = run_sweep(
            file.sweep(columns, confirm=confirm),
            executor=executor,
            place=place,
            progress=report,
        )
        sweeps.append(found)
        return [
            Candidate(
                values=point.values,
                design=None if point.asked is None else point.asked.design,
                record=record,
            )
            for point, record in zip(found.points, found.records, strict=True)
        ]

    named = {BASE: [file.design, *file.beside]}
    for name in file.beside:
        Design.load(name)  # report a bad reference before anything is computed
    start, *beside = computed(named, partial(_as, progress, "compared designs"))
    if not start.record.ok:
        raise ComputationError(
            f"start design {file.design}: {start.record.outcome}: {start.record.reason}"
        )
    assert start.design is not None
    tried: list[Candidate] = []

    def evaluate(generation: list[Values]) -> list[Candidate]:
        def report(stage: str, done: int, total: int) -> None:
            kept = len(generation) - total
            progress("search", len(tried) + kept + done, file.plan.designs)

        columns = {name: [v[name] for v in generation] for name in generation[0]}
        found = computed(columns, report)
        lost = [c.record.reason for c in found if c.record.outcome == LOST]
        if lost:  # their figures would change the course of the search in another run
            raise ComputationError(
                f"{len(lost)} designs of a generation were lost, the first one:"
                f" {lost[0]}; finished designs are stored, and the same command resumes"
                " the search"
            )
        return found

    generations = 0
    for generation in search(file, start.design, evaluate):
        tried += generation
        generations += 1
        minutes = file.plan.minutes
        if minutes is not None and time.perf_counter() - begin > 60.0 * minutes:
            break
    front = [tried[k] for k in front_of(file, tried)]
    if not front:
        raise ComputationError(
            f"none of {len(tried)} designs has figures within the limits; the first"
            f" one: {tried[0].record.reason or 'beyond a limit'}"
        )
    if file.confirm is not None:
        chosen = pick_spread(objectives_of(file, front), file.confirm.designs)
        columns = {
            name: [front[k].values[name] for k in chosen] for name in front[0].values
        }
        again = computed(columns, partial(_as, progress, "confirm front"), confirm=True)
        for k, candidate in zip(chosen, again, strict=True):
            front[k] = replace(front[k], confirmed=candidate.record)
        stage = partial(_as, progress, "confirm compared designs")
        rivals = computed(named, stage, confirm=True)
        start, *beside = (
            replace(old, confirmed=new.record)
            for old, new in zip([start, *beside], rivals, strict=True)
        )
    return Optimum(
        file=file,
        tried=tuple(tried),
        front=tuple(front),
        start=start,
        beside=tuple(beside),
        generations=generations,
        sweeps=tuple(sweeps),
        wall_s=time.perf_counter() - begin,
    )


def _as(progress: Progress, stage: str, _: str, done: int, total: int) -> None:
    progress(stage, done, total)

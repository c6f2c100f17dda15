"""``swgjoint tune``: tunes the gains of a controller and compares with a textbook rule.

Four controllers are compared on held-out seeds: PD control with gains by the rule, PD
control with tuned gains, the named controller with gains by the rule, and the named
controller with tuned gains. The comparison separates the benefit of feed-forward from
the benefit of tuning. If the named controller is PD itself, only two remain.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.explore.tune.cost import Trace, Trials, environment_named
from swgjoint.explore.tune.gains import (
    CONTROLLERS,
    GainParameter,
    Tunable,
    anti_resonance,
    controller_named,
    gains_of,
    parameters_of,
)
from swgjoint.explore.tune.result import (
    MINUTES,
    GainCandidate,
    Tuned,
    TuneSettings,
    arguments_of,
)
from swgjoint.explore.tune.search import (
    JOURNAL,
    GainSearch,
    read_journal,
    run_search,
    write_journal,
)
from swgjoint.json_text import json_text, plain
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.typing import Array

PD_SHARE = 0.2
"""Fraction of the budget for tuning the two gains of PD control [-]."""
RESERVE = 15.0
"""Part of the wall time reserved for the held-out seeds and the report [s]."""
_PD, _NAMED = "pd", "named"


def tune(
    settings: TuneSettings,
    *,
    folder: Path | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> Tuned:
    """Tune a controller, and a PD controller for comparison.

    Args:
        settings: Controller and budget. With ``evaluations``, the same settings give
            the same result to the last bit; with ``minutes``, the number of candidates
            depends on the machine.
        folder: Folder of the journal, which is written after every generation. If the
            folder contains a journal of the same settings, the run resumes from it.
            None writes no journal.
        resume: Whether a journal must exist.
        progress: Called with the stage, the candidates (or seconds) done and the total.

    Returns:
        The compared controllers with their costs, and the searches.

    Raises:
        InputError: If a name, an argument or the journal is invalid.
        MissingExtraError: If gymnasium or the optimiser is not installed.
    """
    began = time.perf_counter()
    environment = environment_named(settings.environment)
    named, arguments = controller_named(settings.controller), arguments_of(settings)
    tunables = {_PD: CONTROLLERS["pd"]}
    if named.name != "pd":
        tunables[_NAMED] = named
    searches = {name: GainSearch() for name in tunables}
    if folder is None and resume:
        raise InputError(
            "resume without a folder; accepted: with the folder of the run (--out)"
        )
    training, held_out = settings.seeds
    trials = Trials(
        environment, arguments, seeds=training, candidates=settings.population
    )
    header = _header(settings, environment, arguments, trials.joints.drives[0])
    if folder is not None:
        if resume or (folder / JOURNAL).exists():
            searches = read_journal(folder, header, tuple(tunables))
            known = sum(search.evaluations for search in searches.values())
            stage = f"resuming from {folder / JOURNAL}: known candidates"
            progress(stage, known, known)
        folder.mkdir(parents=True, exist_ok=True)
    before = sum(sum(s.seconds) for s in searches.values())

    def elapsed() -> float:
        return time.perf_counter() - began + before

    for name, tunable in tunables.items():
        search = searches[name]
        parameters = parameters_of(tunable, trials.joints)
        share = PD_SHARE if name == _PD and len(tunables) > 1 else 1.0
        budget = _Budget(settings, searches, search, share, elapsed)

        def after(budget: _Budget = budget, tunable: Tunable = tunable) -> None:
            if folder is not None:
                write_journal(folder, header, searches)
            progress(f"tuning {tunable.name}", *budget.shown())

        run_search(
            settings.optimiser,
            search,
            costs=partial(_costs, trials, tunable, parameters),
            more=budget.more,
            start=np.array([p.start for p in parameters]),
            size=settings.population,
            seed=settings.seed,
            clock=time.perf_counter,
            after=after,
        )
    trials.close()
    last = Trials(environment, arguments, seeds=training + held_out, candidates=1)
    joints = last.joints
    candidates: list[GainCandidate] = []
    for name, tunable in tunables.items():
        parameters = parameters_of(tunable, joints)
        neutral = {p.key: np.array([p.neutral]) for p in parameters}
        best = _values(parameters, searches[name].best()[None])
        for label, values in (("by rule", neutral), ("tuned", best)):
            progress("held-out seeds", len(candidates), 2 * len(tunables))
            costs, trace = last.cost_and_traces(tunable, values)
            candidates.append(
                _candidate(
                    label,
                    tunable,
                    values,
                    costs[0],
                    trace,
                    last,
                    settings,
                )
            )
    progress("held-out seeds", len(candidates), len(candidates))
    last.close()
    return Tuned(
        settings=settings,
        environment=environment,
        candidates=tuple(candidates),
        searches=searches,
        parameters=parameters_of(named, joints),
        anti_resonance=anti_resonance(joints),
        error_scale=last.error_scale,
        effort_weight=last.effort_weight,
        worst=last.worst,
        wall=elapsed(),
    )


@dataclass(frozen=True, eq=False)
class _Budget:
    """Budget of a search: a number of candidates, or a time."""

    settings: TuneSettings
    searches: Mapping[str, GainSearch]
    """All searches of the run."""
    search: GainSearch
    """Search that this budget limits."""
    share: float
    """Fraction of the whole budget [-]; 1 for the last search, which gets the rest."""
    elapsed: Any
    """Function that returns the wall time of the run so far [s]."""

    @property
    def _candidates(self) -> int:
        """Largest number of candidates; the last search gets what the first left."""
        s = self.settings
        assert s.evaluations is not None
        if self.share < 1.0:
            return max(s.population, int(self.share * s.evaluations))
        others = sum(one.evaluations for one in self.searches.values())
        return s.evaluations - (others - self.search.evaluations)

    @property
    def _seconds(self) -> float:
        return 60.0 * (self.settings.minutes or MINUTES) - RESERVE

    def more(self) -> bool:
        """Whether another generation is allowed; the first one always is."""
        if not self.search.places:
            return True
        if self.settings.evaluations is not None:
            return self.search.evaluations + self.settings.population <= (
                self._candidates
            )
        one = float(np.median(self.search.seconds))
        spent = sum(self.search.seconds) if self.share < 1.0 else self.elapsed()
        return bool(spent + one <= self.share * self._seconds)

    def shown(self) -> tuple[int, int]:
        """Spent candidates or seconds, and the budget."""
        if self.settings.evaluations is not None:
            return self.search.evaluations, self._candidates
        done = sum(self.search.seconds) if self.share < 1.0 else self.elapsed()
        return int(done), int(max(done + 1, self.share * self._seconds))


def _header(
    settings: TuneSettings,
    environment: str,
    arguments: Mapping[str, Any],
    drive: DriveMap,
) -> dict[str, Any]:
    """Settings that a journal must share with the run that resumes it."""
    # a file of the same path may have changed; provenance does not affect the joint
    moved = json_text(replace(drive, info={}, fields=None), indent=None)
    text: dict[str, Any] = json.loads(
        json.dumps(
            {
                "environment": environment,
                "arguments": plain(arguments),
                "drive_content": hashlib.sha256(moved.encode()).hexdigest()[:16],
                "controller": settings.controller,
                "optimiser": settings.optimiser,
                "seed": settings.seed,
                "population": settings.population,
                "training": settings.training,
            }
        )
    )
    return text


def _values(parameters: tuple[GainParameter, ...], places: Array) -> dict[str, Array]:
    return {p.key: p.value(places[:, k]) for k, p in enumerate(parameters)}


def _costs(
    trials: Trials,
    tunable: Tunable,
    parameters: tuple[GainParameter, ...],
    places: Array,
) -> Array:
    return trials.costs(tunable, _values(parameters, places))


def _candidate(
    label: str,
    tunable: Tunable,
    values: Mapping[str, Array],
    costs: Array,
    trace: Trace,
    trials: Trials,
    settings: TuneSettings,
) -> GainCandidate:
    first = settings.training
    return GainCandidate(
        name=f"{tunable.name} {label}",
        controller=tunable.name,
        values={key: float(x[0]) for key, x in values.items()},
        gains={key: float(x[0]) for key, x in gains_of(values, trials.joints).items()},
        training=costs[:first],
        held_out=costs[first:],
        trace=Trace(
            time=trace.time,
            reference=trace.reference[:, first:],
            error=trace.error[:, first:],
            torque=trace.torque[:, first:],
        ),
    )

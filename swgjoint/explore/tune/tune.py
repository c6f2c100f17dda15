"""``swgjoint tune``: tunes the gains of a controller and compares with a baseline.

Controllers are compared on held-out seeds: the baseline, and the named controller with
its values before and after tuning. In an environment without motor loops, the baseline
is PD control with gains by the textbook rule, and PD control with tuned gains is
compared, too, which separates the benefit of feed-forward from the benefit of tuning.
In others, whose actions are added to motor loops, the baseline is the loop alone.
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
from swgjoint.explore.tune.added import LOOP
from swgjoint.explore.tune.cost import Trace, Trials, arguments_for, environment_named
from swgjoint.explore.tune.gains import (
    CONTROLLERS,
    anti_resonance,
    controller_named,
)
from swgjoint.explore.tune.result import (
    MINUTES,
    GainCandidate,
    Tuned,
    TuneSettings,
)
from swgjoint.explore.tune.search import (
    JOURNAL,
    GainSearch,
    read_journal,
    run_search,
    write_journal,
)
from swgjoint.explore.tune.tunable import GainParameter, Tunable
from swgjoint.flags import check_flags
from swgjoint.json_text import json_text, plain
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
    """Tune a controller, and compare it with a baseline.

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
    check_flags(resume=resume)
    environment = environment_named(settings.environment)
    named = controller_named(settings.controller)
    arguments = arguments_for(
        named, environment, {"randomise": True, **settings.arguments}
    )
    if folder is None and resume:
        raise InputError(
            "resume without a folder; accepted: with the folder of the run (--out)"
        )
    training, held_out = settings.seeds
    trials = Trials(
        environment, arguments, seeds=training, candidates=settings.population
    )
    baseline = CONTROLLERS["pd"] if trials.loop is None else LOOP
    tunables: dict[str, Tunable] = {_PD: baseline, _NAMED: named}
    if named is baseline:
        del tunables[_NAMED]
    parameters = {
        key: one.parameters(trials.joints, trials.loop) for key, one in tunables.items()
    }
    searches = {key: GainSearch() for key, some in parameters.items() if some}
    header = _header(settings, environment, arguments, named, trials)
    if folder is not None:
        if resume or (folder / JOURNAL).exists():
            searches = read_journal(folder, header, tuple(searches))
            known = sum(search.evaluations for search in searches.values())
            stage = f"resuming from {folder / JOURNAL}: known candidates"
            progress(stage, known, known)
        folder.mkdir(parents=True, exist_ok=True)
    before = sum(sum(s.seconds) for s in searches.values())

    def elapsed() -> float:
        return time.perf_counter() - began + before

    for name, search in searches.items():
        tunable = tunables[name]
        share = PD_SHARE if name == _PD and len(searches) > 1 else 1.0
        budget = _Budget(settings, searches, search, share, elapsed)

        def after(budget: _Budget = budget, tunable: Tunable = tunable) -> None:
            if folder is not None:
                write_journal(folder, header, searches)
            progress(f"tuning {tunable.name}", *budget.shown())

        run_search(
            settings.optimiser,
            search,
            costs=partial(_costs, trials, tunable, parameters[name]),
            more=budget.more,
            start=np.array([p.start for p in parameters[name]]),
            size=settings.population,
            seed=settings.seed,
            clock=time.perf_counter,
            after=after,
        )
    trials.close()
    last = Trials(environment, arguments, seeds=training + held_out, candidates=1)
    candidates: list[GainCandidate] = []
    total = len(tunables) + len(searches)
    for name, tunable in tunables.items():
        neutral = {p.key: np.array([p.neutral]) for p in parameters[name]}
        tried = [neutral]
        if name in searches:
            tried.append(_values(parameters[name], searches[name].best()[None]))
        found: list[GainCandidate] = []
        for tuned, values in enumerate(tried):
            progress("held-out seeds", len(candidates) + len(found), total)
            found.append(_candidate(tunable, values, bool(tuned), last, settings))
        # bounds may exclude the values before tuning, such as no integral
        first, best = found[0], found[-1]
        if best.training.mean() > first.training.mean():
            found[-1] = replace(first, name=best.name, tuned=True)
        candidates += found
    progress("held-out seeds", total, total)
    last.close()
    return Tuned(
        settings=settings,
        environment=environment,
        arguments=arguments,
        candidates=tuple(candidates),
        searches=searches,
        parameters=list(parameters.values())[-1],
        anti_resonance=anti_resonance(last.joints),
        unit=last.unit,
        unit_size=last.unit_size,
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
    named: Tunable,
    trials: Trials,
) -> dict[str, Any]:
    """Settings that a journal must share with the run that resumes it."""
    # a file of the same path may have changed; provenance does not affect the joint
    drives = [replace(one, info={}, fields=None) for one in trials.joints.drives]
    moved = "".join(json_text(one, indent=None) for one in drives)
    text: dict[str, Any] = json.loads(
        json.dumps(
            {
                "environment": environment,
                "arguments": plain(arguments),
                "drive_content": _digest(moved),
                "controller": named.name,
                "controller_content": _digest(named.content),
                "optimiser": settings.optimiser,
                "seed": settings.seed,
                "population": settings.population,
                "training": settings.training,
            }
        )
    )
    return text


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


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
    tunable: Tunable,
    values: Mapping[str, Array],
    tuned: bool,
    trials: Trials,
    settings: TuneSettings,
) -> GainCandidate:
    """A controller with its costs on all seeds."""
    first, (costs, trace) = settings.training, trials.cost_and_traces(tunable, values)
    label = "tuned" if tuned else tunable.untuned
    gains = tunable.gains(values, trials.joints)
    return GainCandidate(
        name=f"{tunable.name} {label}".strip(),
        controller=tunable.name,
        values={key: float(x[0]) for key, x in values.items()},
        gains={key: float(x[0]) for key, x in gains.items()},
        tuned=tuned,
        training=costs[0, :first],
        held_out=costs[0, first:],
        trace=Trace(
            time=trace.time,
            reference=trace.reference[:, first:],
            error=trace.error[:, first:],
            torque=trace.torque[:, first:],
        ),
    )

"""Searches in the unit cube that can be resumed after an interruption.

All optimisers are seeded and request whole generations. A journal stores the requested
candidates and their costs. A resumed search starts again from the beginning but takes
the stored costs from the journal, so its result is the same as without interruption.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from swgjoint.errors import InputError, MissingExtraError
from swgjoint.files import read_regular, write_whole
from swgjoint.store import arrays_content, arrays_file, one_line
from swgjoint.typing import Array

Evaluate = Callable[[Array], Array]
"""Maps candidates, shape (n, d), to costs, shape (n,)."""

JOURNAL = "tune.npz"
"""Name of the journal file."""
NEAR = 0.1
"""Standard deviation about the start in the first generation of differential
evolution, relative to the width of the cube [-]."""
STEP = 0.2
"""Initial standard deviation of CMA-ES, relative to the width of the cube [-]."""


class Spent(Exception):
    """The budget of a search is used up."""


class _Failed(Exception):
    """Carries an error of the cost function unchanged through an optimiser."""

    def __init__(self, error: Exception) -> None:
        super().__init__(error)
        self.error = error


@dataclass(kw_only=True, eq=False)
class GainSearch:
    """Generations of one search."""

    places: list[Array] = field(default_factory=list)
    """Candidates of each generation in the unit cube, shape (n, d) each."""
    costs: list[Array] = field(default_factory=list)
    """Costs on every seed [rad or m], shape (n, seeds) each."""
    seconds: list[float] = field(default_factory=list)
    """Wall time of each generation [s]."""

    @property
    def evaluations(self) -> int:
        """Number of candidates so far."""
        return sum(map(len, self.places))

    def best(self) -> Array:
        """Candidate of lowest mean cost in the unit cube, shape (d,)."""
        mean = np.concatenate(self.costs).mean(axis=1)
        return np.asarray(np.concatenate(self.places)[int(mean.argmin())])

    def progress(self) -> Array:
        """Lowest mean cost after every candidate [rad or m], shape (evaluations,)."""
        mean = np.concatenate(self.costs).mean(axis=1)
        return np.asarray(np.minimum.accumulate(mean))


def run_search(
    optimiser: str,
    search: GainSearch,
    *,
    costs: Callable[[Array], Array],
    more: Callable[[], bool],
    start: Array,
    size: int,
    seed: int,
    clock: Callable[[], float],
    after: Callable[[], None],
) -> None:
    """Continue a search until its budget is spent.

    Args:
        optimiser: Key of :data:`OPTIMISERS`.
        search: Generations known so far; new ones are appended.
        costs: Function from candidates, shape (n, d), to costs, shape (n, seeds).
        more: Function that returns whether another generation is allowed.
        start: Member of the first generation, shape (d,).
        size: Number of candidates in a generation.
        seed: Seed of the optimiser.
        clock: Function that returns the present time [s].
        after: Called after every new generation.

    Raises:
        InputError: If the journal belongs to another search.
    """
    done = 0

    def evaluate(places: Array) -> Array:
        nonlocal done
        places = np.clip(places, 0.0, 1.0)
        if done == len(search.places):
            if not more():
                raise Spent
            began = clock()
            got = costs(places)
            search.places.append(places.copy())
            search.costs.append(got)
            search.seconds.append(clock() - began)
            after()
        elif not np.array_equal(search.places[done], places):
            raise InputError(
                f"{JOURNAL} belongs to another search (generation {done + 1} differs);"
                " accepted: the versions of swgjoint, scipy, cma and optuna that wrote"
                " it"
            )
        done += 1
        return np.asarray(search.costs[done - 1].mean(axis=1))

    def guarded(places: Array) -> Array:
        try:
            return evaluate(places)
        # scipy would replace these errors, including InputError, with its own
        except (TypeError, ValueError) as error:
            raise _Failed(error) from None

    try:
        OPTIMISERS[optimiser](guarded, start, size, seed)
    except Spent:
        pass
    except _Failed as failed:
        raise failed.error from None


def _differential_evolution(
    evaluate: Evaluate, start: Array, size: int, seed: int
) -> None:
    from scipy.optimize import differential_evolution

    rng = np.random.default_rng(seed)
    shape = (size, start.size)
    # Latin hypercube; half of it is replaced with the start and its neighbourhood
    strata = np.tile(np.arange(size)[:, None], start.size)
    first = (rng.permuted(strata, axis=0) + rng.uniform(size=shape)) / size
    near = start + NEAR * rng.standard_normal((size // 2, start.size))
    first[: len(near)] = np.clip(near, 0.0, 1.0)
    first[0] = start
    differential_evolution(
        lambda columns: evaluate(columns.T),
        bounds=[(0.0, 1.0)] * start.size,
        init=first,
        maxiter=10**6,
        tol=0.0,
        atol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
        seed=rng,
    )


def _cma(evaluate: Evaluate, start: Array, size: int, seed: int) -> None:
    try:
        import cma
    except ImportError:
        raise _missing("CMA-ES", "cma") from None
    rng = np.random.default_rng(seed)
    strategy = cma.CMAEvolutionStrategy(
        start,
        STEP,
        {
            "bounds": [0.0, 1.0],
            "popsize": size,
            # NaN and randn: draw from rng, not from numpy's global generator
            "seed": float("nan"),
            "randn": lambda *shape: rng.standard_normal(shape),
            "verbose": -9,
        },
    )
    strategy.inject([start], force=True)
    while not strategy.stop():
        places = strategy.ask()
        strategy.tell(places, evaluate(np.array(places)).tolist())


def _optuna(evaluate: Evaluate, start: Array, size: int, seed: int) -> None:
    try:
        import optuna
    except ImportError:
        raise _missing("optimiser optuna", "optuna") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    names = [f"x{k}" for k in range(start.size)]
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
    study.enqueue_trial(dict(zip(names, start.tolist(), strict=True)))
    while True:
        trials = [study.ask() for _ in range(size)]
        places = np.array(
            [[t.suggest_float(x, 0.0, 1.0) for x in names] for t in trials]
        )
        for trial, cost in zip(trials, evaluate(places), strict=True):
            study.tell(trial, float(cost))


def _missing(what: str, package: str) -> MissingExtraError:
    return MissingExtraError(
        f"{what} needs {package}: pip install 'swgjoint[tune]'; or use optimiser de"
    )


OPTIMISERS: dict[str, Callable[[Evaluate, Array, int, int], None]] = {
    "de": _differential_evolution,
    "cma": _cma,
    "optuna": _optuna,
}
"""Optimisers by key: differential evolution (scipy), CMA-ES (cma) and tree-structured
Parzen estimator (optuna)."""


def write_journal(
    folder: Path, header: Mapping[str, Any], searches: Mapping[str, GainSearch]
) -> Path:
    """Write all searches atomically.

    Args:
        folder: Folder of the journal.
        header: Settings that a resumed run must share.
        searches: Searches by name.

    Returns:
        Path of the journal.
    """
    arrays: dict[str, Any] = {"header": json.dumps(header, sort_keys=True)}
    for name, search in searches.items():
        if search.places:
            arrays[f"{name}.places"] = np.stack(search.places)
            arrays[f"{name}.costs"] = np.stack(search.costs)
            arrays[f"{name}.seconds"] = np.array(search.seconds)
    return write_whole(folder / JOURNAL, arrays_file(arrays))


def read_journal(
    folder: Path, header: Mapping[str, Any], names: tuple[str, ...]
) -> dict[str, GainSearch]:
    """Read the searches of a run to resume.

    Args:
        folder: Folder of the journal.
        header: Settings of the resumed run.
        names: Names of the searches.

    Returns:
        Searches by name.

    Raises:
        InputError: If there is no journal, it cannot be read, or its settings differ.
    """
    path = folder / JOURNAL
    try:
        arrays = arrays_content(read_regular(path))
        kept = json.loads(str(arrays["header"]))
        if not isinstance(kept, dict):
            raise ValueError("the header is not an object")
        found = {name: _search(arrays, name) for name in names}
    except FileNotFoundError:
        raise InputError(
            f"{path}: nothing to resume; accepted: --out of an interrupted run"
        ) from None
    except Exception as error:  # a damaged file may raise any error
        raise InputError(
            f"{path} is not a journal of a tuning run: {one_line(error)}; accepted:"
            " another --out"
        ) from None
    for key, value in header.items():
        if kept.get(key) != value:
            raise InputError(
                f"{path} was written with {key} {kept.get(key)!r}, not {value!r};"
                " accepted: the same settings and files, or another --out"
            )
    return found


def _search(arrays: Mapping[str, Array], name: str) -> GainSearch:
    if f"{name}.places" not in arrays:
        return GainSearch()
    places, costs, seconds = (
        arrays[f"{name}.{key}"] for key in ("places", "costs", "seconds")
    )
    whole = places.shape[:2] == costs.shape[:2] and seconds.shape == places.shape[:1]
    if not (whole and places.ndim == costs.ndim == 3 and np.isfinite(costs).all()):
        raise ValueError(f"{name}: generations and costs do not match")
    return GainSearch(
        places=list(places), costs=list(costs), seconds=[float(s) for s in seconds]
    )

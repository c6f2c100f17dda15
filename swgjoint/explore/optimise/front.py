"""Which designs of a search no other one beats, and which of them are far apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swgjoint.explore.optimise.file import Objective, OptimisationFile
from swgjoint.explore.sweep.figures import Record
from swgjoint.explore.sweep.points import Values
from swgjoint.gear.design.design import Design
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A design and what came of it."""

    values: Values
    """Values of the parameters by column, or the name of a compared design."""
    design: Design | None
    """None where the values make none."""
    record: Record
    confirmed: Record | None = None
    """With the care of the confirmation; None where that was not asked for."""


def objectives_of(file: OptimisationFile, candidates: Sequence[Candidate]) -> Array:
    """What is to be small, of designs with figures (n, m)."""
    return np.array([[_signed(c, o) for o in file.objectives] for c in candidates])


def _signed(candidate: Candidate, objective: Objective) -> float:
    value = candidate.record.figures[objective.figure]
    assert value is not None  # of designs with figures
    return objective.sign * value


def front_of(file: OptimisationFile, candidates: Sequence[Candidate]) -> list[int]:
    """Numbers of the designs that no other one beats, by the first objective.

    Of designs with figures within the limits; of equal values the first counts.
    """
    names = [o.figure for o in file.objectives]
    known = [
        k
        for k, c in enumerate(candidates)
        if c.record.ok
        and all(c.record.figures.get(name) is not None for name in names)
        and not any(file.violations(c.record.figures).values())
    ]
    if not known:
        return []
    values = objectives_of(file, [candidates[k] for k in known])
    _, firsts = np.unique(values, axis=0, return_index=True)
    kept = [k for k in sorted(firsts) if not _beaten(values, k)]
    kept.sort(key=lambda k: tuple(values[k]))
    return [known[k] for k in kept]


def _beaten(values: Array, k: int) -> bool:
    """Whether a row is nowhere better and somewhere worse than another one."""
    no_worse = np.all(values <= values[k], axis=1)
    return bool(np.any(no_worse & np.any(values < values[k], axis=1)))


def pick_spread(values: Array, count: int) -> list[int]:
    """Rows that are the best of every column, then those farthest from the chosen."""
    width = np.ptp(values, axis=0)
    scaled = values / np.where(width > 0.0, width, 1.0)
    chosen = list(dict.fromkeys(np.argmin(values, axis=0).tolist()))[:count]
    while len(chosen) < min(count, len(values)):
        apart = np.linalg.norm(scaled[:, None] - scaled[chosen], axis=2).min(axis=1)
        apart[chosen] = -1.0
        chosen.append(int(np.argmax(apart)))
    return chosen


def not_worse(file: OptimisationFile, one: Candidate, other: Candidate) -> bool:
    """Whether a design is as good as another in every objective, as far as is known.

    By the confirmation where both have one, else by the search.
    """
    records = [one.record, other.record]
    confirmed = [one.confirmed, other.confirmed]
    if any(record is not None and not record.ok for record in confirmed):
        return False  # it did not stand the care
    if all(record is not None and record.ok for record in confirmed):
        records = [record for record in confirmed if record is not None]
    for objective in file.objectives:
        mine, theirs = (record.figures.get(objective.figure) for record in records)
        if mine is None or theirs is None:
            return False
        if objective.sign * mine > objective.sign * theirs:
            return False
    return True

"""The Pareto front of a search, and a well-spread selection from it."""

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
    """A design and its results."""

    values: Values
    """Values of the parameters by column; for the start and the designs to compare
    with, the reference of the design under key ``design``."""
    design: Design | None
    """None if the values give no valid design."""
    record: Record
    confirmed: Record | None = None
    """Results of the confirmation; None if it was not requested."""


def objectives_of(file: OptimisationFile, candidates: Sequence[Candidate]) -> Array:
    """Objectives to minimise, shape (n, m).

    Args:
        file: File with the objectives.
        candidates: Designs with figures, n of them.
    """
    return np.array([[_signed(c, o) for o in file.objectives] for c in candidates])


def _signed(candidate: Candidate, objective: Objective) -> float:
    value = candidate.record.figures[objective.figure]
    assert value is not None  # the caller selects designs with figures
    return objective.sign * value


def front_of(file: OptimisationFile, candidates: Sequence[Candidate]) -> list[int]:
    """Indices of the Pareto-optimal designs, sorted by the first objective.

    Only designs with all objectives known and within the limits count. Of designs with
    equal objectives, only the first one counts.

    Args:
        file: File with objectives and limits.
        candidates: Designs.
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
    """Whether another row dominates row k: nowhere worse and somewhere better."""
    no_worse = np.all(values <= values[k], axis=1)
    return bool(np.any(no_worse & np.any(values < values[k], axis=1)))


def pick_spread(values: Array, count: int) -> list[int]:
    """Select the best row of every column, then those farthest from selected rows.

    Distances are measured with every objective divided by its range.

    Args:
        values: Objectives to minimise, shape (n, m).
        count: Number of rows to select.

    Returns:
        Indices of the rows, in the order of their selection.
    """
    width = np.ptp(values, axis=0)
    scaled = values / np.where(width > 0.0, width, 1.0)
    chosen = list(dict.fromkeys(np.argmin(values, axis=0).tolist()))[:count]
    while len(chosen) < min(count, len(values)):
        apart = np.linalg.norm(scaled[:, None] - scaled[chosen], axis=2).min(axis=1)
        apart[chosen] = -1.0
        chosen.append(int(np.argmax(apart)))
    return chosen


def not_worse(file: OptimisationFile, one: Candidate, other: Candidate) -> bool:
    """Whether a design is at least as good as another one in every objective.

    Confirmed figures are compared if both designs have them, else the figures of the
    search. The answer is no if an objective of either design is unknown, or if the
    confirmation of either design failed.

    Args:
        file: File with the objectives.
        one: The design.
        other: Design to compare with.
    """
    records = [one.record, other.record]
    confirmed = [one.confirmed, other.confirmed]
    if any(record is not None and not record.ok for record in confirmed):
        return False  # the more accurate computation has no figures
    if all(record is not None and record.ok for record in confirmed):
        records = [record for record in confirmed if record is not None]
    for objective in file.objectives:
        mine, theirs = (record.figures.get(objective.figure) for record in records)
        if mine is None or theirs is None:
            return False
        if objective.sign * mine > objective.sign * theirs:
            return False
    return True


def beats(file: OptimisationFile, one: Candidate, other: Candidate) -> bool:
    """Whether a design within the limits is better than another one.

    It is not worse in any objective, and better in at least one, see :func:`not_worse`.

    Args:
        file: File with objectives and limits.
        one: The design.
        other: Design to compare with.
    """
    confirmed = one.confirmed is not None and one.confirmed.ok
    record = one.confirmed if confirmed and one.confirmed is not None else one.record
    if any(file.violations(record.figures).values()):
        return False
    return not_worse(file, one, other) and not not_worse(file, other, one)

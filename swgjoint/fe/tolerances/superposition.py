"""Superposition of many sets of errors at one position of the drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swgjoint.fe.common.influence import Influence, Response
from swgjoint.fe.common.pivot_base import similar_sets
from swgjoint.fe.tolerances.near_contacts import NearContacts
from swgjoint.fe.tolerances.state_guess import StateGuess
from swgjoint.typing import Array, Index, Mask

FIRST = 1024
"""Number of sets of errors from whose solutions the guesses for all others are learned.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Superposed:
    """Equilibria with many sets of errors, see :class:`Response`."""

    output_angle: Array
    """Output angles (n_sets,) [rad]."""
    potential: Array
    """Potential relative to the equilibrium at which the drive is linearised (n_sets,)
    [J]."""
    compliance: Array
    """Compliances (n_sets,) [rad/(N·m)]."""
    active: Mask
    """Contacts whose state differs from that in the perfect drive (n_sets, m)."""
    features: Array | None = None
    """What is known for guesses under other torques (n_sets, n_features), see
    :class:`swgjoint.fe.tolerances.state_guess.StateGuess`; None if nothing was learned.
    """


def superpose_plainly(
    at: Influence,
    gap_change: Array,
    torque: float,
    start: Mask | None,
    *,
    chunk: int,
    tick: Callable[[], None],
) -> Superposed:
    """Equilibria with all sets of errors, chunk by chunk.

    Args:
        at: The linearised drive.
        gap_change: Gap changes (n_sets, n) [m].
        torque: Torque T [N·m].
        start: Active contacts under another torque (n_sets, m), or None.
        chunk: Number of sets of a chunk.
        tick: Called after every chunk.
    """
    parts = []
    for k in range(0, len(gap_change), chunk):
        part = slice(k, k + chunk)
        begin = None if start is None else start[part]
        found = at.respond(gap_change[part], torque, begin)
        parts.append(replace(found, margin=None, approach=None))  # which are large
        tick()
    return Superposed(
        output_angle=np.concatenate([part.output_angle for part in parts]),
        potential=np.concatenate([part.potential for part in parts]),
        compliance=np.concatenate([part.compliance for part in parts]),
        active=np.concatenate([part.active for part in parts]),
    )


def superpose_many(
    at: Influence,
    gap_change: Array,
    torque: float,
    known: Sequence[Array],
    *,
    chunk: int,
    tick: Callable[[], None],
) -> Superposed:
    """The same results, with guesses and without the contacts that never change.

    The first sets show which contacts change their state at all and how their state
    depends on the gap changes and on solutions nearby. Similar sets are solved
    together.

    Args:
        at: The linearised drive.
        gap_change: Gap changes (n_sets, n) [m].
        torque: Torque T [N·m].
        known: Features of solutions nearby, each (n_sets, n_features).
        chunk: Number of sets of a chunk; there must be several chunks.
        tick: Called after every chunk.
    """
    count = len(gap_change)
    first = np.arange(0, count, -(-count // FIRST))
    others = np.delete(np.arange(count), first)
    result = Superposed(
        output_angle=np.empty(count),
        potential=np.empty(count),
        compliance=np.empty(count),
        active=np.zeros((count, len(at.closed)), dtype=bool),
    )

    def take(rows: Index, found: Response) -> Array:
        """Store the results of some sets; returns the margins."""
        for key in ("output_angle", "potential", "compliance"):
            getattr(result, key)[rows] = getattr(found, key)
        assert found.margin is not None
        return found.margin

    def solve(rows: Index, start: Mask | None) -> Array:
        """Solve some sets with all contacts; returns the margins."""
        found = at.respond(gap_change[rows], torque, start)
        result.active[rows] = found.active
        return take(rows, found)

    margin = solve(first, None)
    near = NearContacts.choose(at, np.asarray((margin > 0.0).any(axis=0)))
    margin = margin[:, near.contacts]
    change = gap_change[:, near.teeth]
    sound = np.isfinite(margin).all(axis=1)
    learn = first[sound]
    guess = StateGuess.fit(change[learn], [one[learn] for one in known], margin[sound])
    features = np.empty((count, int(guess.varied.sum())))
    features[first] = guess.features(margin)
    sets, order = None, np.arange(others.size)
    if known:
        # without solutions nearby, similar problems are a better guess
        sets = guess.active(change[others], [one[others] for one in known])
        order = np.concatenate(similar_sets(sets, chunk))
    for part in np.array_split(order, -(-count // chunk)):
        rows = others[part]
        start = None if sets is None else sets[part]
        found, right = near.respond(gap_change[rows], torque, start)
        features[rows] = guess.features(take(rows, found))
        result.active[np.ix_(rows, near.contacts)] = found.active
        wrong = rows[~right]
        if wrong.size:
            margin = solve(wrong, result.active[wrong])
            features[wrong] = guess.features(margin[:, near.contacts])
        tick()
    return replace(result, features=features)

"""Superposition of many sets of errors at one position of the drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swgjoint.fe.common.influence import Influence, Response
from swgjoint.fe.common.pivot_base import similar_sets
from swgjoint.fe.common.strip_problems import TOGETHER
from swgjoint.fe.tolerances.near_contacts import NearContacts
from swgjoint.fe.tolerances.state_guess import Features, StateGuess
from swgjoint.typing import Array, Index, Mask

FIRST = 1024
"""Number of sets of errors from whose solutions the guesses for all others are learned.
"""
SEEDS = 8
"""Every so many of them are solved with all contacts, without a guess. The others have
the contacts that come within a standard deviation of a change in these: one in a
hundred of size-25-100-bought needs further ones."""


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
    features: Features | None = None
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
        # without what is large
        parts.append(replace(found, margin=None, approach=None, force=None))
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
    known: Sequence[Features],
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

    def solve(rows: Index, start: Mask | None) -> tuple[Array, Array | None]:
        """Solve some sets with all contacts; returns the margins and strip forces."""
        found = at.respond(gap_change[rows], torque, start)
        result.active[rows] = found.active
        return take(rows, found), found.force

    def solve_near(near: NearContacts, rows: Index, start: Mask | None) -> Array:
        """Solve some sets with few contacts, and with all if these are too few.

        Returns:
            Margins of the few contacts (n_rows, k).
        """
        found, right = near.respond(gap_change[rows], torque, start)
        result.active[np.ix_(rows, near.contacts)] = found.active
        margin = take(rows, found)
        if not right.all():
            again, _ = solve(rows[~right], result.active[rows[~right]])
            margin[~right] = again[:, near.contacts]
        return margin

    # what the first sets show; contacts that are left out count as far apart
    seeds = np.arange(first.size) % SEEDS == 0
    seen, force = solve(first[seeds], None)
    changing = np.asarray(seen.max(axis=0) > -seen.std(axis=0))
    near = NearContacts.choose(at, changing, force)
    usual = (seen[:, near.contacts] > 0.0).mean(axis=0) > 0.5
    margin = np.full((first.size, len(at.closed)), -np.inf)
    margin[seeds] = seen
    margin[np.ix_(~seeds, near.contacts)] = solve_near(
        near, first[~seeds], np.tile(usual, (int((~seeds).sum()), 1))
    )
    changing = np.asarray(result.active[first].any(axis=0))
    near = NearContacts.choose(at, changing, force)
    margin = margin[:, near.contacts]
    change = gap_change[:, near.teeth]
    sound = ~np.isnan(margin).any(axis=1)
    learn = first[sound]
    guess = StateGuess.fit(change[learn], [one[learn] for one in known], margin[sound])
    features = np.empty((count, int(guess.varied.sum())), dtype=np.int8)
    features[first] = guess.features(margin)

    # all others
    sets, order = None, np.arange(others.size)
    if known:
        # without solutions nearby, similar problems are a better guess
        sets = guess.active(change[others], [one[others] for one in known])
        order = np.concatenate(similar_sets(sets, TOGETHER))
    for part in np.array_split(order, -(-count // chunk)):
        rows, start = others[part], None if sets is None else sets[part]
        features[rows] = guess.features(solve_near(near, rows, start))
        tick()
    return replace(result, features=features)

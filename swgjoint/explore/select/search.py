r"""The cheapest set of one option per joint whose predicted figures keep their bounds.

The squared prediction of a figure is the quadratic form

.. math:: p^2 = \sum_{i,j} G_{i c_i, j c_j}

of the options :math:`c_i` of the joints. Sets are built joint by joint, the one with
the least cost so far first. A partial set is dropped when even the smallest term of
every pair that is still open exceeds a bound, so no set that keeps the bounds is lost.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import count, pairwise

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.typing import Array

MOST_NODES = 100_000
"""Largest number of partial sets that one search extends."""

Cost = tuple[Decimal, Decimal]
"""Cost, and the value that orders sets of equal cost; both add up over the joints."""

_Node = tuple[Cost, int, int, tuple[int, ...], tuple[float, ...], tuple[Array, ...]]
"""Least cost of a partial set, minus the number of its joints, the number of the node,
the options, and for every bound the value of the form and the sums of its rows, both
without those of the last option in the latter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class QuadraticBound:
    """Largest accepted value of a quadratic form of the options."""

    form: Array
    """Symmetric matrix G over the options of all joints, joint by joint. Shape
    (n_options, n_options)."""
    largest: float
    """Largest accepted value, in the unit of the matrix."""


class SetSearch:
    """Search over the options of all joints, see the module.

    Args:
        costs: Cost of every option, by joint.
        bounds: Bounds that a set must keep.
    """

    def __init__(
        self, costs: Sequence[Sequence[Cost]], bounds: Sequence[QuadraticBound] = ()
    ) -> None:
        given = _slices(costs)

        def influence(j: int) -> float:
            terms = (np.diag(b.form)[given[j]].max(initial=0.0) for b in bounds)
            return max(
                (float(t) / b.largest for t, b in zip(terms, bounds, strict=True)),
                default=0.0,
            )

        # joints of large terms come first, so that sets are dropped early
        self._order = sorted(range(len(costs)), key=influence, reverse=True)
        rows = [k for j in self._order for k in range(given[j].start, given[j].stop)]
        self._costs = [costs[j] for j in self._order]
        self._slices = _slices(self._costs)
        self._bounds = [
            QuadraticBound(form=b.form[np.ix_(rows, rows)], largest=b.largest)
            for b in bounds
        ]

    def find_cheapest(
        self,
        skipped: Collection[tuple[int, ...]] = (),
        is_possible: Callable[[dict[int, int]], bool] = lambda options: True,
    ) -> tuple[int, ...] | None:
        """Index of the chosen option by joint; None if no set keeps the bounds.

        Args:
            skipped: Sets that are not accepted.
            is_possible: Function of the options of some joints that returns whether a
                set with them can be accepted.

        Raises:
            ComputationError: If the search is longer than :data:`MOST_NODES`.
        """
        joints = range(len(self._costs))
        if not all(self._costs):
            return None
        least = [min(options) for options in self._costs]
        rest = [_sum(least[k:]) for k in (*joints, len(least))]
        opened = [self._open_pairs(bound.form) for bound in self._bounds]
        none = tuple(np.zeros(len(bound.form)) for bound in self._bounds)
        heap: list[_Node] = [(rest[0], 0, 0, (), (0.0,) * len(none), none)]
        number, nodes = count(1), 0
        while heap:
            cost, _, _, chosen, values, before = heapq.heappop(heap)
            depth = len(chosen)
            if depth and not is_possible(dict(zip(self._order, chosen, strict=False))):
                continue
            if depth == len(self._costs):
                found = tuple(chosen[self._order.index(j)] for j in joints)
                if found not in skipped:
                    return found
                continue
            nodes += 1
            if nodes > MOST_NODES:
                raise ComputationError(
                    f"no set is found among the first {MOST_NODES} partial sets; use"
                    " fewer drives or joints, or a wider limit"
                )
            crossed = before
            if depth:
                row = self._slices[depth - 1].start + chosen[-1]
                crossed = tuple(
                    cross + bound.form[row]
                    for bound, cross in zip(self._bounds, before, strict=True)
                )
            place = self._slices[depth]
            fits = np.ones(len(self._costs[depth]), dtype=bool)
            sums = []
            for bound, value, cross, pairs in zip(
                self._bounds, values, crossed, opened, strict=True
            ):
                own = value + np.diag(bound.form)[place] + 2.0 * cross[place]
                sums.append(own)
                fits &= own + self._complete(bound.form, cross, depth, pairs) <= (
                    bound.largest
                )
            for option in np.flatnonzero(fits).tolist():
                total = _sum([_less(cost, least[depth]), self._costs[depth][option]])
                terms = tuple(float(own[option]) for own in sums)
                node = (*chosen, option)
                heapq.heappush(
                    heap, (total, -len(node), next(number), node, terms, crossed)
                )
        return None

    def _open_pairs(self, form: Array) -> NDArray[np.float64]:
        """Least sum over pairs of joints from a depth on. Shape (n_joints + 1,)."""
        n = len(self._slices)
        least = np.zeros(n + 1)
        for k in reversed(range(n)):
            pairs = (form[self._slices[k], s].min() for s in self._slices[k + 1 :])
            least[k] = least[k + 1] + 2.0 * sum(pairs)
        return least

    def _complete(self, form: Array, cross: Array, depth: int, pairs: Array) -> Array:
        """Least value that the joints after this one add, by its option."""
        place = self._slices[depth]
        added = np.full(place.stop - place.start, pairs[depth + 1])
        diagonal = np.diag(form)
        for s in self._slices[depth + 1 :]:
            own = diagonal[s] + 2.0 * (cross[s] + form[place, s])
            added += own.min(axis=1)
        return added


def predict_squared(form: Array, sizes: Sequence[int], chosen: Sequence[int]) -> float:
    """Value of a quadratic form for one set.

    Args:
        form: Matrix of the form, see :class:`QuadraticBound`.
        sizes: Number of options by joint.
        chosen: Index of the option by joint.
    """
    rows = np.cumsum([0, *sizes])[:-1] + np.array(chosen)
    return float(form[np.ix_(rows, rows)].sum())


def descend(
    form: Array,
    sizes: Sequence[int],
    allowed: Sequence[Sequence[int]],
    start: Sequence[int],
) -> tuple[int, ...]:
    """Set with a small value of a form, changed joint by joint until nothing helps.

    Args:
        form: Matrix of the form, see :class:`QuadraticBound`.
        sizes: Number of options by joint.
        allowed: Options that a joint may get.
        start: Set to start from.
    """
    chosen = list(start)
    least, better = predict_squared(form, sizes, chosen), True
    while better:
        better = False
        for j, own in enumerate(allowed):
            for k in own:
                trial = [*chosen[:j], k, *chosen[j + 1 :]]
                value = predict_squared(form, sizes, trial)
                if value < least * (1.0 - 1e-9):
                    chosen, least, better = trial, value, True
    return tuple(chosen)


def _slices(costs: Sequence[Sequence[Cost]]) -> list[slice]:
    """Rows of the options of every joint in a form."""
    first = np.cumsum([0, *map(len, costs)])
    return [slice(a, b) for a, b in pairwise(first.tolist())]


def _sum(costs: Sequence[Cost]) -> Cost:
    return sum((c for c, _ in costs), Decimal(0)), sum(
        (t for _, t in costs), Decimal(0)
    )


def _less(cost: Cost, other: Cost) -> Cost:
    return cost[0] - other[0], cost[1] - other[1]

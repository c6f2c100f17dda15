r"""The cheapest set of one option per joint whose predicted figures keep their bounds.

The squared prediction of a figure is the quadratic form

.. math:: p^2 = \sum_{i,j} G_{i c_i, j c_j}

of the options :math:`c_i` of the joints. Sets are built joint by joint, the one with
the least cost so far first. A partial set is dropped when even the smallest term of
every pair that is still open exceeds a bound, so no set that keeps the bounds is lost.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from decimal import Decimal
from itertools import count, pairwise

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import ComputationError
from swgjoint.typing import Array

MOST_NODES = 300_000
"""Largest number of partial sets that one search extends."""

Cost = tuple[Decimal, Decimal]
"""Cost, and the value that orders sets of equal cost; both add up over the joints."""

_Node = tuple[Cost, int, tuple[int, ...], tuple[float, ...], list[Array]]
"""Least cost of a partial set, its number, the options, and for every bound the value
so far and the sums of the rows of the chosen options."""


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
        self._costs, self._bounds = costs, bounds
        first = np.cumsum([0, *map(len, costs)])
        self._slices = [slice(a, b) for a, b in pairwise(first.tolist())]

    def find_cheapest(
        self, skipped: Collection[tuple[int, ...]] = ()
    ) -> tuple[int, ...] | None:
        """Index of the chosen option by joint; None if no set keeps the bounds.

        Args:
            skipped: Sets that are not accepted.

        Raises:
            ComputationError: If the search is longer than :data:`MOST_NODES`.
        """
        joints = range(len(self._costs))
        if not all(self._costs):
            return None
        least = [min(options) for options in self._costs]
        rest = [_sum(least[k:]) for k in (*joints, len(least))]
        opened = [self._open_pairs(bound.form) for bound in self._bounds]
        number = count()
        start = [np.zeros(len(bound.form)) for bound in self._bounds]
        heap: list[_Node] = [(rest[0], next(number), (), (0.0,) * len(start), start)]
        nodes = 0
        while heap:
            cost, _, chosen, values, crossed = heapq.heappop(heap)
            depth = len(chosen)
            if depth == len(self._costs):
                if chosen not in skipped:
                    return chosen
                continue
            nodes += 1
            if nodes > MOST_NODES:
                raise ComputationError(
                    f"no set is found among the first {MOST_NODES} partial sets; use"
                    " fewer drives or joints, or a wider limit"
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
                row = place.start + option
                here = self._costs[depth][option]
                heapq.heappush(
                    heap,
                    (
                        _sum([_less(cost, least[depth]), here]),
                        next(number),
                        (*chosen, option),
                        tuple(float(own[option]) for own in sums),
                        [
                            cross + bound.form[row]
                            for bound, cross in zip(self._bounds, crossed, strict=True)
                        ],
                    ),
                )
        return None

    def predict_squared(self, form: Array, chosen: Sequence[int]) -> float:
        """Value of a quadratic form for one set.

        Args:
            form: Matrix of the form, see :class:`QuadraticBound`.
            chosen: Index of the option by joint.
        """
        rows = [s.start + c for s, c in zip(self._slices, chosen, strict=True)]
        return float(form[np.ix_(rows, rows)].sum())

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


def _sum(costs: Sequence[Cost]) -> Cost:
    return sum((c for c, _ in costs), Decimal(0)), sum(
        (t for _, t in costs), Decimal(0)
    )


def _less(cost: Cost, other: Cost) -> Cost:
    return cost[0] - other[0], cost[1] - other[1]

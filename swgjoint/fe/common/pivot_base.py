"""Complementarity problems relative to an active set near their solutions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index, Mask

FloatArray = NDArray[np.float32] | NDArray[np.float64]
DIRECTIONS = 16
"""Number of random directions in which the similarity of problems is judged."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Base:
    """Scaled problems in which some unknowns have changed places with their slacks.

    With the base near the solutions, few unknowns are active: only those in which a
    solution differs from it. (A principal pivot transform; Cottle, Pang and Stone
    (1992), "The linear complementarity problem", section 2.3.)
    """

    inside: Index
    """Unknowns that have changed places."""
    columns: Index
    """Offsets on which others depend (k,)."""
    forward: Array
    """Change of the offset q, without those of the unknowns inside, per offset of
    these columns (m, k)."""
    matrix: Array
    """Matrix (m, m)."""
    by_strip: Array
    """Change of the offset per approach of a strip (m, n_strips)."""
    by_load: Array
    """Change of the offset per unit of load (m,)."""
    by_value: Array
    """Change of the output per unknown (m,)."""
    output_by_strip: Array
    """Change of the output per approach of a strip (n_strips,)."""
    slope: float
    """Change of the output per unit of load while all unknowns are inactive."""
    line: Array
    """Compliances that are added to the lines of the strips (n_strips,) [m/N]."""

    def offset_of(self, offset: Array) -> Array:
        """Offsets of problems after the exchange.

        Args:
            offset: Scaled offsets q of the original problems (n_problems, m).
        """
        changed = offset.copy()
        if self.columns.size:
            changed[:, self.inside] = 0.0
            changed += offset[:, self.columns] @ self.forward.T
        return changed

    def with_lines(self, line: Array, by_slack: Array, by_value: Array) -> Base:
        """The same problems, with other lines in place of the law of the strips.

        Args:
            line: Compliances to add to the lines (n_strips,) [m/N].
            by_slack: Force of each strip per slack (n_strips, m) [N].
            by_value: Force of each strip per unknown (n_strips, m) [N].
        """
        assert not self.columns.size
        # an approach B c, c = line F + c', with the forces F = by_slack w + by_value v
        columns = np.flatnonzero(by_slack.any(axis=0))
        taken = self.by_strip * line
        system = np.eye(len(self.matrix)) - taken @ by_slack
        matrix, by_strip, by_load, forward = np.split(
            np.linalg.solve(
                system,
                np.column_stack(
                    [
                        self.matrix + taken @ by_value,
                        self.by_strip,
                        self.by_load,
                        taken @ by_slack[:, columns],
                    ]
                ),
            ),
            np.cumsum([len(self.matrix), len(line), 1]),
            axis=1,
        )
        output = line * self.output_by_strip
        along = output @ by_slack
        return replace(
            self,
            columns=columns,
            forward=forward,
            matrix=matrix,
            by_strip=by_strip,
            by_load=by_load[:, 0],
            by_value=self.by_value + output @ by_value + along @ matrix,
            output_by_strip=self.output_by_strip + along @ by_strip,
            slope=self.slope + float(along @ by_load[:, 0]),
            line=self.line + line,
        )

    def exchange(self, active: Mask) -> Base:
        """The problems in which the active unknowns have changed places.

        Args:
            active: Unknowns to exchange (m,).
        """
        inside, outside = np.flatnonzero(active), np.flatnonzero(~active)
        inverse = np.linalg.inv(self.matrix[np.ix_(inside, inside)])
        forward = np.empty((len(active), inside.size))
        forward[inside] = -inverse
        forward[outside] = -self.matrix[np.ix_(outside, inside)] @ inverse
        # the columns of the other unknowns, of the load and of the strips
        columns = np.column_stack(
            [self.matrix[:, outside], self.by_load, self.by_strip]
        )
        known = columns[inside]
        columns[inside] = 0.0
        columns += forward @ known
        outputs = self.by_value[inside] @ columns[inside]
        outputs[: outside.size] += self.by_value[outside]
        matrix, by_value = np.empty_like(self.matrix), np.empty_like(self.by_value)
        matrix[:, inside], matrix[:, outside] = -forward, columns[:, : outside.size]
        by_value[inside] = -self.by_value[inside] @ forward[inside]
        by_value[outside] = outputs[: outside.size]
        before = forward @ self.forward[inside]
        before[outside] += self.forward[outside]
        return replace(
            self,
            inside=inside,
            columns=np.concatenate([inside, self.columns]),
            forward=np.column_stack([forward, before]),
            matrix=matrix,
            by_load=columns[:, outside.size],
            by_strip=columns[:, outside.size + 1 :],
            by_value=by_value,
            output_by_strip=self.output_by_strip + outputs[outside.size + 1 :],
            slope=self.slope + float(outputs[outside.size]),
        )


def similar_parts(offset: Array, size: int) -> list[Index]:
    """Parts of similar problems, consecutive ones near each other.

    The problems are halved at the median of their direction of largest variance, again
    and again.

    Args:
        offset: Offsets q (n_problems, m).
        size: Largest number of problems of a part.

    Returns:
        Row numbers of each part.
    """
    rng = np.random.default_rng(0)
    return _halved(offset @ rng.standard_normal((offset.shape[1], DIRECTIONS)), size)


def similar_sets(active: Mask, size: int) -> list[Index]:
    """Parts of problems with similar active sets, consecutive ones near each other.

    Args:
        active: Active sets (n_problems, m).
        size: Largest number of problems of a part.

    Returns:
        Row numbers of each part.
    """
    if len(active) <= size:
        return [np.arange(len(active))]
    share = active.mean(axis=0)
    varied = (share > 0.0) & (share < 1.0)
    if not varied.any():
        return _halved(np.zeros((len(active), 1)), size)
    # single precision is enough to judge similarity
    from_mean = active[:, varied] - share[varied].astype(np.float32)
    widest = np.linalg.eigh(from_mean.T @ from_mean)[1][:, -DIRECTIONS:]
    return _halved(from_mean @ widest, size)


def _halved(seen: FloatArray, size: int) -> list[Index]:
    """Parts of at most the given size, halved where they are widest.

    Args:
        seen: A few coordinates of each problem (n_problems, k).
        size: Largest number of problems of a part.
    """

    def halved(rows: Index, seen: FloatArray) -> list[Index]:
        if rows.size <= size:
            return [rows]
        from_mean = seen - seen.mean(axis=0)
        widest = np.linalg.eigh(from_mean.T @ from_mean)[1][:, -1]
        order = np.argsort(from_mean @ widest, kind="stable")
        halves = np.array_split(order, [rows.size // 2])
        return [part for half in halves for part in halved(rows[half], seen[half])]

    return halved(np.arange(len(seen)), seen)


def next_to(offset: Array) -> tuple[Index, Index]:
    """Order in which each problem comes after the one that is most similar to it.

    The problems are connected by a tree of smallest total length (Prim (1957),
    "Shortest connection networks and some generalizations", Bell System Technical
    Journal 36(6), 1389-1401).

    Args:
        offset: Offsets q (n_problems, m).

    Returns:
        Row numbers in this order (n_problems,), and the place in it of the most similar
        problem before each (n_problems,); -1 for the first.
    """
    from_mean = offset - offset.mean(axis=0)
    size = np.sum(from_mean**2, axis=1)
    distance = size[:, None] + size - 2.0 * from_mean @ from_mean.T
    order = np.zeros(len(offset), dtype=np.int64)
    before = np.full(len(offset), -1)
    if (native := kernels()) is not None:
        native.nearest_tree(distance, order, before)
        return order, before
    nearest, place = distance[0].copy(), np.zeros(len(offset), dtype=np.int64)
    nearest[0] = np.inf
    for k in range(1, len(offset)):
        row = int(nearest.argmin())
        order[k], before[k] = row, place[row]
        closer = distance[row] < nearest
        closer &= np.isfinite(nearest)  # those that are not in the tree yet
        nearest[closer], place[closer] = distance[row, closer], k
        nearest[row] = np.inf
    return order, before

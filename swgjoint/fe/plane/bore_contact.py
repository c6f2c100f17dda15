r"""Contact between the bore of the flexspline and what it lies on.

On a rigid wave generator the bore presses at stations, several between neighbouring
nodes, each through a thin layer that yields. With the gap g of a station

.. math:: U = \tfrac12 k \langle -g \rangle^2, \quad k = \frac{2 E b}{h}\,\ell

for a station that stands for a length :math:`\ell` of the bore, b wide, between nodes
that are h apart: the layer is half an interval deep. It yields by some hundredths of a
micrometre, in proportion to h, and spreads the contact over several stations, whose
forces begin and end without a jump.

A station follows the cubic B-spline through the nodes around it, brought back onto the
circle of the undeformed bore, so that a force between two nodes meets the same
compliance as a force at a node. (With rigid contact at the nodes alone the input torque
of a drive with four rollers was a sawtooth of one tooth per node, five times as high as
its ripple.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array

POINTS = 24
"""Stations between neighbouring nodes."""
NARROW_POINTS = 48
"""The same on rollers and parabolas, where a contact is narrower than the nodes are
apart and its steps from one station to the next are a ripple of the input torque: on
parabolas at 1 N·m 10 % of all there is with 24 stations (4.7 % rms), 5.6 % (2.2 %) with
48, most of which is no longer theirs."""
DEPTH = 0.5
"""Depth of the layer over the distance of the nodes. The kinematic error of
``reference-2d`` is 0.1 % off that of a mesh twice as fine, with a depth of two 4 %;
shallower layers need more stations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoreStations:
    """Stations of a sector, p of them in each of i equal intervals: q = i p.

    Those of an interval are carried by s neighbouring nodes, of m in all.
    """

    weights: Array
    """Positions from those of the nodes of an interval (p, 2, 2 s) [-]."""
    stiffness: Array
    """k (q,) [N/m]."""

    @property
    def per_interval(self) -> int:
        """Stations of an interval."""
        return len(self.weights)

    def positions(self, nodes: Array) -> Array:
        """Stations of all sectors (N, q, 2) [m] from their nodes (N, m, 2)."""
        by_node = self.weights.reshape(-1, self.weights.shape[2])
        return np.asarray((self._windows(nodes) @ by_node.T).reshape(len(nodes), -1, 2))

    def project(self, direction: Array) -> Array:
        """Displacements along directions (N, q, 2), by the nodes (N, q, 2 m)."""
        local = self._local(direction)
        count, intervals, p, width = local.shape
        rows = np.zeros((count, intervals, p, width + 2 * (intervals - 1)))
        for k in range(intervals):
            rows[:, k, :, 2 * k : 2 * k + width] = local[:, k]
        return rows.reshape(count, intervals * p, -1)

    def forces_of(self, forces: Array) -> Array:
        """Nodal forces (N, m, 2) [N] of forces on the stations (N, q, 2) [N]."""
        by_node = self.weights.reshape(-1, self.weights.shape[2])
        shaped = forces.reshape(len(forces), -1, len(by_node))
        return self._assembled(shaped @ by_node).reshape(len(forces), -1, 2)

    def stiffness_of(self, direction: Array, stiffness: Array) -> Array:
        """Stiffness matrices (N, 2 m, 2 m) [N/m] of springs along directions.

        Args:
            direction: At the stations (N, q, 2).
            stiffness: Of their springs (N, q) [N/m].
        """
        local = self._local(direction)
        count, intervals, p, width = local.shape
        springs = stiffness.reshape(count, intervals, p, 1)
        blocks = np.swapaxes(local, 2, 3) @ (springs * local)
        size = width + 2 * (intervals - 1)
        matrix = np.zeros((count, size, size))
        for k in range(intervals):
            own = slice(2 * k, 2 * k + width)
            matrix[:, own, own] += blocks[:, k]
        return matrix

    def _windows(self, nodes: Array) -> Array:
        """Coordinates of the nodes of every interval (N, i, 2 s)."""
        s = self.weights.shape[2] // 2
        intervals = len(self.stiffness) // len(self.weights)
        return np.concatenate([nodes[:, k : k + intervals] for k in range(s)], axis=2)

    def _local(self, direction: Array) -> Array:
        """Displacements along directions, by their own nodes (N, i, p, 2 s)."""
        shaped = direction.reshape(len(direction), -1, len(self.weights), 2)
        x, y = shaped[..., 0, None], shaped[..., 1, None]
        return np.asarray(x * self.weights[:, 0] + y * self.weights[:, 1])

    def _assembled(self, local: Array) -> Array:
        """Sums at the nodes (N, 2 m) of values of every interval (N, i, 2 s)."""
        count, intervals, width = local.shape
        total = np.zeros((count, width + 2 * (intervals - 1)))
        for k in range(intervals):
            total[:, 2 * k : 2 * k + width] += local[:, k]
        return total

    def nodes_touching(self, touching: NDArray[np.bool_]) -> int:
        """Touching stations (N, q) in intervals between nodes, rounded up."""
        return -(-int(touching.sum()) // self.per_interval)

    @classmethod
    def from_nodes(cls, stiffness: Array) -> Self:
        """The nodes themselves, with their stiffnesses (m,) [N/m]."""
        return cls(weights=np.eye(2)[None], stiffness=stiffness)

    @classmethod
    def subdivide(cls, nodes: Array, *, layer: float, points: int = POINTS) -> Self:
        """Equal steps through the intervals, all but the first and the last.

        Args:
            nodes: Undeformed, equally spaced on a circle around the origin, from one
                before the intervals to one after them (m, 2) [m].
            layer: E b of the bore [N/m].
            points: Stations of an interval.
        """
        # equal shares: those of Gauss points do not add up over a part of an interval
        t = (np.arange(points) + 0.5) / points
        splines = np.stack(
            [
                (1.0 - t) ** 3,
                3.0 * t**3 - 6.0 * t**2 + 4.0,
                1.0 + 3.0 * (t + t**2 - t**3),
                t**3,
            ],
            axis=-1,
        )
        radius, near = float(np.hypot(*nodes[1])), nodes[:4]
        chord = complex(*(near[2] - near[1]))
        weights = np.zeros((points, 2, 4, 2))
        for own, spline in zip(weights, splines / 6.0, strict=True):
            own += spline[:, None] * np.eye(2)[:, None, :]
            # what the spline lacks to the circle, turned and scaled with the chord
            mean = spline @ near
            lack = complex(*mean) * (radius / float(np.hypot(*mean)) - 1.0) / chord
            carried = np.array([[lack.real, -lack.imag], [lack.imag, lack.real]])
            own[:, 1] -= carried
            own[:, 2] += carried
        count = points * (len(nodes) - 3)
        return cls(
            weights=weights.reshape(points, 2, -1),
            stiffness=np.full(count, layer / (DEPTH * points)),
        )

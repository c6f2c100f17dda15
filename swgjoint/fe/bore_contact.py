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

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POINTS = 10
"""Stations between neighbouring nodes. On rollers a contact is narrower than the nodes
are apart, and its steps from one station to the next are a ripple of the input torque:
at 20 N·m, of the rest of that ripple, 0.6 with six stations and 0.15 with ten."""
DEPTH = 0.5
"""Depth of the layer over the distance of the nodes. The kinematic error of
``reference-2d`` is 0.1 % off that of a mesh twice as fine, with a depth of two 4 %;
shallower layers need more stations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoreStations:
    """Stations of a sector, q of them on m nodes."""

    weights: Array
    """Positions from those of the nodes (q, 2, 2 m) [-]."""
    stiffness: Array
    """k (q,) [N/m]."""
    per_interval: int = 1
    """Stations between neighbouring nodes."""

    def positions(self, nodes: Array) -> Array:
        """Stations of all sectors (N, q, 2) [m] from their nodes (N, m, 2)."""
        by_node = self.weights.reshape(-1, self.weights.shape[2])
        found = nodes.reshape(len(nodes), -1) @ by_node.T
        return np.asarray(found.reshape(len(nodes), -1, 2))

    def along(self, direction: Array) -> Array:
        """Displacements along directions (N, q, 2), by the nodes (N, q, 2 m)."""
        x, y = direction[..., 0, None], direction[..., 1, None]
        return np.asarray(x * self.weights[:, 0] + y * self.weights[:, 1])

    def nodes_touching(self, touching: NDArray[np.bool_]) -> int:
        """Touching stations (N, q) in intervals between nodes, rounded up."""
        return -(-int(touching.sum()) // self.per_interval)

    @classmethod
    def at_nodes(cls, stiffness: Array) -> Self:
        """The nodes themselves, with their stiffnesses (m,) [N/m]."""
        count = len(stiffness)
        weights = np.eye(2 * count).reshape(count, 2, 2 * count)
        return cls(weights=weights, stiffness=stiffness)

    @classmethod
    def between_nodes(cls, nodes: Array, *, layer: float) -> Self:
        """Equal steps through the intervals, all but the first and the last.

        Args:
            nodes: Undeformed, on a circle around the origin, from one before the
                intervals to one after them (m, 2) [m].
            layer: E b of the bore [N/m].
        """
        # equal shares: those of Gauss points do not add up over a part of an interval
        t = (np.arange(POINTS) + 0.5) / POINTS
        splines = np.stack(
            [
                (1.0 - t) ** 3,
                3.0 * t**3 - 6.0 * t**2 + 4.0,
                1.0 + 3.0 * (t + t**2 - t**3),
                t**3,
            ],
            axis=-1,
        )
        radius = float(np.hypot(*nodes[1]))
        intervals = len(nodes) - 3
        weights = np.zeros((intervals, POINTS, 2, len(nodes), 2))
        for first in range(intervals):
            near = nodes[first : first + 4]
            chord = complex(*(near[2] - near[1]))
            for own, spline in zip(weights[first], splines / 6.0, strict=True):
                for k in range(4):
                    own[:, first + k] += spline[k] * np.eye(2)
                # what the spline lacks to the circle, turned and scaled with the chord
                mean = spline @ near
                lack = complex(*mean) * (radius / float(np.hypot(*mean)) - 1.0) / chord
                carried = np.array([[lack.real, -lack.imag], [lack.imag, lack.real]])
                own[:, first + 1] -= carried
                own[:, first + 2] += carried
        return cls(
            weights=weights.reshape(intervals * POINTS, 2, -1),
            stiffness=np.full(intervals * POINTS, layer / (DEPTH * POINTS)),
            per_interval=POINTS,
        )

r"""Contact between the bore of the flexspline and the surface that supports it.

On a rigid wave generator the bore makes contact at stations, several between
neighbouring nodes, each through a thin compliant layer. A station with the gap g has
the energy and stiffness

.. math:: U = \tfrac12 k \langle -g \rangle^2, \quad k = \frac{2 E b}{h}\,\ell ,

where :math:`\ell` is the length of bore that the station represents, b is the width of
the bore and h is the node spacing: the layer is h/2 deep. It is compressed by a few
hundredths of a micrometre, in proportion to h, and spreads the contact over several
stations, whose forces start and end continuously.

A station follows the cubic B-spline through the surrounding nodes, corrected to lie on
the circle of the undeformed bore, so that a force between two nodes sees the same
compliance as a force at a node. (With rigid contact at the nodes only, the input torque
of a drive with four rollers was a sawtooth with one period per node, five times as high
as the rest of the ripple.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from swgjoint.kernels import kernels
from swgjoint.typing import Array

POINTS = 24
"""Number of stations between neighbouring nodes."""
NARROW_POINTS = 48
"""Number of stations between neighbouring nodes for rollers and parabolas.

There the contact is narrower than the node spacing, and its steps from one station to
the next cause an error of the input torque. For parabolas at 1 N·m the largest error is
10 % of the ripple (4.7 % rms) with 24 stations. With 48 stations it is 5.6 % (2.2 %
rms), and most of it has other causes."""
DEPTH = 0.5
"""Depth of the layer divided by the node spacing [-].

At a depth of 0.5 the kinematic error of ``reference-2d`` differs by 0.1 % from that of
a mesh twice as fine; at a depth of 2 it differs by 4 %. Shallower layers need more
stations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoreStations:
    """Contact stations of a sector: p in each of i equal intervals, q = i p in total.

    The stations of an interval follow s neighbouring nodes out of the m nodes of the
    sector. Methods work on all N sectors at once.
    """

    weights: Array
    """Derivatives of station positions with respect to the node positions of the
    interval (p, 2, 2 s) [-]."""
    stiffness: Array
    """Stiffness k of each station (q,) [N/m]."""

    @property
    def per_interval(self) -> int:
        """Number of stations per interval."""
        return len(self.weights)

    def positions(self, nodes: Array) -> Array:
        """Positions of the stations (N, q, 2) [m], from nodes (N, m, 2) [m]."""
        by_node = self.weights.reshape(-1, self.weights.shape[2])
        return np.asarray((self._windows(nodes) @ by_node.T).reshape(len(nodes), -1, 2))

    def forces_of(self, forces: Array) -> Array:
        """Nodal forces (N, m, 2) [N] equivalent to station forces (N, q, 2) [N]."""
        by_node = self.weights.reshape(-1, self.weights.shape[2])
        intervals = len(self.stiffness) // self.per_interval
        shaped = forces.reshape(len(forces), intervals, len(by_node))
        total = self._assembled(shaped @ by_node)
        return total.reshape(len(forces), total.shape[1] // 2, 2)

    def stiffness_of(self, direction: Array, stiffness: Array) -> Array:
        """Stiffness matrices of springs at the stations along given directions.

        Args:
            direction: Direction of the spring at each station (N, q, 2).
            stiffness: Stiffness of each spring (N, q) [N/m].

        Returns:
            Stiffness matrices of the nodes (N, 2 m, 2 m) [N/m].
        """
        if (native := kernels()) is not None:
            size = self.weights.shape[2] + 2 * (
                len(self.stiffness) // len(self.weights) - 1
            )
            result = np.zeros((len(stiffness), size, size))
            native.add_station_stiffness(
                self.weights,
                np.ascontiguousarray(direction),
                np.ascontiguousarray(stiffness),
                result,
            )
            return result
        local = self._local(direction)
        count, intervals, p, width = local.shape
        springs = stiffness.reshape(count, intervals, p, 1)
        blocks = np.swapaxes(local, 2, 3) @ (springs * local)
        size = width + 2 * (intervals - 1)
        matrix = np.zeros((count, size, size))
        for k in range(intervals):
            dofs = slice(2 * k, 2 * k + width)
            matrix[:, dofs, dofs] += blocks[:, k]
        return matrix

    def _windows(self, nodes: Array) -> Array:
        """Node coordinates of every interval (N, i, 2 s) [m]."""
        s = self.weights.shape[2] // 2
        intervals = len(self.stiffness) // len(self.weights)
        return np.concatenate([nodes[:, k : k + intervals] for k in range(s)], axis=2)

    def _local(self, direction: Array) -> Array:
        """Displacements along directions by the nodes of intervals (N, i, p, 2 s)."""
        shaped = direction.reshape(len(direction), -1, len(self.weights), 2)
        x, y = shaped[..., 0, None], shaped[..., 1, None]
        return np.asarray(x * self.weights[:, 0] + y * self.weights[:, 1])

    def _assembled(self, local: Array) -> Array:
        """Sums at the nodes (N, 2 m) of the values of all intervals (N, i, 2 s)."""
        count, intervals, width = local.shape
        total = np.zeros((count, width + 2 * (intervals - 1)))
        for k in range(intervals):
            total[:, 2 * k : 2 * k + width] += local[:, k]
        return total

    def nodes_touching(self, touching: NDArray[np.bool_]) -> int:
        """Number of touching stations (N, q), in node intervals and rounded up."""
        return -(-int(touching.sum()) // self.per_interval)

    @classmethod
    def from_nodes(cls, stiffness: Array) -> Self:
        """Stations at the nodes themselves, with given stiffnesses (m,) [N/m]."""
        return cls(weights=np.eye(2)[None], stiffness=stiffness)

    @classmethod
    def subdivide(cls, nodes: Array, *, layer: float, points: int = POINTS) -> Self:
        """Equally spaced stations in all intervals except the first and the last.

        Args:
            nodes: Undeformed nodes, equally spaced on a circle around the origin, from
                one before the intervals to one after them (m, 2) [m].
            layer: Product E b of Young's modulus and width of the bore [N/m].
            points: Number of stations per interval.
        """
        # stations of equal length: the weights of Gauss points would not add up to the
        # length of the part of an interval that is in contact
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
        for by_node, spline in zip(weights, splines / 6.0, strict=True):
            by_node += spline[:, None] * np.eye(2)[:, None, :]
            # offset from the spline to the circle, turned and scaled with the chord
            mean = spline @ near
            lack = complex(*mean) * (radius / float(np.hypot(*mean)) - 1.0) / chord
            carried = np.array([[lack.real, -lack.imag], [lack.imag, lack.real]])
            by_node[:, 1] -= carried
            by_node[:, 2] += carried
        count = points * (len(nodes) - 3)
        return cls(
            weights=weights.reshape(points, 2, -1),
            stiffness=np.full(count, layer / (DEPTH * points)),
        )

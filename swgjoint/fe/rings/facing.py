r"""Points that face the mean line of a ring: balls from inside, a bore from outside.

The foot of the perpendicular from a point p moves with both. With n from the line to
the side of the point, tangent :math:`\tau`, curvature :math:`\kappa = n\cdot
r''/|r'|^2` and distance :math:`g = n\cdot(p - r)`,

.. math:: dg = u_n, \quad
    d^2g = -\frac{\kappa u_t^2 + 2u_t\beta + g\beta^2}{1 - g\kappa} + n\cdot d^2p,

where :math:`u = dp - dr` at the foot and :math:`\beta = n\cdot dr'/|r'|`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.rings.hermite_ring import HermiteRing, hermite
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Facing:
    """Distances of n points from a ring, and how they change."""

    place: Array
    """Feet on the ring (n,)."""
    distance: Array
    """g [m]. Shape (n,)."""
    normal: Array
    """From the ring to the points (n, 2)."""
    tangent: Array
    """Tangent of the ring, counter-clockwise (n, 2)."""
    dofs: Index
    """Degrees of freedom of the ring at the feet (n, 8)."""
    by_ring: Array
    """Rows u_n, u_t, beta by these (n, 3, 8)."""
    curvature: Array
    """kappa [1/m]. Shape (n,)."""

    def bends(self) -> Array:
        """Second derivative of the distance by u_n, u_t, beta (n, 3, 3).

        That of the point, n . d2p, is left out.
        """
        form = np.zeros((len(self.distance), 3, 3))
        form[:, 1, 1] = self.curvature
        form[:, 1, 2] = form[:, 2, 1] = 1.0
        form[:, 2, 2] = self.distance
        spread = 1.0 - self.distance * self.curvature
        return np.asarray(-form / spread[:, None, None])

    def chosen(self, index: Index) -> Facing:
        """The points with the given indices."""
        return Facing(
            **{key: getattr(self, key)[index] for key in self.__dataclass_fields__}
        )


def distances_to_ring(
    ring: HermiteRing,
    q: Array,
    points: Array,
    start: Array,
    *,
    inside: bool,
    own: Index | None = None,
) -> Facing:
    """Distances of points from the mean line of a ring.

    Args:
        ring: The ring.
        q: Its coordinates.
        points: Shape (n, 2) [m].
        start: Places near the feet (n,).
        inside: On which side of the line the points are.
        own: Elements that the points face even from beyond their ends (n,).
    """
    place = ring.nearest(q, points, start, own)
    element, xi = ring.split(place, own)
    value, slope, _ = hermite(xi)
    r, v, w = ring.evaluate_at(q, place, own)
    length = np.hypot(v[:, 0], v[:, 1])
    tangent = v / length[:, None]
    outward = np.stack([tangent[:, 1], -tangent[:, 0]], -1)
    normal = -outward if inside else outward

    def row(shape: Array, direction: Array) -> Array:
        return np.asarray(shape[:, :, None] * direction[:, None, :]).reshape(-1, 8)

    return Facing(
        place=place,
        distance=np.einsum("ni,ni->n", points - r, normal),
        normal=normal,
        tangent=tangent,
        dofs=ring.dofs[element],
        by_ring=np.stack(
            [
                -row(value, normal),
                -row(value, tangent),
                row(slope / length[:, None], normal),
            ],
            axis=1,
        ),
        curvature=np.einsum("ni,ni->n", normal, w) / length**2,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class FacingSurface:
    """Points beside a ring at fixed places, carried along by its sections."""

    ring: HermiteRing
    place: Array
    """Element number plus parameter (n,)."""
    offset: float
    """Outwards from the mean line [m]."""

    def points(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Points (n, 2), tangents, outward normals there, lengths of the derivative."""
        r, v, _ = self.ring.evaluate_at(q, self.place)
        length = np.hypot(v[:, 0], v[:, 1])
        tangent = v / length[:, None]
        outward = np.stack([tangent[:, 1], -tangent[:, 0]], -1)
        return r + self.offset * outward, tangent, outward, length

    def rows(self, q: Array, seen: Facing) -> tuple[Index, Array, Array]:
        """Degrees of freedom, rows u_n, u_t, turn of the section, and n . d2p.

        Args:
            q: Coordinates of the ring.
            seen: All points as the other ring sees them.

        Returns:
            (n, 8), (n, 3, 8) and the factor of the squared turn (n,).
        """
        element, xi = self.ring.split(self.place)
        value, slope, _ = hermite(xi)
        _, tangent, outward, length = self.points(q)
        # turn of the section: -N . dr'/|r'|; the outward normal moves along t with it
        turn = -(slope / length[:, None])[:, :, None] * outward[:, None, :]
        turn = turn.reshape(-1, 8)
        rows = np.empty((len(element), 3, 8))
        for k, direction in enumerate((seen.normal, seen.tangent)):
            moved = (value[:, :, None] * direction[:, None, :]).reshape(-1, 8)
            arm = self.offset * np.einsum("ni,ni->n", direction, tangent)
            rows[:, k] = moved + arm[:, None] * turn
        rows[:, 2] = turn
        bend = -self.offset * np.einsum("ni,ni->n", seen.normal, outward)
        return self.ring.dofs[element], rows, bend

    def chosen(self, index: Index) -> FacingSurface:
        """The points with the given indices."""
        return FacingSurface(
            ring=self.ring, place=self.place[index], offset=self.offset
        )

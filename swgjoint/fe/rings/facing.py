r"""Points that face the mean line of a ring: balls from inside, a bore from outside.

The foot r of the perpendicular from a point p moves with the point and with the ring.
With the normal n from the line towards the point, the tangent :math:`\tau`, the
curvature :math:`\kappa = n\cdot r''/|r'|^2` and the distance
:math:`g = n\cdot(p - r)`,

.. math:: dg = u_n, \quad
    d^2g = -\frac{\kappa u_t^2 + 2u_t\beta + g\beta^2}{1 - g\kappa} + n\cdot d^2p,

where :math:`u = dp - dr` at the foot has the components :math:`u_n` and :math:`u_t`
along n and :math:`\tau`, and :math:`\beta = n\cdot dr'/|r'|`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.rings.hermite_ring import HermiteRing, hermite
from swgjoint.kernels import kernels
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Facing:
    """Distances of n points from the mean line of a ring, and their derivatives."""

    place: Array
    """Feet on the ring, element number plus parameter (n,)."""
    distance: Array
    """Distance g from the mean line (n,) [m]."""
    normal: Array
    """Unit normals from the ring to the points (n, 2)."""
    tangent: Array
    """Unit tangents of the ring, counter-clockwise (n, 2)."""
    dofs: Index
    """Degrees of freedom of the ring at the feet (n, 8)."""
    by_ring: Array
    """Derivatives of u_n, u_t and beta with respect to ``dofs`` (n, 3, 8)."""
    curvature: Array
    """Curvature kappa (n,) [1/m]."""

    def bends(self) -> Array:
        """Second derivatives of the distance with respect to u_n, u_t, beta (n, 3, 3).

        The term n . d2p, which depends on the motion of the point, is not included.
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
        q: Coordinates of the ring (size,) [m].
        points: The points (n, 2) [m].
        start: Initial guess of the feet, element number plus parameter (n,).
        inside: Whether the points are inside the ring.
        own: Elements on whose cubics the feet are sought, beyond the ends of the
            elements if necessary (n,); None for the elements that contain the feet.

    Returns:
        Feet, distances and derivatives.
    """
    if (native := kernels()) is not None:
        n, element = len(points), np.empty(len(points), np.int64)
        found = {
            "place": np.empty(n),
            "distance": np.empty(n),
            "normal": np.empty((n, 2)),
            "tangent": np.empty((n, 2)),
            "by_ring": np.empty((n, 3, 8)),
            "curvature": np.empty(n),
        }
        native.face_ring(
            np.ascontiguousarray(q),
            np.ascontiguousarray(points),
            np.ascontiguousarray(start, np.float64),
            own=np.empty(0, np.int64) if own is None else own,
            inside=inside,
            element=element,
            **found,
        )
        return Facing(dofs=ring.dofs[element], **found)
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
    """Points at fixed positions along a ring and a constant offset from its mean line.

    They move with the sections of the ring.
    """

    ring: HermiteRing
    """Ring that carries the points."""
    place: Array
    """Positions along the ring, element number plus parameter (n,)."""
    offset: float
    """Offset outwards from the mean line [m]."""

    def points(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Points [m], unit tangents, outward normals, each (n, 2); |r'| (n,) [m]."""
        r, v, _ = self.ring.evaluate_at(q, self.place)
        length = np.hypot(v[:, 0], v[:, 1])
        tangent = v / length[:, None]
        outward = np.stack([tangent[:, 1], -tangent[:, 0]], -1)
        return r + self.offset * outward, tangent, outward, length

    def rows(self, q: Array, seen: Facing) -> tuple[Index, Array, Array]:
        """Derivatives of the motion of the points with respect to their own ring.

        Args:
            q: Coordinates of the ring that carries the points (size,) [m].
            seen: Distances of all points from the other ring.

        Returns:
            Degrees of freedom (n, 8); derivatives of u_n, u_t and of the rotation of
            the section with respect to them (n, 3, 8); factor of the squared rotation
            in n . d2p (n,) [m].
        """
        element, xi = self.ring.split(self.place)
        value, slope, _ = hermite(xi)
        _, tangent, outward, length = self.points(q)
        # rotation of the section: -N . dr'/|r'|; it moves the outward normal along t
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

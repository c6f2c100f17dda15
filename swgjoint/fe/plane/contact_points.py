"""Contact points of the flanks and their directions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Contacts:
    """Candidates for contact between flanks, n points.

    Derivatives with respect to flank displacements are dimensionless.
    """

    sector: Index
    """Sector (tooth) of the flexspline (n,)."""
    side: Index
    """Flank of the flexspline tooth: 0 right (clockwise), 1 left (n,)."""
    station: Array
    """Arc length on the flexspline profile (n,) [m]."""
    gap: Array
    """Distance from the circular spline, negative for an overlap (n,) [m]."""
    normal: Array
    """Outward unit normal of the circular spline, in the sector frame (n, 2)."""
    point: Array
    """Position in the sector frame (n, 2) [m]."""
    weight: Array
    """Derivative of the gap with respect to the tooth's flank displacements
    (n, 2 n_b)."""
    tooth: Index
    """Tooth of the circular spline (n,)."""
    circular_spline_weight: Array
    """Derivative of the gap with respect to the flank displacements of that tooth
    (n, 2 n_c); no columns if the circular spline is rigid."""
    tangent: Array
    """Unit tangent of the flank from tip to root, in the sector frame (n, 2)."""
    sliding: Array
    """Derivative of the sliding motion along the tangent with respect to the flank
    displacements of the flexspline tooth (n, 2 n_b); no columns without friction."""
    circular_spline_sliding: Array
    """Derivative of the same motion with respect to the flank displacements of the
    circular-spline tooth (n, 2 n_c); no columns without friction."""
    slip: Array
    """Sum of the arc lengths of the contact point on both flanks, each measured from
    tip to root (n,) [m]; NaN if the circular spline is rigid."""

    def __len__(self) -> int:
        return len(self.sector)

    @classmethod
    def none(cls, flank_dofs: int, circular_spline_dofs: int) -> Contacts:
        """An empty set of contacts.

        Args:
            flank_dofs: Number of columns of ``weight``, 2 n_b.
            circular_spline_dofs: Number of columns of ``circular_spline_weight``,
                2 n_c; zero if the circular spline is rigid.
        """
        empty, index = np.zeros(0), np.zeros(0, dtype=np.int64)
        return cls(
            sector=index,
            side=index,
            station=empty,
            gap=empty,
            normal=np.zeros((0, 2)),
            point=np.zeros((0, 2)),
            weight=np.zeros((0, flank_dofs)),
            tooth=index,
            circular_spline_weight=np.zeros((0, circular_spline_dofs)),
            tangent=np.zeros((0, 2)),
            sliding=np.zeros((0, flank_dofs)),
            circular_spline_sliding=np.zeros((0, circular_spline_dofs)),
            slip=empty,
        )

    @classmethod
    def join(cls, first: Contacts, second: Contacts) -> Contacts:
        """Two sets of contacts as one.

        Args:
            first: Contacts that come first.
            second: Contacts that follow.
        """
        return cls(
            **{
                key: np.concatenate([getattr(first, key), getattr(second, key)])
                for key in cls.__dataclass_fields__
            }
        )

    def tangential(self, gap: Array) -> Contacts:
        """The same points with tangents in place of normals, and new gaps (n,) [m]."""
        return replace(
            self,
            gap=gap,
            normal=self.tangent,
            weight=self.sliding,
            circular_spline_weight=self.circular_spline_sliding,
        )

    def nearest_in(self, others: Contacts) -> Index:
        """Index of the nearest of ``others`` on the same flank pair, or -1 (n,)."""
        result = np.full(len(self), -1, dtype=np.int64)
        if len(others) and len(self):
            same = (
                (self.sector[:, None] == others.sector)
                & (self.side[:, None] == others.side)
                & (self.tooth[:, None] == others.tooth)
            )
            apart = np.abs(self.station[:, None] - others.station)
            apart = np.where(same, apart, np.inf)
            near = apart.argmin(axis=1)
            found = np.isfinite(apart[np.arange(len(self)), near])
            result[found] = near[found]
        return result

    def share_flank_with(self, others: Contacts) -> NDArray[np.bool_]:
        """Whether the flexspline flank of each point has one of ``others`` (n,)."""
        key, other = 2 * self.sector + self.side, 2 * others.sector + others.side
        return np.asarray((key[:, None] == other).any(axis=1))

    def add_places(
        self, sector: Index, side: Index, station: Array, apart: float
    ) -> tuple[Index, Index, Array]:
        """Sectors, sides and arc lengths [m] of other points and then of these points.

        Args:
            sector: Sectors of the other points (n,).
            side: Sides of the other points (n,).
            station: Arc lengths of the other points (n,) [m].
            apart: Distance from an other point up to which one of these points is the
                same one and left out [m].
        """
        same = (2 * sector + side)[:, None] == 2 * self.sector + self.side
        same &= np.abs(station[:, None] - self.station) < apart
        stay = ~same.any(axis=0)
        return (
            np.concatenate([sector, self.sector[stay]]),
            np.concatenate([side, self.side[stay]]),
            np.concatenate([station, self.station[stay]]),
        )

    def chosen(self, index: Index) -> Contacts:
        """The candidates with the given indices."""
        return Contacts(
            **{key: getattr(self, key)[index] for key in self.__dataclass_fields__}
        )


def touch_twice(contacts: Contacts) -> bool:
    """Whether two of the contacts are on the same flank of the flexspline."""
    flank = 2 * contacts.sector + contacts.side
    return len(np.unique(flank)) < len(flank)


def outward_normals(tangent: Array) -> Array:
    """Outward unit normals of the flexspline (n, 2), from its tangents (n, 2)."""
    size = np.hypot(tangent[:, 0], tangent[:, 1])
    return np.asarray(np.stack([-tangent[:, 1], tangent[:, 0]], -1) / size[:, None])


def node_weights(side: Index, spline: Array, direction: Array) -> Array:
    """Weights of the nodes of both flanks in motions along directions.

    Args:
        side: Flank on which each point is (n,).
        spline: Weights of the nodes of that flank (n, n_nodes) [-].
        direction: Direction of each motion (n, 2).

    Returns:
        Rows over the nodes of both flanks (n, 4 n_nodes), zero on the other flank.
    """
    n, nodes = spline.shape
    rows = np.zeros((n, 2, nodes, 2))
    rows[np.arange(n), side] = spline[:, :, None] * direction[:, None, :]
    return rows.reshape(n, 4 * nodes)

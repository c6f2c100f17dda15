"""Contact points of the flanks and their directions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Contacts:
    """Candidate contact points; n of them."""

    sector: Index
    side: Index
    """0 for the right (clockwise) flank of the flexspline tooth, 1 for the left."""
    station: Array
    """Arc length on the flexspline profile [m]."""
    gap: Array
    """Distance to the circular spline, positive when apart [m]."""
    normal: Array
    """Out of the circular spline's steel, in the sector frame. Shape (n, 2)."""
    point: Array
    """Position in the sector frame [m]. Shape (n, 2)."""
    weight: Array
    """Derivative of the gap by the flank displacements. Shape (n, 2 n_b)."""
    tooth: Index
    """Tooth of the circular spline."""
    ring_weight: Array
    """Derivative of the gap by that tooth's flank displacements; no columns if it is
    rigid. Shape (n, 2 n_c)."""
    tangent: Array
    """Along the flank from tip to root, in the sector frame. Shape (n, 2)."""
    sliding: Array
    """Derivative of the motion along the tangent by the flank displacements, as
    ``weight``; no columns without friction. Shape (n, 2 n_b)."""
    ring_sliding: Array
    """The same by the flank displacements of the circular spline. Shape (n, 2 n_c)."""
    slip: Array
    """Sum of the arc lengths of the two material points, tips to roots; NaN on a rigid
    circular spline [m]. Shape (n,)."""

    def __len__(self) -> int:
        return len(self.sector)

    @classmethod
    def none(cls, flank_dofs: int, ring_dofs: int) -> Contacts:
        """No contact at all."""
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
            ring_weight=np.zeros((0, ring_dofs)),
            tangent=np.zeros((0, 2)),
            sliding=np.zeros((0, flank_dofs)),
            ring_sliding=np.zeros((0, ring_dofs)),
            slip=empty,
        )

    @classmethod
    def join(cls, first: Contacts, second: Contacts) -> Contacts:
        """The points of both, one after the other."""
        return cls(
            **{
                key: np.concatenate([getattr(first, key), getattr(second, key)])
                for key in cls.__dataclass_fields__
            }
        )

    def tangential(self, gap: Array) -> Contacts:
        """The same points with the tangent in place of the normal."""
        return replace(
            self,
            gap=gap,
            normal=self.tangent,
            weight=self.sliding,
            ring_weight=self.ring_sliding,
        )

    def nearest_in(self, others: Contacts) -> Index:
        """The nearest of others on the same pair of flanks, -1 without one (n,)."""
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
        """Which points lie on a flank on which others lie. Shape (n,)."""
        key, other = 2 * self.sector + self.side, 2 * others.sector + others.side
        return np.isin(key, other)

    def chosen(self, index: Index) -> Contacts:
        """The candidates with the given indices."""
        return Contacts(
            **{key: getattr(self, key)[index] for key in self.__dataclass_fields__}
        )

"""Points of the flexspline's flanks, in and between the planes of the mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.typing import Array, Index, Mask

CLOSE = np.array([0.003, 0.1])
"""Distances within which a minimum of the gap takes over the force of another point:
along the flank as a fraction of its length, and over the face width in plane distances
[-]. Minima of a flank that two bodies have flattened may be 0.02 flank lengths apart.
"""
SAME = 0.1
"""Distance within which two descents have found the same minimum, in units of
:data:`CLOSE` [-]. Flattened flanks have minima that are closer than those units, and
if only the lowest of them could carry force, another one would become the lowest."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankPoints:
    """Points of flanks of the flexspline."""

    sector: Index
    """Sector of each point (n,)."""
    side: Index
    """Side of each point (n,)."""
    stations: Array
    """Arc lengths in all planes (n, n_planes) [m]. They are equal unless the point
    faces a corner; then they are those that are closest to it."""
    place: Array
    """Positions over the face width in plane distances (n,)."""
    corner: Mask
    """Whether each point faces a corner (n,)."""

    @classmethod
    def from_contacts(
        cls, contacts: Contacts, place: Array | Index, planes: int
    ) -> FlankPoints:
        """Points of contacts.

        Args:
            contacts: The contacts.
            place: Their positions over the face width in plane distances (n,).
            planes: Number of planes.
        """
        return cls(
            sector=contacts.sector,
            side=contacts.side,
            stations=np.repeat(contacts.station[:, None], planes, axis=1),
            place=np.asarray(place, dtype=float),
            corner=np.zeros(len(contacts), dtype=bool),
        )

    @property
    def nearest(self) -> Index:
        """Plane next to each point (n,)."""
        return np.rint(self.place).astype(np.int64)

    @property
    def station(self) -> Array:
        """Arc length of each point (n,) [m]."""
        return np.asarray(self.stations[np.arange(len(self)), self.nearest])

    def __len__(self) -> int:
        return len(self.sector)

    def chosen(self, index: Index) -> FlankPoints:
        """The points with the given indices."""
        return FlankPoints(
            **{key: getattr(self, key)[index] for key in self.__dataclass_fields__}
        )

    def move_to(self, places: Array) -> FlankPoints:
        """Points of the same flanks at other arc lengths [m] and places (n, 2)."""
        along = np.broadcast_to(places[:, :1], self.stations.shape)
        stations = np.where(self.corner[:, None], self.stations, along)
        return replace(self, stations=stations, place=places[:, 1])

    def join(self, others: FlankPoints) -> FlankPoints:
        """These points, followed by others."""
        return FlankPoints(
            **{
                key: np.concatenate([getattr(self, key), getattr(others, key)])
                for key in self.__dataclass_fields__
            }
        )

    def pass_to(
        self, others: FlankPoints, force: Array, length: float, close: float = 1.0
    ) -> tuple[Array, Mask]:
        """Pass the forces of these points to the closest of the others.

        Args:
            others: Other points.
            force: Forces of these points (n,) [N].
            length: Length of a flank [m].
            close: Largest distance of the closest one in units of :data:`CLOSE` [-].

        Returns:
            Forces of the other points (m,) [N]; mask of these points to which no other
            point is close (n,).
        """
        apart, loads = self.distances_from(others, length), np.zeros(len(others))
        within = np.asarray(apart < close, dtype=bool).any(axis=1)
        left: Mask = np.logical_not(within)
        near = np.flatnonzero(within)
        if near.size:
            np.add.at(loads, np.argmin(apart[near], axis=1), force[near])
        return loads, left

    def lowest_in_planes(self, keys: Index, contacts: Contacts, near: float) -> Index:
        """Points that are not higher than their neighbours, and these neighbours (m,).

        A descent from any other point would pass one of them. Without the neighbours, a
        second minimum on a flank that forces have flattened may be missed.

        Args:
            keys: Rows of integers that are equal on the same flank or corner (n, k).
            contacts: Contacts in the planes at the points.
            near: Largest distance along the flank of neighbours [m].
        """
        same = (keys[:, None] == keys).all(axis=2)
        same &= contacts.tooth[:, None] == contacts.tooth
        same &= np.abs(self.place[:, None] - self.place) == 1.0
        same &= np.abs(contacts.station[:, None] - contacts.station) < near
        lowest = ~(same & (contacts.gap < contacts.gap[:, None])).any(axis=1)
        return np.flatnonzero(lowest | (same & lowest).any(axis=1))

    def nearest_in(self, others: FlankPoints, length: float) -> Index:
        """Number of the nearest of ``others`` on the same flank (n,).

        Args:
            others: Other points, at least one on each flank.
            length: Length of a flank [m].
        """
        return np.asarray(self.distances_from(others, length).argmin(axis=1))

    def distances_from(self, others: FlankPoints, length: float) -> Array:
        """Distances in units of :data:`CLOSE`, infinite between flanks (n, m).

        Args:
            others: Other points.
            length: Length of a flank [m].
        """
        same = (2 * self.sector + self.side)[:, None] == 2 * others.sector + others.side
        along = np.abs(self.station[:, None] - others.station) / (CLOSE[0] * length)
        across = np.abs(self.place[:, None] - others.place) / CLOSE[1]
        return np.where(same, np.maximum(along, across), np.inf)

"""Closest points between the deformed flexspline flanks and the circular spline.

Both flanks are smooth: the analytic profile of the flexspline tooth carries a
displacement interpolated by a cubic spline through the flank nodes, the circular spline
is analytic. Facets would leak their chord error, about a micrometre, into a kinematic
error that is itself a matter of micrometres.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from swgjoint.fe.corotation import rotate
from swgjoint.fe.superelement import Superelement
from swgjoint.gear.profile import ToothProfile

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SAMPLES_PER_NODE = 2
REFINEMENTS = 6
MERGE = 1e-6  # of the flank: points closer than that are one contact


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

    def __len__(self) -> int:
        return len(self.sector)

    @classmethod
    def none(cls, flank_dofs: int) -> Contacts:
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
        )

    def on_flanks_of(self, others: Contacts) -> NDArray[np.bool_]:
        """Which points lie on a flank on which others lie. Shape (n,)."""
        key, other = 2 * self.sector + self.side, 2 * others.sector + others.side
        return np.isin(key, other)

    def chosen(self, index: Index) -> Contacts:
        """The candidates with the given indices."""
        return Contacts(
            **{key: getattr(self, key)[index] for key in self.__dataclass_fields__}
        )


_MIRROR = np.array([[1.0, 1.0], [-1.0, 1.0]])  # by side, into the right flank's frame


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothContact:
    """Search for contact candidates at one state; the circular spline is rigid."""

    element: Superelement
    circular_spline: ToothProfile
    angle: Array
    """Angles of the sector frames (N,) [rad]."""
    bearing: Array
    """Polar angles of the teeth, which tell the tooth space they enter (N,) [rad]."""

    def search(self, flank: Array, reach: float, held: Contacts | None) -> Contacts:
        """Local minima of the gap along every flank, and the points that held before.

        The gap must not be negative anywhere on a flank: a condition on a continuum.
        Where flanks conform (straight on straight) its minimum jumps from end to end of
        the contact, so points that carry force stay in the working set beside the new
        minima (exchange method of semi-infinite programming).

        Args:
            flank: Displacement of the flank nodes in the sector frames (N, 2 n_b) [m].
            reach: Candidates with a larger gap are left out [m].
            held: Points of the last iteration that carry force.
        """
        element = self.element
        size = element.flank_size
        low, high = element.flank_range
        s = np.linspace(low, high, SAMPLES_PER_NODE * size)
        base, _, _ = element.profile.evaluate(s)
        weights = element.spline(s)  # (n_samples, size)
        # flanks in their mirrored frames: (N, 2 sides, size, 2)
        shaped = flank.reshape(-1, 2, size, 2) * _MIRROR[:, None, :]
        points = base + weights @ shaped
        # a flank can touch only where it reaches below the ring's tip circle
        ring = self.circular_spline
        deep = np.hypot(points[..., 0], points[..., 1]).max(axis=-1)
        sector, side = np.nonzero(deep > ring.addendum_radius)
        mirrored = shaped[sector, side]
        gap, _, _, _ = self._gaps(
            points[sector, side].reshape(-1, 2),
            np.repeat(sector, s.size),
            np.repeat(side, s.size),
        )
        gap = gap.reshape(-1, s.size)
        padded = np.pad(gap, ((0, 0), (1, 1)), constant_values=np.inf)
        minimum = (
            np.isfinite(gap)
            & (gap <= padded[:, :-2])
            & (gap < padded[:, 2:])
            & (gap < reach + 0.02 * (high - low))
        )
        flank_index, k = np.nonzero(minimum)
        station = self._refine(
            s[k],
            mirrored[flank_index],
            sector[flank_index],
            side[flank_index],
            s[1] - s[0],
        )
        sector, side = sector[flank_index], side[flank_index]
        if held is not None and len(held):
            key, old_key = 2 * sector + side, 2 * held.sector + held.side
            near = (key[:, None] == old_key) & (
                np.abs(station[:, None] - held.station) < MERGE * (high - low)
            )
            stay = ~near.any(axis=0)
            sector = np.concatenate([sector, held.sector[stay]])
            side = np.concatenate([side, held.side[stay]])
            station = np.concatenate([station, held.station[stay]])
        return self._gather(sector, side, station, flank, reach)

    def _gaps(
        self, points: Array, sector: Index, side: Index
    ) -> tuple[Array, Array, Array, Array]:
        """Gap, normal and curvature of the ring for points in the mirrored frames.

        The normal comes in the mirrored sector frame; the last value is the angle from
        the mirrored sector frame to the mirrored frame of the ring tooth.
        """
        ring = self.circular_spline
        pitch = 2.0 * pi / ring.teeth
        sign = np.where(side == 0, 1.0, -1.0)
        # mirrored global frame: the tooth stands at sign * angle; a right flank faces
        # the left flank of the next ring tooth clockwise, half a pitch from the space
        space = np.round(sign * self.bearing[sector] / pitch) * pitch
        turn = sign * self.angle[sector] - space + 0.5 * pitch
        seen = rotate(points, turn) * _MIRROR[1]
        gap, normal, curvature = ring.signed_distance(seen)
        return gap, rotate(normal * _MIRROR[1], -turn), curvature, turn

    def _refine(
        self,
        station: Array,
        mirrored: Array,
        sector: Index,
        side: Index,
        spacing: float,
    ) -> Array:
        """Newton's method on the slope of the gap along the flank."""
        element = self.element
        low, high = element.flank_range
        low_s = np.maximum(station - spacing, low)
        high_s = np.minimum(station + spacing, high)
        d_spline = element.spline.derivative()
        s = station
        for _ in range(REFINEMENTS):
            point, outward, curvature = element.profile.evaluate(s)
            point = point + np.einsum("ks,ksi->ki", element.spline(s), mirrored)
            # tangent of the profile from tip to root: the outward normal turned back
            tangent = np.stack([outward[:, 1], -outward[:, 0]], axis=-1)
            tangent = tangent + np.einsum("ks,ksi->ki", d_spline(s), mirrored)
            _, normal, ring_curvature, _ = self._gaps(point, sector, side)
            slope = np.einsum("ki,ki->k", normal, tangent)
            relative = curvature + ring_curvature
            # the bracket holds the minimum: shrink it, and stay inside
            high_s = np.where(slope > 0.0, s, high_s)
            low_s = np.where(slope <= 0.0, s, low_s)
            newton = s - slope / np.where(np.abs(relative) > 1e-3, relative, 1e-3)
            good = (relative > 1e-3) & (newton >= low_s) & (newton <= high_s)
            s = np.where(good, newton, 0.5 * (low_s + high_s))
        return s

    def _gather(
        self,
        sector: Index,
        side: Index,
        station: Array,
        flank: Array,
        reach: float,
    ) -> Contacts:
        element = self.element
        size = element.flank_size
        n = len(sector)
        shaped = flank.reshape(-1, 2, size, 2)[sector, side]
        spline = element.spline(station) if n else np.zeros((0, size))
        base, _, _ = element.profile.evaluate(station)
        mirror = _MIRROR[side]
        point = base * mirror + np.einsum("ks,ksi->ki", spline, shaped)
        gap, normal, _, _ = self._gaps(point * mirror, sector, side)
        normal = normal * mirror
        weight = np.zeros((n, 2, size, 2))
        weight[np.arange(n), side] = spline[:, :, None] * normal[:, None, :]
        found = Contacts(
            sector=sector,
            side=side,
            station=station,
            gap=gap,
            normal=normal,
            point=point,
            weight=weight.reshape(n, -1),
        )
        return found.chosen(np.flatnonzero(gap < reach))

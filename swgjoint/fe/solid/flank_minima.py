r"""Points of a flank between the planes of the mesh where the gap has a minimum.

The 2D search gives the gap :math:`g_p(s)` of a pair of flanks in every plane p of the
mesh, over the arc length s of the flexspline's profile. Cubic splines over the face
width with the weights :math:`w_p` interpolate it at the position t in plane distances,

.. math:: g(s, t) = \sum_p w_p(t)\, g_p(s) .

Crowned flanks touch where g has a minimum in both directions. The derivative of g by
displacements is the sum of those in the planes with the same weights, so that force and
gap are conjugate. As the flanks move, the minimum moves along both directions. For a
contact force :math:`\lambda` this adds a term to the tangent,

.. math:: -\lambda\, \nabla\nabla \bar g = \lambda\, \nabla (g_s, g_t)\, H^{-1}\,
    \nabla (g_s, g_t)^T ,

where H is the Hessian of g by s and t. With :math:`H = L D L^T` these are two unloaded
springs, one between slopes along the flank and one between slopes along the valley of
the gap, see :mod:`swgjoint.fe.solid.across`.

Minima are found by descents from those in the planes, and from the points that carry
force: their forces flatten the flanks, so that a minimum between two planes may have
others beside it in which the descents from both planes end. A corner of the circular
spline is a line along the axis; the gap there is that at the point of the flank which
is closest to it, so that it depends on t alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.tooth_contact import ToothContact
from swgjoint.fe.solid.flank_points import SAME, FlankPoints
from swgjoint.typing import Array, Index, Mask

STEP = 1e-4
"""Distance along a flank of the points from which derivatives follow by differences, as
a fraction of the flank length [-]. Round-off changes curvatures by 1e-4."""
LONGEST = np.array([0.03, 0.5])
"""Longest step of the search for a minimum: along the flank as a fraction of its
length, and over the face width in plane distances [-]."""
EXACT = 1e-7
"""Step at which the search for a minimum ends, in the same units [-]."""
STRAIGHTEST = np.array([1e-6, 1e-15])
"""Smallest bends of the gap at a minimum: along the flank [1/m] and over the face width
[m]. Those of bodies that have flattened each other may vanish."""
BEYOND = 1e-6
"""Distance from an end of the circular spline's flank up to which a foot is at a
corner, as a fraction of the flank length [-]."""
LEFT = 1e-3
"""Longest step that may be left after :data:`STEPS` steps, in the same units [-]."""
STEPS = 20
"""Largest number of steps of this search."""
ROUND = 1e-15
"""Smallest bend of the gap in a step of the search, in the same units [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankGaps:
    """Gaps around n points: three arc lengths each, in all planes."""

    gap: Array
    """Gaps in the order points, arc lengths, planes, zero in planes that are left out
    (n, 3, n_planes) [m]."""
    first: Index
    """First plane of each point that is not left out (n,)."""
    last: Index
    """Last plane of each point that is not left out; it is less than the first one if
    the point faces no flank (n,)."""
    places: Array
    """Arc lengths [m] and positions over the face width in plane distances (n, 2)."""
    corner: Mask
    """Whether each point faces a corner in the nearest plane (n,)."""
    rests: Mask
    """Whether the arc length of each point is that closest to a corner (n,)."""
    step: float
    """Distance between the arc lengths [m]."""

    @property
    def found(self) -> Mask:
        """Whether the points face flanks (n,)."""
        return np.asarray(self.first <= self.last)

    def weight(self, derivative: int = 0) -> Array:
        """Weights of the planes at the points, or derivatives by the place.

        Args:
            derivative: Order of the derivative.

        Returns:
            The weights (n, n_planes) [-].
        """
        weight = np.zeros((len(self.gap), self.gap.shape[2]))
        pairs = np.stack([self.first, self.last], axis=1)
        for first, last in np.unique(pairs[self.found], axis=0):
            some = np.flatnonzero((pairs == (first, last)).all(axis=1))
            place = self.places[some, 1] - first
            weight[some, first : last + 1] = _weights(
                last - first + 1, place, derivative
            )
        return weight

    @cached_property
    def value(self) -> Array:
        """Gap at each point, infinite where it faces no flank (n,) [m]."""
        value = np.einsum("kp,kp->k", self.weight(), self.gap[:, 1])
        place = self.places[:, 1]
        within = (place >= self.first) & (place <= self.last)
        return np.where(within, value, np.inf)

    @cached_property
    def along(self) -> Array:
        """Differences of first order along the flank (n, n_planes) [-]."""
        return np.asarray((self.gap[:, 2] - self.gap[:, 0]) / (2.0 * self.step))

    def sums(self) -> Array:
        """Weights of the contacts in the gap and in its slopes along both directions.

        They are those of the gap, of its slope by arc length [1/m] and of its slope by
        place (3, n, 3, n_planes) [-].
        """
        sums = np.zeros((3, *self.gap.shape))
        sums[0, :, 1], sums[2, :, 1] = self.weight(), self.weight(1)
        sums[1, :, 2] = sums[0, :, 1] / (2.0 * self.step)
        sums[1, :, 0] = -sums[1, :, 2]
        return sums

    def derivatives(self) -> tuple[Array, Array]:
        """Gradient (n, 2) [-], [m] and Hessian (n, 2, 2) by arc length and place."""
        bend = (self.gap[:, 0] - 2.0 * self.gap[:, 1] + self.gap[:, 2]) / self.step**2
        zero, one, two = (self.weight(order) for order in range(3))
        gradient = np.stack(
            [
                np.einsum("kp,kp->k", zero, self.along),
                np.einsum("kp,kp->k", one, self.gap[:, 1]),
            ],
            axis=1,
        )
        hessian = np.empty((len(self.gap), 2, 2))
        hessian[:, 0, 0] = np.einsum("kp,kp->k", zero, bend)
        hessian[:, 0, 1] = hessian[:, 1, 0] = np.einsum("kp,kp->k", one, self.along)
        hessian[:, 1, 1] = np.einsum("kp,kp->k", two, self.gap[:, 1])
        return gradient, hessian


@dataclass(frozen=True, kw_only=True, eq=False)
class FlankSurfaces:
    """The gaps of all flanks of one state as functions of arc length and place."""

    searches: tuple[ToothContact, ...]
    """Search in every plane."""
    flank: Array
    """Displacements of the flank nodes in all planes (n_planes, N, 2 n_b) [m]."""

    @property
    def planes(self) -> int:
        """Number of planes."""
        return len(self.searches)

    @property
    def length(self) -> float:
        """Length of a flank [m]."""
        low, high = self.searches[0].element.flank_range
        return high - low

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest arc length of a point [m]."""
        low, high = self.searches[0].element.flank_range
        step = STEP * (high - low)
        return low + step, high - step

    def gaps(self, points: FlankPoints) -> FlankGaps:
        """Gaps at and around points."""
        n, planes, step = len(points), self.planes, STEP * self.length
        parts = self._around(points, weighted=False)
        gap, tooth, slip = (
            np.stack([getattr(part, key) for part in parts], axis=1)
            for key in ("gap", "tooth", "slip")
        )
        foot = slip.reshape(n, 3, planes)[:, 1] - points.stations
        gap, tooth = gap.reshape(n, 3, planes), tooth.reshape(n, 3, planes)
        # the neighbouring planes in which the point faces the same flank or corner
        number, near, row = np.arange(planes), points.nearest, np.arange(n)
        same = tooth == tooth[row, 1, near][:, None, None]
        corner = self.find_ends(foot) != 0
        missing = ~(np.isfinite(gap) & same).all(axis=1)
        missing |= points.corner[:, None] & ~corner
        before, after = number <= near[:, None], number >= near[:, None]
        first = np.where(missing & before, number, -1).max(axis=1) + 1
        last = np.where(missing & after, number, planes).min(axis=1) - 1
        used = (number >= first[:, None]) & (number <= last[:, None])
        return FlankGaps(
            gap=np.where(used[:, None], gap, 0.0),
            first=first,
            last=last,
            places=np.stack([points.station, points.place], axis=1),
            corner=corner[row, near],
            rests=points.corner,
            step=step,
        )

    def contacts(self, points: FlankPoints) -> Contacts:
        """Contacts at and around points in the order of their gaps (3 n n_planes,)."""
        parts = self._around(points, weighted=True)
        order = np.arange(3 * len(points) * len(parts)).reshape(len(parts), -1)
        return Contacts(
            **{
                key: np.concatenate([getattr(part, key) for part in parts])[
                    order.T.ravel()
                ]
                for key in Contacts.__dataclass_fields__
            }
        )

    def _around(self, points: FlankPoints, *, weighted: bool) -> list[Contacts]:
        """Contacts in every plane in the order points, arc lengths (3 n,) each."""
        sector, side = np.repeat(points.sector, 3), np.repeat(points.side, 3)
        around = STEP * self.length * np.array([-1.0, 0.0, 1.0])
        return [
            search.gather(
                sector,
                side,
                (station[:, None] + around).ravel(),
                flank,
                weighted=weighted,
            )
            for search, flank, station in zip(
                self.searches, self.flank, points.stations.T, strict=True
            )
        ]

    def find_ends(self, foot: Array) -> Index:
        """End of the circular spline's flank at which feet are.

        It is -1 or 1 for the two ends and 0 for feet between them.

        Args:
            foot: Arc lengths on the circular spline [m], not used if it is rigid.
        """
        facing = self.searches[0].circular_spline
        if not facing.flank_dofs:
            return np.zeros(foot.shape, dtype=np.int64)
        low, high = float(facing.spline.x[0]), float(facing.spline.x[-1])
        near = BEYOND * (high - low)
        return (foot > high - near).astype(np.int64) - (foot < low + near)

    def seeds(self, contacts: Contacts, plane: Index) -> FlankPoints:
        """Points from which minima of the gap are found, from contacts in the planes.

        Args:
            contacts: Local minima of the gap in every plane.
            plane: Their planes (n,).
        """
        seeds = FlankPoints.from_contacts(contacts, plane, self.planes)
        low, high = self.ends
        seeds = replace(seeds, stations=np.clip(seeds.stations, low, high))
        # points that are closest to the same corner
        corner = self.find_ends(contacts.slip - contacts.station)
        keys = np.stack([contacts.sector, contacts.side, corner], axis=1)
        for key in np.unique(keys[corner != 0], axis=0):
            own = np.flatnonzero((keys == key).all(axis=1))
            away = np.abs(plane[own, None] - np.arange(self.planes))
            seeds.stations[own] = contacts.station[own[away.argmin(axis=0)]]
        seeds = replace(seeds, corner=corner != 0)
        return seeds.chosen(
            seeds.lowest_in_planes(keys, contacts, LONGEST[0] * self.length)
        )

    def minima(self, seeds: FlankPoints, reach: float) -> FlankPoints:
        """Minima of the gap that descents from given points reach.

        Args:
            seeds: Points from which to descend, see :meth:`seeds`.
            reach: Largest gap of a minimum [m].
        """
        here = self.gaps(seeds)
        x, value, step = here.places, here.value, self._descent(here)
        corner, (low, high) = here.corner, self.bounds(here)
        unit = np.array([self.length, 1.0])
        every, part = np.flatnonzero(here.found), np.ones((len(x), 1))
        for _ in range(STEPS):
            every = every[(np.abs(part * step)[every] > EXACT).any(axis=1)]
            if not len(every):
                break
            way = x[every] + part[every] * step[every] * unit
            there = np.clip(way, low[every], high[every])
            after = self.gaps(seeds.chosen(every).move_to(there))
            lower = after.value <= value[every]
            good = every[lower]
            x[good], value[good] = there[lower], after.value[lower]
            corner[good] = after.corner[lower]
            step[good] = self._descent(after)[lower]
            low[good], high[good] = (bound[lower] for bound in self.bounds(after))
            part[good], part[every[~lower]] = 1.0, 0.25 * part[every[~lower]]
        # where a flank faces nothing more a descent ends without a minimum, and at a
        # corner the gap along the flank has none
        ended = (np.abs(step) > LEFT).any(axis=1)
        found = np.flatnonzero((value < reach) & (corner == seeds.corner) & ~ended)
        # of those that count as one the lowest remains
        found = found[np.argsort(value[found], kind="stable")]
        points = seeds.move_to(x).chosen(found)
        near, kept = points.distances_from(points, self.length) < SAME, list[int]()
        for k in range(len(points)):
            if not near[k, kept].any():
                kept.append(k)
        points = points.chosen(np.array(kept, dtype=np.int64))
        return points.chosen(
            np.lexsort([points.station, points.place, points.side, points.sector])
        )

    def bounds(self, gaps: FlankGaps) -> tuple[Array, Array]:
        """Smallest and largest arc lengths [m] and places of points, each (n, 2)."""
        low, high = self.ends
        one = np.ones(len(gaps.places))
        return (
            np.stack([low * one, gaps.first * one], axis=1),
            np.stack([high * one, gaps.last * one], axis=1),
        )

    def find_pinned(self, gaps: FlankGaps, gradient: Array) -> Mask:
        """Whether a point stays at an end of a flank or of the face width (n, 2).

        A point that faces a corner stays where it is closest to that.

        Args:
            gaps: Gaps around the points.
            gradient: Gradient of the gap by arc length and place (n, 2).
        """
        low, high = self.bounds(gaps)
        pinned = (gaps.places <= low) & (gradient >= 0.0)
        pinned |= (gaps.places >= high) & (gradient <= 0.0)
        pinned[:, 0] |= gaps.rests
        return np.asarray(pinned)

    def springs(self, gaps: FlankGaps) -> tuple[Mask, Array, Array]:
        """Bends of the gap at minima, whose Hessian is L D L^T.

        Args:
            gaps: Gaps around the minima.

        Returns:
            Directions in which the minima can move (n, 2); diagonals of D, along the
            flank [1/m] and along the valley [m] (n, 2); entries L_21 (n,) [m].
        """
        gradient, hessian = gaps.derivatives()
        free = ~self.find_pinned(gaps, gradient)
        bend = np.maximum(hessian[:, [0, 1], [0, 1]], STRAIGHTEST)
        skew = np.where(free.all(axis=1), hessian[:, 0, 1] / bend[:, 0], 0.0)
        bend[:, 1] = np.maximum(bend[:, 1] - skew**2 * bend[:, 0], STRAIGHTEST[1])
        return free, bend, skew

    def _descent(self, gaps: FlankGaps) -> Array:
        """Newton's step towards a minimum, in flank lengths and plane distances (n, 2).

        Args:
            gaps: Gaps around the points.
        """
        unit = np.array([self.length, 1.0])
        gradient, hessian = gaps.derivatives()
        pinned = self.find_pinned(gaps, gradient)
        g = np.where(pinned, 0.0, gradient * unit)
        h = hessian * unit[:, None] * unit
        # H = L D L^T with positive D; a pinned direction has no gradient
        a, b = h[:, 0, 0], np.where(pinned.any(axis=1), 0.0, h[:, 0, 1])
        a = np.maximum(np.abs(a), ROUND)
        c = np.maximum(np.abs(h[:, 1, 1] - b * b / a), ROUND)
        across = -(g[:, 1] - b / a * g[:, 0]) / c
        step = np.stack([-(g[:, 0] + b * across) / a, across], axis=1)
        most = (np.abs(step) / LONGEST).max(axis=1, initial=0.0)
        return np.asarray(step / np.maximum(most, 1.0)[:, None])


@lru_cache(maxsize=64)
def _spline(planes: int) -> CubicSpline:
    """Weights of so many planes over the position in plane distances."""
    return CubicSpline(np.arange(planes), np.eye(planes))


def _weights(planes: int, place: Array, derivative: int) -> Array:
    """Weights of planes at places (n, n_planes), or their derivatives."""
    if planes == 1:
        return np.full((len(place), 1), 1.0 if derivative == 0 else 0.0)
    return np.asarray(_spline(int(planes))(place, derivative))

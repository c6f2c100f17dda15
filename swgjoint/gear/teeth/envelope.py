"""Outermost positions of a moving flank: the boundary that a mating tooth must keep.

In the frame of the receiving tooth, at each radius, the other member's flank comes
closest at one position of the motion. There the velocity has no part along the common
normal, which is the meshing equation of the envelope; where the flank ends at an edge,
the path of the edge takes over.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_motion import Receiver, ToothMotion
from swgjoint.typing import Array

POSITIONS, RADII, PER_PIECE = 601, 241, 48
STEEPEST = np.deg2rad(75.0)
"""Flanks more inclined than that are tip and root roundings that never mate."""
SAME_BRANCH = 0.1
"""Share of the flank beyond which a step from radius to radius is a jump."""
ITERATIONS = 100


@dataclass(frozen=True, kw_only=True)
class EnvelopeRun:
    """Part of the boundary that one branch of the envelope, or one edge, makes."""

    motion: ToothMotion
    station: Array
    """Arc length on the moving flank, tip to root of the receiver (n,) [m]."""
    theta: Array
    """Position of the motion (n,) [rad]."""
    edge: bool
    """Whether the edge at the tip of the moving flank makes it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Envelope:
    """Envelope of a given flank in the frame of the receiving tooth's right flank."""

    given: ToothProfile
    receiver: Receiver
    motions: tuple[ToothMotion, ...]
    tip: float
    """Tip radius of the receiving member [m]."""

    @property
    def side(self) -> float:
        """+1 where the receiver has external teeth, -1 where internal."""
        return -self.given.side

    @cached_property
    def _stations(self) -> Array:
        """Samples of the given flank, leaving out what never mates (n,) [m]."""
        low, high = self.given.contact_range
        ends = self.given.stations
        ends = np.unique(np.concatenate([[low, high], ends]))
        ends = ends[(ends >= low) & (ends <= high)]
        u = np.linspace(0.0, 1.0, PER_PIECE, endpoint=False)
        s = (ends[:-1, None] + np.diff(ends)[:, None] * u).ravel()
        s = np.append(s, high)
        _, normal, _ = self.given.evaluate(s)
        inclined = np.arctan2(self.given.side * normal[:, 1], normal[:, 0])
        return np.asarray(s[np.abs(inclined) < STEEPEST])

    @property
    def starts_at_edge(self) -> bool:
        """Whether the flank that mates begins at an edge of the given tooth."""
        low = self.given.contact_range[0]
        return bool(self._stations[0] == low) and any(
            part.edge for part in self.given.segments[:2]
        )

    def slip(self, motion: ToothMotion, s: Array, theta: Array) -> Array:
        """Speed towards the receiver along the common normal, n . v (n,) [m/rad]."""
        points, normals, _ = self.given.evaluate(s)
        moved = motion.map_to(self.receiver, theta)
        return np.asarray(
            np.sum(moved.vectors(normals) * moved.velocities(points), axis=-1)
        )

    def contact(self, motion: ToothMotion, s: Array, guess: Array) -> Array:
        """Positions theta at which flank points s touch the envelope (n,) [rad].

        The meshing equation ``slip`` = 0, from positive to negative slip, bracketed
        about the guess and closed in by the Illinois method. Where the speed of the
        motion jumps (curvature of the wave generator) the jump itself is found.
        """
        step = 4.0 * motion.half_range / POSITIONS
        low, high = guess - step, guess + step
        for _ in range(12):  # widen until the slip changes from + to -
            f_low, f_high = self.slip(motion, s, low), self.slip(motion, s, high)
            if (f_low >= 0.0).all() and (f_high <= 0.0).all():
                break
            low = np.where(f_low < 0.0, low - step, low)
            high = np.where(f_high > 0.0, high + step, high)
            step *= 1.6
        last = np.zeros(s.shape)
        theta = 0.5 * (low + high)
        for k in range(ITERATIONS):
            with np.errstate(divide="ignore", invalid="ignore"):
                theta = high - f_high * (high - low) / (f_high - f_low)
            inside = (theta > low) & (theta < high)
            # every fourth step halves the bracket: it closes on a jump as well
            halve = ~inside if k % 4 < 3 else np.ones_like(inside)
            theta = np.where(halve, 0.5 * (low + high), theta)
            f = self.slip(motion, s, theta)
            up = f > 0.0
            # Illinois: an end that stays twice counts half
            f_high = np.where(up & (last > 0.0), 0.5 * f_high, f_high)
            f_low = np.where(~up & (last < 0.0), 0.5 * f_low, f_low)
            low, f_low = np.where(up, theta, low), np.where(up, f, f_low)
            high, f_high = np.where(up, high, theta), np.where(up, f_high, f)
            last = np.where(up, 1.0, -1.0)
            if (np.abs(f) < 1e-16).all() or (high - low).max() < 1e-15:
                break
        return np.asarray(theta)

    def trace(self, run: EnvelopeRun, s: Array) -> tuple[Array, Array, Array]:
        """Points and outward normals of the receiver, and theta, at flank points s."""
        order = np.argsort(run.station)
        guess = np.interp(s, run.station[order], run.theta[order])
        theta = self.contact(run.motion, s, guess)
        points, normals, _ = self.given.evaluate(s)
        moved = run.motion.map_to(self.receiver, theta)
        return moved.points(points), -moved.vectors(normals), theta

    def trace_edge(self, run: EnvelopeRun, theta: Array) -> tuple[Array, Array]:
        """Path of the edge of the given flank, with the receiver's outward normals."""
        low = np.full(theta.shape, self.given.contact_range[0])
        points, normals, _ = self.given.evaluate(low)
        moved = run.motion.map_to(self.receiver, theta)
        velocity = moved.velocities(points)
        normal = np.stack([-velocity[:, 1], velocity[:, 0]], axis=-1)
        normal /= np.hypot(normal[:, 0], normal[:, 1])[:, None]
        # away from the receiver's steel, as the flank beside the edge
        sign = np.sign(np.sum(normal * -moved.vectors(normals), axis=-1))
        return moved.points(points), normal * sign[:, None]

    @cached_property
    def _table(self) -> tuple[Array, Array, Array]:
        """Radii and angles of the flank samples at every position, (motion, theta, s).

        The third value is the grid of positions.
        """
        s = self._stations
        points, _, _ = self.given.evaluate(s)
        theta = np.linspace(-1.0, 1.0, POSITIONS) * self.motions[0].half_range
        radii, angles = [], []
        for motion in self.motions:
            moved = motion.map_to(self.receiver, theta)
            seen = moved.points(np.broadcast_to(points, (len(theta), *points.shape)))
            radii.append(np.hypot(seen[..., 0], seen[..., 1]))
            angles.append(np.arctan2(seen[..., 0], seen[..., 1]))
        return np.array(radii), np.array(angles), theta

    def _deepest(self, radii: Array) -> float:
        """The radius nearest to the receiver's root [m]."""
        return float(radii.min() if self.side > 0.0 else radii.max())

    @property
    def reach(self) -> float:
        """Radius in the receiver up to which the flank that mates comes [m]."""
        return self._deepest(self._table[0])

    @property
    def summit(self) -> float:
        """Radius in the receiver up to which the given tooth comes [m]."""
        top = np.array([0.0, self.given.addendum_radius])
        theta = self._table[2]
        wide = np.broadcast_to(top, (len(theta), 2))
        paths = [m.map_to(self.receiver, theta).points(wide) for m in self.motions]
        return self._deepest(np.hypot(*np.concatenate(paths).T))

    @property
    def floor(self) -> float:
        """Radius that the given root comes to; the receiving tip keeps off [m]."""
        return self._deepest(self._table[0][..., -1])

    def runs(self) -> list[EnvelopeRun]:
        """Branches of the boundary from the receiver's tip towards its root.

        Empty where the given flank does not reach the tip circle.
        """
        radii, angles, theta = self._table
        s = self._stations
        wanted = np.linspace(self.tip, self.reach, RADII)[:-1]
        best = np.full(RADII - 1, np.inf)
        where = np.zeros((3, RADII - 1), dtype=np.int64)  # motion, theta, at an end
        station = np.zeros(RADII - 1)
        for m in range(len(self.motions)):
            angle = np.full((POSITIONS, RADII - 1), np.inf)
            found = np.zeros((POSITIONS, RADII - 1))
            for i in range(POSITIONS):
                # radii of the given flank in increasing order
                order = slice(None) if self.side > 0.0 else slice(None, None, -1)
                r = radii[m, i, order]
                ok = (wanted >= r[0]) & (wanted <= r[-1])
                angle[i, ok] = np.interp(wanted[ok], r, angles[m, i, order])
                found[i, ok] = np.interp(wanted[ok], r, s[order])
            i = np.argmin(angle, axis=0)
            k = np.arange(RADII - 1)
            better = angle[i, k] < best
            around = np.pad(angle, ((1, 1), (0, 0)), constant_values=np.inf)
            end = np.isinf(around[i, k]) | np.isinf(around[i + 2, k])
            best = np.where(better, angle[i, k], best)
            station = np.where(better, found[i, k], station)
            where = np.where(better, np.stack([np.full_like(i, m), i, end]), where)
        if not np.isfinite(best[0]):
            return []
        count = int(np.argmin(np.isfinite(best))) if np.isinf(best).any() else best.size
        edge = where[2].astype(bool) & self.starts_at_edge
        jump = np.zeros(count, dtype=bool)
        span = SAME_BRANCH * (s[-1] - s[0])
        jump[1:] = (
            (np.abs(np.diff(station[:count])) > span)
            | (np.diff(where[0, :count]) != 0)
            | (edge[1:count] != edge[: count - 1])
        )
        parts = np.split(np.arange(count), np.flatnonzero(jump))
        return [
            EnvelopeRun(
                motion=self.motions[int(where[0, part[0]])],
                station=station[part],
                theta=theta[where[1, part]],
                edge=bool(edge[part[0]]),
            )
            for part in parts
            if len(part)
        ]

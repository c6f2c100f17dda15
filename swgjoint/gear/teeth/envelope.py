"""Envelope of a moving flank: the boundary that a mating tooth must not cross.

The other member moves in the frame of the receiving tooth. For each radius there is one
position of the motion at which its flank is closest to the axis of the receiving tooth.
At that position, its velocity has no component along the common normal, which is the
meshing equation of the envelope. Where the moving flank ends at an edge, the path of
the edge forms the boundary.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_motion import Receiver, ToothMotion
from swgjoint.typing import Array

POSITIONS, RADII, PER_PIECE = 601, 241, 48
"""Numbers of positions of the motion, of radii, and of samples per piece of the
flank."""
STEEPEST = np.deg2rad(75.0)
"""Largest inclination of the normal of a mating flank [rad]; parts with a larger
inclination are roundings of tip or root."""
SAME_BRANCH = 0.1
"""Largest change of the arc length on the moving flank between neighbouring radii of
one branch, as a fraction of the length of that flank [-]."""
ITERATIONS = 100
"""Largest number of iterations for the meshing equation."""


@dataclass(frozen=True, kw_only=True)
class EnvelopeRun:
    """Part of the boundary formed by one branch of the envelope or by an edge."""

    motion: ToothMotion
    """Motion of the moving tooth."""
    station: Array
    """Arc lengths on the moving flank, ordered from tip to root of the receiver (n,)
    [m]."""
    theta: Array
    """Positions of the motion at which these points touch the boundary (n,) [rad]."""
    edge: bool
    """Whether the edge at the tip of the moving flank forms this part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Envelope:
    """Envelope of a given flank in the frame of the receiving tooth's right flank."""

    given: ToothProfile
    """Profile of the moving member."""
    receiver: Receiver
    """Member whose flank is generated."""
    motions: tuple[ToothMotion, ...]
    """Distinct motions of the teeth, from :func:`.tooth_motion.tooth_motions`."""
    tip: float
    """Tip radius of the receiving member [m]."""

    @property
    def side(self) -> float:
        """+1 if the receiver has external teeth, -1 if it has internal teeth."""
        return -self.given.side

    @cached_property
    def _stations(self) -> Array:
        """Arc lengths on the mating part of the given flank (n,) [m]."""
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
        """Whether the mating flank starts at an edge of the given tooth."""
        low = self.given.contact_range[0]
        return bool(self._stations[0] == low) and any(
            part.edge for part in self.given.segments[:2]
        )

    def slip(self, motion: ToothMotion, s: Array, theta: Array) -> Array:
        """Speed n . v of flank points along the flank normal n (n,) [m/rad].

        It is positive where the flank moves towards the receiver.

        Args:
            motion: Motion of the moving tooth.
            s: Arc lengths on the given flank (n,) [m].
            theta: Positions of the motion (n,) [rad].
        """
        points, normals, _ = self.given.evaluate(s)
        moved = motion.map_to(self.receiver, theta)
        return np.asarray(
            np.sum(moved.vectors(normals) * moved.velocities(points), axis=-1)
        )

    def contact(self, motion: ToothMotion, s: Array, guess: Array) -> Array:
        """Positions theta at which flank points s touch the envelope (n,) [rad].

        The result is the root of the meshing equation ``slip`` = 0 at which the slip
        changes from positive to negative. The root is bracketed around the guess and
        refined by the Illinois method. If the velocity of the motion is discontinuous
        there, at a step in the curvature of the wave generator, the result is the
        position of the step.

        Args:
            motion: Motion of the moving tooth.
            s: Arc lengths on the given flank (n,) [m].
            guess: Approximate positions (n,) [rad].
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
            # every fourth step bisects, so that the bracket also closes on a step
            halve = ~inside if k % 4 < 3 else np.ones_like(inside)
            theta = np.where(halve, 0.5 * (low + high), theta)
            f = self.slip(motion, s, theta)
            up = f > 0.0
            # Illinois method: halve the value of an end that is retained twice
            f_high = np.where(up & (last > 0.0), 0.5 * f_high, f_high)
            f_low = np.where(~up & (last < 0.0), 0.5 * f_low, f_low)
            low, f_low = np.where(up, theta, low), np.where(up, f, f_low)
            high, f_high = np.where(up, high, theta), np.where(up, f_high, f)
            last = np.where(up, 1.0, -1.0)
            if (np.abs(f) < 1e-16).all() or (high - low).max() < 1e-15:
                break
        return np.asarray(theta)

    def trace(self, run: EnvelopeRun, s: Array) -> tuple[Array, Array, Array]:
        """Envelope at the points s of the given flank.

        Args:
            run: Branch of the envelope.
            s: Arc lengths on the given flank (n,) [m].

        Returns:
            Points (n, 2) [m] and outward normals (n, 2) of the receiver, and positions
            theta (n,) [rad].
        """
        order = np.argsort(run.station)
        guess = np.interp(s, run.station[order], run.theta[order])
        theta = self.contact(run.motion, s, guess)
        points, normals, _ = self.given.evaluate(s)
        moved = run.motion.map_to(self.receiver, theta)
        return moved.points(points), -moved.vectors(normals), theta

    def trace_edge(self, run: EnvelopeRun, theta: Array) -> tuple[Array, Array]:
        """Path of the edge of the given flank in the frame of the receiver.

        Args:
            run: Part of the boundary that the edge forms.
            theta: Positions of the motion (n,) [rad].

        Returns:
            Points (n, 2) [m] and outward normals (n, 2) of the receiver.
        """
        low = np.full(theta.shape, self.given.contact_range[0])
        points, normals, _ = self.given.evaluate(low)
        moved = run.motion.map_to(self.receiver, theta)
        velocity = moved.velocities(points)
        normal = np.stack([-velocity[:, 1], velocity[:, 0]], axis=-1)
        normal /= np.hypot(normal[:, 0], normal[:, 1])[:, None]
        # out of the steel of the receiver, on the side opposite to the flank normal
        sign = np.sign(np.sum(normal * -moved.vectors(normals), axis=-1))
        return moved.points(points), normal * sign[:, None]

    @cached_property
    def _table(self) -> tuple[Array, Array, Array]:
        """Radii [m] and angles from +y [rad] of flank samples, and positions [rad].

        The first two arrays have the axes motion, position theta and flank sample.
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
        """The radius that is nearest to the root of the receiver [m]."""
        return float(radii.min() if self.side > 0.0 else radii.max())

    @property
    def reach(self) -> float:
        """Radius nearest to the receiver's root that the mating flank reaches [m]."""
        return self._deepest(self._table[0])

    @property
    def summit(self) -> float:
        """Radius nearest to the receiver's root that the given tooth reaches [m]."""
        top = np.array([0.0, self.given.addendum_radius])
        theta = self._table[2]
        wide = np.broadcast_to(top, (len(theta), 2))
        paths = [m.map_to(self.receiver, theta).points(wide) for m in self.motions]
        return self._deepest(np.hypot(*np.concatenate(paths).T))

    @property
    def floor(self) -> float:
        """Radius nearest to the receiver's root that the given root reaches [m].

        The tip of the receiver must not extend beyond this radius.
        """
        return self._deepest(self._table[0][..., -1])

    def runs(self) -> list[EnvelopeRun]:
        """Branches of the boundary from the tip of the receiver towards its root.

        The list is empty if the given flank does not reach the tip circle.
        """
        radii, angles, theta = self._table
        s = self._stations
        wanted = np.linspace(self.tip, self.reach, RADII)[:-1]
        best = np.full(RADII - 1, np.inf)
        # per radius: index of the motion, index of theta, whether the flank ends there
        where = np.zeros((3, RADII - 1), dtype=np.int64)
        station = np.zeros(RADII - 1)
        for m in range(len(self.motions)):
            angle = np.full((POSITIONS, RADII - 1), np.inf)
            arc_length = np.zeros((POSITIONS, RADII - 1))
            for i in range(POSITIONS):
                # radii of the given flank in increasing order
                order = slice(None) if self.side > 0.0 else slice(None, None, -1)
                r = radii[m, i, order]
                ok = (wanted >= r[0]) & (wanted <= r[-1])
                angle[i, ok] = np.interp(wanted[ok], r, angles[m, i, order])
                arc_length[i, ok] = np.interp(wanted[ok], r, s[order])
            i = np.argmin(angle, axis=0)
            k = np.arange(RADII - 1)
            better = angle[i, k] < best
            around = np.pad(angle, ((1, 1), (0, 0)), constant_values=np.inf)
            end = np.isinf(around[i, k]) | np.isinf(around[i + 2, k])
            best = np.where(better, angle[i, k], best)
            station = np.where(better, arc_length[i, k], station)
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

"""The torque-torsion loop and the catalogue figures read from it.

The module works on any loop, computed or measured, with or without hysteresis. The
mid-line is the mean of the branches of rising and of falling torque.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.arrays import frozen_array
from swgjoint.gear.catalogue import CatalogueRow
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.equilibrium import move_sliders, output_angle
from swgjoint.maps.potential import Potential
from swgjoint.maps.sliders import Sliders
from swgjoint.typing import Array

POINTS = 80
"""Number of torques on each of the four legs of a computed loop."""
LOST_MOTION_TORQUE = 0.04
"""Fraction of the rated torque at which lost motion is read [-]."""
_TURNS_AT = 0.02
"""Fraction of its range by which a torque path must return to count as a reversal [-];
smaller changes count as noise."""
REST = 1e-9
"""Remaining torque at a zero of the path as a fraction of the rated torque [-]. It
represents a free output that rests where the last load has left it."""
NO_WIDTH = 1e-7
"""Ratio of width to travel below which a loop counts as free of hysteresis [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TorqueLoop:
    """Torsion along a path of the output torque with a locked input."""

    torque: Array
    """Output torque T along the path [N·m]. Shape (n,)."""
    torsion: Array
    """Torsion with the sign of the torque [rad]. Shape (n,)."""

    def __post_init__(self) -> None:
        torque = frozen_array(self.torque, "torque [N·m]", ndim=1)
        if torque.size < 2 or torque.min() == torque.max():
            raise ValueError("torque [N·m] does not change along the loop")
        torsion = frozen_array(self.torsion, "torsion [rad]", shape=(torque.size,))
        object.__setattr__(self, "torque", torque)
        object.__setattr__(self, "torsion", torsion)

    def turns(self) -> list[tuple[int, int]]:
        """Indices of first and last sample of every part between torque reversals."""
        band = _TURNS_AT * float(np.ptp(self.torque))
        turns, extreme, rising = [0], 0, None
        for k, value in enumerate(self.torque):
            move = value - self.torque[extreme]
            if rising is None:
                if abs(move) > band:
                    rising, extreme = bool(move > 0.0), k
            elif (move >= 0.0) == rising:
                extreme = k
            elif abs(move) > band:
                turns.append(extreme)
                rising, extreme = not rising, k
        turns.append(self.torque.size - 1)
        return list(pairwise(turns))

    def legs(self) -> list[tuple[bool, Array, Array]]:
        """Parts between torque reversals: whether the torque rises, torque, torsion.

        The arrays [N·m, rad] are in order of strictly increasing torque even for a
        falling part; the torsion of samples of equal torque is averaged.
        """
        legs = []
        for a, b in self.turns():
            part = slice(a, b + 1)
            torque, place = np.unique(self.torque[part], return_inverse=True)
            counts = np.bincount(place)
            torsion = np.bincount(place, self.torsion[part]) / counts
            legs.append((bool(self.torque[b] > self.torque[a]), torque, torsion))
        return legs

    def branch(self, torque: ArrayLike, *, rising: bool) -> Array:
        """Torsion while the torque rises or falls [rad]; NaN outside the branch.

        Later parts of the loop take precedence, so the first loading from rest is used
        only at torques that no other part covers.

        Args:
            torque: Torques at which to read the branch, any shape [N·m].
            rising: Whether to read the branch of rising or of falling torque.
        """
        wanted = np.asarray(torque, float)
        values = np.full(wanted.shape, np.nan)
        for direction, at, torsion in reversed(self.legs()):
            if direction == rising:
                inside = (wanted >= at[0]) & (wanted <= at[-1]) & np.isnan(values)
                values = np.where(inside, np.interp(wanted, at, torsion), values)
        return values

    def mid_line(self, torque: ArrayLike) -> Array:
        """Mean of both branches [rad], or the only branch that covers a torque.

        NaN at torques outside the loop.
        """
        both = np.stack([self.branch(torque, rising=r) for r in (True, False)])
        known = ~np.isnan(both)
        total = np.where(known, both, 0.0).sum(axis=0)
        count = known.sum(axis=0)
        return np.asarray(np.where(count, total / np.maximum(count, 1), np.nan))

    def hysteresis_loss(self) -> float:
        """Width of the loop at zero torque [rad]; NaN if a branch is missing there."""
        falling, rising = (self.branch(0.0, rising=r) for r in (False, True))
        return float(falling - rising)

    def stiffness(self, low: float, high: float) -> float:
        """Mean slope of the mid-line over low..high and -high..-low [N·m/rad].

        It is the slope of the chord over both signs of the torque, or over one sign if
        the loop covers only that one; NaN if it covers neither.

        Args:
            low: Lower torque of the chord [N·m].
            high: Upper torque of the chord [N·m].
        """
        x = self.mid_line([low, high, -low, -high])
        travel = [x[1] - x[0], x[2] - x[3]]
        sides = [value for value in travel if not np.isnan(value)]
        if not sides:
            return float("nan")
        return float((high - low) * len(sides) / sum(sides))

    def lost_motion(self, rated_torque: float) -> float:
        """Torsion of the mid-line at +4 % minus at -4 % of rated torque [rad]."""
        at = LOST_MOTION_TORQUE * rated_torque
        return float(np.diff(self.mid_line([-at, at]))[0])


def largest_torque(ratings: Ratings | CatalogueRow) -> float:
    """Largest torque of the standard loop [N·m]: repeated peak, at least 1.5 T2."""
    return max(ratings.repeated_peak, 1.5 * ratings.T2)


def torque_loop(drive: Potential, *, theta: float = 0.0) -> TorqueLoop:
    """The standard loop 0 -> Tmax -> 0 -> -Tmax -> 0 with the input locked.

    The points include T1, T2 and the torques of the lost motion. Torsion is measured
    from the unloaded position (e0), as by an angle sensor at the output. With
    hysteresis the loop is run twice and the second pass is returned, which is closed
    and does not contain the first loading from rest.

    Args:
        drive: The map.
        theta: Angle at which the input is locked [rad].
    """
    r = drive.ratings
    top = largest_torque(r)
    named = [r.T1, r.T2, LOST_MOTION_TORQUE * r.rated_torque]
    up = np.unique(np.concatenate([np.linspace(0.0, top, POINTS), named]))
    # the loop starts in the middle of a clearance; later the unloaded output rests on
    # the side of the last load
    side = REST * r.rated_torque
    legs = [
        up,
        np.concatenate([up[-2:0:-1], [side], -up[1:]]),
        np.append(-up[-2:0:-1], -side),
    ]
    free = output_angle(drive, theta, 0.0)
    sliders = Sliders.relax(drive.hysteresis, float(drive.torsion(theta, free)))
    parts: list[Array] = []
    for leg in legs * (2 if drive.hysteresis else 1):
        psi = output_angle(drive, theta, leg, sliders)
        sliders = move_sliders(drive, sliders, theta, float(psi[-1]))
        parts.append(float(free) - psi)
    torque = np.concatenate(legs)
    torque[np.abs(torque) == side] = 0.0
    return TorqueLoop(torque=torque, torsion=np.concatenate(parts[-3:]))

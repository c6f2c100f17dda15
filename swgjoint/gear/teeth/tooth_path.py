"""Rigid flexspline teeth passing through the tooth spaces: path, clearance, overlap.

The teeth are rigid and follow the prescribed neutral line. An overlap is therefore the
distance that elastic deformation would have to take up; it is not a measure of stress.
One tooth, followed from half-way before a lobe to half-way after it, represents all
teeth at all times.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from swgjoint.arrays import frozen_array
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.tooth_motion import ToothMotion, tooth_motions
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.typing import Array

Where = Literal["flank", "flexspline_tip", "circular_spline_tip"]

POSITIONS, POINTS = 721, 401
"""Default numbers of positions of the tooth and of points on either flank."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothPath:
    """Passage of a rigid flexspline tooth through a space of the circular spline.

    ``clearance``, ``station``, ``point`` and ``where`` are, at every position, those of
    the lobe and flank with the smallest clearance. ``tip``, ``angle`` and ``flank``
    describe the motion at the first lobe.
    """

    theta: Array
    """Angle of the tooth from the lobe, on the undeflected rim (n,) [rad]."""
    tip: Array
    """Middle of the tooth's top land in the frame of the space (n, 2) [m]."""
    angle: Array
    """Inclination of the tooth to the axis of the space, counter-clockwise (n,)
    [rad]."""
    clearance: Array
    """Smallest distance between the flanks, negative where they overlap and infinite
    where the tooth is outside the space (n,) [m]."""
    station: Array
    """Arc length of the closest point on the flexspline profile (n,) [m]."""
    point: Array
    """Position of the closest point in the frame of the circular-spline tooth that
    :meth:`.ToothMotion.to_circular_spline` describes (n, 2) [m]."""
    where: tuple[Where, ...]
    """Location of the closest point at every position: a flank, or the edge or rounding
    at the tip of a member (n,)."""
    flank: Array
    """Right flank of the tooth at every position, in the frame of the space, for
    drawing (n, m, 2) [m]."""

    def __post_init__(self) -> None:
        for key in ("theta", "tip", "angle", "station", "point", "flank"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), key))
        clearance = np.array(self.clearance)
        clearance.setflags(write=False)
        object.__setattr__(self, "clearance", clearance)

    @property
    def smallest_clearance(self) -> float:
        """Smallest clearance during the passage, negative for overlap [m]."""
        return float(self.clearance.min())

    @property
    def interference(self) -> float:
        """Largest overlap during the passage [m]; zero if there is none."""
        return max(0.0, -self.smallest_clearance)

    @property
    def worst(self) -> int:
        """Index of the position with the smallest clearance."""
        return int(np.argmin(self.clearance))

    @property
    def engaged(self) -> float:
        """Range of theta over which the tooth is inside the space [rad]."""
        inside = self.theta[np.isfinite(self.clearance)]
        return float(inside[-1] - inside[0]) if inside.size else 0.0


def tooth_path(
    design: Design, *, positions: int = POSITIONS, points: int = POINTS
) -> ToothPath:
    """Passage of the flexspline tooth through the space, for the worst lobe and flank.

    Args:
        design: The drive.
        positions: Number of positions from half-way before the lobe to half-way after.
        points: Number of points on either flank that are tested against the other
            flank.

    Raises:
        DesignError: If a profile or the wave generator cannot be built.
    """
    flexspline = tooth_profile(design, "flexspline")
    circular = tooth_profile(design, "circular_spline")
    motions = tooth_motions(design)
    theta = np.linspace(-1.0, 1.0, positions) * motions[0].half_range
    paths = [_passage(m, flexspline, circular, theta, points) for m in motions]
    clearance = np.stack([path[0] for path in paths])
    worst = np.argmin(clearance, axis=0)
    index = np.arange(positions)

    def chosen(k: int) -> Array:
        return np.asarray(np.stack([path[k] for path in paths])[worst, index])

    first = motions[0].in_space(theta)
    top = np.array([0.0, flexspline.addendum_radius])
    outline, _, _ = flexspline.evaluate(np.linspace(0.0, flexspline.stations[-1], 120))
    kinds: tuple[Where, ...] = ("flank", "flexspline_tip", "circular_spline_tip")
    return ToothPath(
        theta=theta,
        tip=first.points(np.broadcast_to(top, (positions, 2))),
        angle=np.arctan2(first.turn[:, 1, 0], first.turn[:, 0, 0]),
        clearance=clearance[worst, index],
        station=chosen(1),
        point=chosen(2),
        where=tuple(kinds[int(k)] for k in chosen(3)),
        flank=first.points(np.broadcast_to(outline, (positions, *outline.shape))),
    )


def _tip_end(profile: ToothProfile) -> float:
    """Arc length at which the tip of a flank ends [m].

    The tip is the tip arc of the profile. A profile that starts at an edge has no such
    arc; contact at the edge is then found at the first points of the flank, so the tip
    is the first 0.1 % of the flank.
    """
    low, high = profile.contact_range
    names = [part.name for part in profile.segments]
    if "tip" in names:
        return profile.range_of("tip", "tip")[1]
    return low + 1e-3 * (high - low)


def _passage(
    motion: ToothMotion,
    flexspline: ToothProfile,
    circular: ToothProfile,
    theta: Array,
    count: int,
) -> tuple[Array, Array, Array, Array]:
    """Clearance [m], station [m], point [m] and kind of the closest point per position.

    The kind is an index into the values of ``Where``. Points of the flexspline
    flank are tested against the circular spline and vice versa, so that contact at an
    edge is found as a point of the flank that ends there.
    """
    n = len(theta)
    low, high = flexspline.contact_range
    s = np.linspace(low, high, count)
    points, _, _ = flexspline.evaluate(s)
    seen = motion.to_circular_spline(theta).points(
        np.broadcast_to(points, (n, count, 2))
    )
    inside = np.hypot(seen[..., 0], seen[..., 1]) > circular.addendum_radius
    gap = np.full((n, count), np.inf)
    gap[inside] = circular.signed_distance(seen[inside])[0]
    k = np.argmin(gap, axis=1)
    index = np.arange(n)
    clearance, station = gap[index, k], s[k]
    where = np.where(station <= _tip_end(flexspline), 1.0, 0.0)
    point = seen[index, k]

    low, high = circular.contact_range
    s_c = np.linspace(low, high, count)
    points_c, _, _ = circular.evaluate(s_c)
    there = motion.to_flexspline(theta).points(np.broadcast_to(points_c, (n, count, 2)))
    radius = np.hypot(there[..., 0], there[..., 1])
    inside = radius < flexspline.addendum_radius
    gap = np.full((n, count), np.inf)
    gap[inside] = flexspline.signed_distance(there[inside])[0]
    k = np.argmin(gap, axis=1)
    better = gap[index, k] < clearance
    # foot on the flexspline flank: the sample nearest to the point
    foot = np.array([s[np.argmin(np.hypot(*(points - p).T))] for p in there[index, k]])
    station = np.where(better, foot, station)
    point = np.where(better[:, None], points_c[k], point)
    at_tip = np.where(s_c[k] <= _tip_end(circular), 2.0, 0.0)
    where = np.where(better, at_tip, where)
    return np.minimum(clearance, gap[index, k]), station, point, where

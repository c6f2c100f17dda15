"""Tooth flank outlines as chains of circular arcs and straight lines.

A flank lies in the frame of its tooth: the tooth is centred on the +y axis, the origin
is the gear axis, and the right flank (x > 0) is described. The chain runs from the
middle of the top land to the middle of the root land; normals point out of the steel.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, cos, hypot, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swgjoint.errors import DesignError
from swgjoint.gear.design import Design
from swgjoint.gear.design_sections import Member, QuadrupleCircularArc
from swgjoint.units import deg, mm

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One circular arc or straight line of a flank, traversed from tip to root."""

    name: str
    start: tuple[float, float]
    end: tuple[float, float]
    length: float
    centre: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0
    """Zero for a straight line [m]."""
    convex: bool = True
    """Whether the centre of the arc lies on the side of the steel."""
    angle_start: float = 0.0
    angle_end: float = 0.0
    """Directions of the end points from the centre [rad]."""

    @property
    def curvature(self) -> float:
        """Signed curvature, positive where the steel bulges out [1/m]."""
        if self.radius == 0.0:
            return 0.0
        return (1.0 if self.convex else -1.0) / self.radius


def _arc(
    name: str,
    centre: tuple[float, float],
    radius: float,
    start: float,
    end: float,
    convex: bool,
) -> Segment:
    def at(angle: float) -> tuple[float, float]:
        return centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)

    return Segment(
        name=name,
        start=at(start),
        end=at(end),
        length=radius * abs(end - start),
        centre=centre,
        radius=radius,
        convex=convex,
        angle_start=start,
        angle_end=end,
    )


@dataclass(frozen=True, kw_only=True)
class ToothProfile:
    """Right flank of one tooth of a member, from top-land to root-land middle [m]."""

    member: str
    teeth: int
    internal: bool
    pitch_radius: float
    addendum_radius: float
    dedendum_radius: float
    segments: tuple[Segment, ...]
    straight_length: float

    @property
    def half_pitch(self) -> float:
        """Half the angular pitch, pi/N [rad]."""
        return pi / self.teeth

    @property
    def stations(self) -> Array:
        """Arc length at the ends of the segments [m]. Shape (n_segments + 1,)."""
        return np.concatenate([[0.0], np.cumsum([p.length for p in self.segments])])

    def range_of(self, first: str, last: str) -> tuple[float, float]:
        """Arc length at the start of one segment and the end of another [m]."""
        names = [p.name for p in self.segments]
        s = self.stations
        return float(s[names.index(first)]), float(s[names.index(last) + 1])

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Point, outward normal and signed curvature at arc length s.

        Returns:
            Points (n, 2) [m], unit normals (n, 2), curvatures (n,) [1/m].
        """
        s = np.asarray(s, dtype=float)
        stations = self.stations
        index = np.clip(
            np.searchsorted(stations, s, side="right") - 1, 0, len(self.segments) - 1
        )
        points = np.empty((*s.shape, 2))
        normals = np.empty((*s.shape, 2))
        curvature = np.empty(s.shape)
        for k, part in enumerate(self.segments):
            here = index == k
            t = (s[here] - stations[k]) / part.length
            if part.radius == 0.0:
                start, end = np.array(part.start), np.array(part.end)
                points[here] = start + t[:, None] * (end - start)
                direction = (end - start) / part.length
                # from tip to root along the right flank the steel is on the right hand
                # for an external tooth and on the left for an internal one
                side = 1.0 if not self.internal else -1.0
                normals[here] = side * np.array([-direction[1], direction[0]])
            else:
                angle = part.angle_start + t * (part.angle_end - part.angle_start)
                radial = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
                points[here] = np.array(part.centre) + part.radius * radial
                normals[here] = radial if part.convex else -radial
            curvature[here] = part.curvature
        return points, normals, curvature

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Distance of points near the flank, positive outside the steel.

        The closest foot over all segments on which the point projects; a point that
        projects on none (beyond the ends of the chain) gets infinity.

        Args:
            points: Shape (n, 2) [m].

        Returns:
            Distances (n,) [m], outward normals at the foot (n, 2), curvatures (n,).
        """
        n = len(points)
        best = np.full(n, np.inf)
        normals = np.zeros((n, 2))
        curvature = np.zeros(n)
        for part in self.segments:
            if part.radius == 0.0:
                start = np.array(part.start)
                direction = (np.array(part.end) - start) / part.length
                side = 1.0 if not self.internal else -1.0
                normal = side * np.array([-direction[1], direction[0]])
                rel = points - start
                along = rel @ direction
                inside = (along >= 0.0) & (along <= part.length)
                distance = rel @ normal
                foot_normal = np.broadcast_to(normal, (n, 2))
            else:
                rel = points - np.array(part.centre)
                r = np.hypot(rel[:, 0], rel[:, 1])
                middle = 0.5 * (part.angle_start + part.angle_end)
                half = 0.5 * abs(part.angle_end - part.angle_start)
                # angle from the middle of the arc, free of branch cuts
                c, d = cos(middle), sin(middle)
                angle = np.arctan2(
                    rel[:, 1] * c - rel[:, 0] * d, rel[:, 0] * c + rel[:, 1] * d
                )
                inside = np.abs(angle) <= half * (1.0 + 1e-9)
                sign = 1.0 if part.convex else -1.0
                distance = sign * (r - part.radius)
                foot_normal = sign * rel / np.maximum(r, 1e-300)[:, None]
            take = inside & (np.abs(distance) < np.abs(best))
            best[take] = distance[take]
            normals[take] = foot_normal[take]
            curvature[take] = part.curvature
        return best, normals, curvature


def tooth_profile(design: Design, member: str) -> ToothProfile:
    """Tooth profile of ``flexspline`` or ``circular_spline``.

    Raises:
        DesignError: If the kind is not available or the tooth cannot be built.
    """
    spec = design.flexspline if member == "flexspline" else design.circular_spline
    if not isinstance(spec.profile, QuadrupleCircularArc):
        raise DesignError(
            f"{design.drive.name}: {member}.profile.kind = {spec.profile.kind!r} "
            "cannot be built yet; available: 'qca'"
        )
    return _quadruple_arc(design, member, spec, spec.profile)


def _reach(
    origin: tuple[float, float],
    step: float,
    radius: float,
    mirror: float,
    first: float,
    fault: str,
) -> float:
    """Angle >= first at which origin + step (cos a, mirror sin a) has a given radius.

    The equation |o|^2 + step^2 + 2 step o.(cos a, mirror sin a) = radius^2 in a.
    """
    ox, oy = origin[0], mirror * origin[1]
    size = hypot(ox, oy)
    value = (radius**2 - size**2 - step**2) / (2.0 * step * size)
    if not -1.0 <= value <= 1.0:
        raise DesignError(fault)
    direction = atan2(oy, ox)
    roots = [direction + sign * acos(value) for sign in (1.0, -1.0)]
    above = sorted(r for r in roots if r >= first)
    if not above:
        raise DesignError(fault)
    return above[0]


def _quadruple_arc(
    design: Design, member: str, spec: Member, p: QuadrupleCircularArc
) -> ToothProfile:
    """Quadruple circular arc profile.

    External teeth follow thesis section 3.3.3 (eqs 3.21-3.49); for internal teeth the
    corrected pressure angle is alpha + alpha_P and tangents and normals are mirrored
    radially (the printed formula holds for external teeth only). Both aperture
    equations are circle intersections and are solved in closed form.
    """
    internal = member == "circular_spline"
    drive = design.drive
    teeth = drive.teeth_circular_spline if internal else drive.teeth_flexspline
    where = f"{drive.name}: {member}"
    side = -1.0 if internal else 1.0
    module = drive.module_mm * mm
    pitch = teeth * module / 2.0
    tip = pitch + side * spec.addendum_coefficient * module
    root = pitch - side * spec.dedendum_coefficient * module
    half_pitch = pi / teeth
    alpha_p = spec.thickness_coefficient * half_pitch / 2.0  # (3.22)
    alpha = spec.pressure_angle_deg * deg - side * alpha_p  # (3.27), corrected
    r_t, r_a = p.tip_radius_mm * mm, p.addendum_radius_mm * mm
    r_d, r_r = p.dedendum_radius_mm * mm, p.root_radius_mm * mm
    length, split = p.straight_mm * mm, p.straight_split

    pitch_point = (pitch * sin(alpha_p), pitch * cos(alpha_p))  # (3.23)
    n_l = (cos(alpha), side * sin(alpha))  # (3.28)
    t_l = (-sin(alpha), side * cos(alpha))  # (3.29), towards the tip

    def along(
        origin: tuple[float, float], step: float, direction: tuple[float, float]
    ) -> tuple[float, float]:
        return origin[0] + step * direction[0], origin[1] + step * direction[1]

    p_a = along(pitch_point, split * length, t_l)  # (3.30)
    p_d = along(pitch_point, -(1.0 - split) * length, t_l)  # (3.31)
    o_a = along(p_a, -r_a, n_l)  # (3.32)
    o_d = along(p_d, r_d, n_l)  # (3.33)

    if not 0.0 < r_t < r_a:
        raise DesignError(
            f"{where}.profile.tip_radius_mm = {p.tip_radius_mm} mm must lie between 0 "
            f"and addendum_radius_mm = {p.addendum_radius_mm} mm"
        )
    if not 0.0 < r_r < r_d:
        raise DesignError(
            f"{where}.profile.root_radius_mm = {p.root_radius_mm} mm must lie between "
            f"0 and dedendum_radius_mm = {p.dedendum_radius_mm} mm"
        )
    # (3.47): |O_t| +- r_t = r_A and |O_r| -+ r_r = r_D
    end_a = _reach(
        o_a,
        r_a - r_t,
        tip - side * r_t,
        side,
        alpha,
        f"{where}.profile.addendum_radius_mm = {p.addendum_radius_mm} mm: the addendum "
        "arc does not reach the tip; accepted: a larger addendum_radius_mm, a smaller "
        "tip_radius_mm or a shorter straight_mm",
    )
    end_d = _reach(
        o_d,
        -(r_d - r_r),
        root + side * r_r,
        side,
        alpha,
        f"{where}.profile.dedendum_radius_mm = {p.dedendum_radius_mm} mm: the dedendum "
        "arc does not reach the root; accepted: a larger dedendum_radius_mm, a smaller "
        "root_radius_mm or a shorter straight_mm",
    )
    o_t = (o_a[0] + (r_a - r_t) * cos(end_a), o_a[1] + side * (r_a - r_t) * sin(end_a))
    o_r = (o_d[0] - (r_d - r_r) * cos(end_d), o_d[1] - side * (r_d - r_r) * sin(end_d))
    # (3.44): common normals with the top and the root land, as angles like alpha;
    # those of an internal tooth point to the axis
    end_t = atan2(o_t[1], side * o_t[0])
    end_r = atan2(o_r[1], side * o_r[0])

    gamma_t = atan2(o_t[0], o_t[1])  # angle of the top land's end from the tooth axis
    gamma_r = atan2(o_r[0], o_r[1])
    faults = [
        (end_t >= end_a, "tip_radius_mm", p.tip_radius_mm, "the tip arc turns back"),
        (end_r >= end_d, "root_radius_mm", p.root_radius_mm, "the root arc turns back"),
        (gamma_t >= 0.0, "tip_radius_mm", p.tip_radius_mm, "the tooth is pointed"),
        (
            gamma_r <= half_pitch,
            "dedendum_radius_mm",
            p.dedendum_radius_mm,
            f"the root arc ends at {gamma_r / deg:.3f} deg from the tooth axis, beyond "
            f"half the pitch of {half_pitch / deg:.3f} deg",
        ),
    ]
    for good, key, value, what in faults:
        if not good:
            raise DesignError(
                f"{where}.profile.{key} = {value} mm: {what}; accepted: smaller radii "
                "or a smaller thickness_coefficient"
            )

    def direction(angle: float) -> float:
        return angle if not internal else -angle

    segments = []
    if gamma_t > 0.0:
        segments.append(
            _arc("top_land", (0.0, 0.0), tip, pi / 2, pi / 2 - gamma_t, not internal)
        )
    segments += [
        _arc("tip", o_t, r_t, direction(end_t), direction(end_a), True),
        _arc("addendum", o_a, r_a, direction(end_a), direction(alpha), True),
        Segment(name="straight", start=p_a, end=p_d, length=length),
        _arc("dedendum", o_d, r_d, direction(alpha) + pi, direction(end_d) + pi, False),
        _arc("root", o_r, r_r, direction(end_d) + pi, direction(end_r) + pi, False),
    ]
    if gamma_r < half_pitch:
        segments.append(
            _arc(
                "root_land",
                (0.0, 0.0),
                root,
                pi / 2 - gamma_r,
                pi / 2 - half_pitch,
                not internal,
            )
        )
    segments = [part for part in segments if part.length > 0.0]
    return ToothProfile(
        member=member,
        teeth=teeth,
        internal=internal,
        pitch_radius=pitch,
        addendum_radius=tip,
        dedendum_radius=root,
        segments=tuple(segments),
        straight_length=length,
    )

"""Profiles defined directly by arcs: double circular, quadruple circular and two-arc.

Angles such as alpha are counted from the +x axis of the tooth frame towards the tip:
counter-clockwise for external teeth and clockwise (mirrored radially) for internal
teeth. Equation numbers are those of the thesis.
"""

from __future__ import annotations

from math import acos, atan2, cos, hypot, pi, sin, sqrt

from swgjoint.gear.design.design import Design
from swgjoint.gear.design.sections import (
    DoubleCircularArc,
    QuadrupleCircularArc,
    TwoArc,
)
from swgjoint.gear.teeth.blank import Blank, ToothFault, blank
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.gear.teeth.segments import Piece, Point, arc, line
from swgjoint.gear.teeth.tooth_bounds import with_bounds
from swgjoint.units import deg, mm

LARGEST_CORRECTED_ANGLE = 0.5 * pi
"""Corrected pressure angle of a flank that is tangential to the pitch circle [rad]."""
TWO_ARC = {
    "addendum_radius_mm": 1.09,  # R_1
    "addendum_offset_mm": 0.71,  # L_1
    "addendum_shift_mm": 0.19,  # X_1
    "dedendum_radius_mm": 1.2,  # R_2
    "dedendum_offset_mm": 1.54,  # L_2
    "dedendum_shift_mm": 0.26,  # X_2
    "root_radius_mm": 0.6,  # chosen as half of R_2; the article states no radius
}
"""Lengths of the article on an 80:1 drive, as multiples of the module."""
SHORTEST = 1e-9
"""Smallest length of a straight segment [m]; shorter ones have no exact direction."""


def arc_profile(design: Design, member: str, *, bounds: bool = True) -> ToothProfile:
    """Profile of a member whose kind is ``qca``, ``dca`` or ``two_arc``.

    Args:
        design: The drive.
        member: ``flexspline`` or ``circular_spline``.
        bounds: Whether an error states which values would be accepted.

    Raises:
        DesignError: If the tooth cannot be built, in one line that names the key.
    """
    start = blank(design, member)
    try:
        return _built(start)
    except ToothFault as fault:
        if not bounds:
            raise
        raise with_bounds(fault, start, _built) from None


def _built(start: Blank) -> ToothProfile:
    spec = start.spec.profile
    if isinstance(spec, QuadrupleCircularArc):
        return _quadruple_arc(start, spec)
    if isinstance(spec, DoubleCircularArc):
        return _double_arc(start, spec)
    if isinstance(spec, TwoArc):
        return _two_arc(start, spec)
    raise AssertionError(f"{spec.kind} is not an arc profile")


def _along(origin: Point, step: float, direction: Point) -> Point:
    return origin[0] + step * direction[0], origin[1] + step * direction[1]


def _reach(
    origin: Point, step: float, radius: float, mirror: float, first: float
) -> float | None:
    """Smallest angle a >= first at which a point has a given distance from the axis.

    The point is o + step (cos a, mirror sin a), so a solves |o|^2 + step^2 + 2 step
    o.(cos a, mirror sin a) = radius^2. None if there is no solution.
    """
    ox, oy = origin[0], mirror * origin[1]
    size = hypot(ox, oy)
    value = (radius**2 - size**2 - step**2) / (2.0 * step * size)
    if not -1.0 <= value <= 1.0:
        return None
    direction = atan2(oy, ox)
    roots = [direction + sign * acos(value) for sign in (1.0, -1.0)]
    above = sorted(r for r in roots if r >= first)
    return above[0] if above else None


class _Flank:
    """Pitch point, normal and straight segment of a flank, thesis eqs 3.23 to 3.33.

    External teeth follow the thesis. For internal teeth, the corrected pressure angle
    is alpha + alpha_P, and tangents and normals are mirrored radially, because the
    printed formula applies only to external teeth.
    """

    def __init__(self, start: Blank) -> None:
        side, half = start.side, start.half_thickness
        self.alpha = alpha = start.pressure_angle - side * half  # (3.27), corrected
        if not alpha < LARGEST_CORRECTED_ANGLE:
            raise start.fault(
                "pressure_angle_deg",
                f"with alpha_P = {half / deg:.3f} deg the flank is tangential to the "
                "pitch circle; accepted: a smaller angle or thickness_coefficient",
            )
        self.pitch_point = (start.pitch * sin(half), start.pitch * cos(half))  # (3.23)
        self.n = (cos(alpha), side * sin(alpha))  # (3.28)
        self.t = (-sin(alpha), side * cos(alpha))  # (3.29), towards the tip

    def split(self, length: float, share: float) -> tuple[Point, Point]:
        """End points of the straight segment on the tip side and the root side [m]."""
        p_a = _along(self.pitch_point, share * length, self.t)  # (3.30)
        p_d = _along(self.pitch_point, -(1.0 - share) * length, self.t)  # (3.31)
        return p_a, p_d


def _angle_of(point: Point) -> float:
    """Angle from the tooth axis, clockwise [rad]."""
    return atan2(point[0], point[1])


def _check_straight(start: Blank, p_a: Point, p_d: Point, key: str) -> None:
    """Check that the straight segment ends between the tip and the root circle."""
    if start.side * (start.tip - hypot(*p_a)) <= 0.0:
        raise start.fault(
            key, "the straight segment extends beyond the tip; accepted: a shorter one"
        )
    if start.side * (hypot(*p_d) - start.root) <= 0.0:
        raise start.fault(
            key, "the straight segment extends beyond the root; accepted: a shorter one"
        )


def _check_root_end(start: Blank, gamma: float, key: str) -> None:
    """Check that the arc at the root ends before the middle of the tooth space."""
    if gamma > start.half_pitch:
        raise start.fault(
            key,
            f"the root arc ends at {gamma / deg:.3f} deg from the tooth axis, beyond "
            f"half the pitch of {start.half_pitch / deg:.3f} deg; accepted: smaller "
            "radii or a smaller thickness_coefficient",
        )


def _quadruple_arc(start: Blank, p: QuadrupleCircularArc) -> ToothProfile:
    """Quadruple circular arc profile, thesis section 3.3.3 (eqs 3.21-3.49).

    Both aperture angles follow from intersections of circles in closed form.
    """
    flank, side = _Flank(start), start.side
    alpha, n_l = flank.alpha, flank.n
    r_t, r_a = p.tip_radius_mm * mm, p.addendum_radius_mm * mm
    r_d, r_r = p.dedendum_radius_mm * mm, p.root_radius_mm * mm
    length = p.straight_mm * mm
    if not 0.0 < r_t < r_a:
        raise start.fault(
            "profile.tip_radius_mm",
            f"expected a value below addendum_radius_mm = {p.addendum_radius_mm} mm",
        )
    if not 0.0 < r_r < r_d:
        raise start.fault(
            "profile.root_radius_mm",
            f"expected a value below dedendum_radius_mm = {p.dedendum_radius_mm} mm",
        )
    p_a, p_d = flank.split(length, p.straight_split)
    _check_straight(start, p_a, p_d, "profile.straight_mm")
    o_a = _along(p_a, -r_a, n_l)  # (3.32)
    o_d = _along(p_d, r_d, n_l)  # (3.33)

    # (3.47): |O_t| +- r_t = r_A and |O_r| -+ r_r = r_D, upper signs for external teeth
    end_a = _reach(o_a, r_a - r_t, start.tip - side * r_t, side, alpha)
    if end_a is None:
        raise start.fault(
            "profile.addendum_radius_mm",
            "the addendum arc does not reach the tip; accepted: a larger "
            "addendum_radius_mm, a smaller tip_radius_mm or a shorter straight_mm",
        )
    end_d = _reach(o_d, -(r_d - r_r), start.root + side * r_r, side, alpha)
    if end_d is None:
        raise start.fault(
            "profile.dedendum_radius_mm",
            "the dedendum arc does not reach the root; accepted: a larger "
            "dedendum_radius_mm, a smaller root_radius_mm or a shorter straight_mm",
        )
    # (3.42), (3.43)
    o_t = _along(o_a, r_a - r_t, (cos(end_a), side * sin(end_a)))
    o_r = _along(o_d, -(r_d - r_r), (cos(end_d), side * sin(end_d)))
    # (3.44): directions of the common normals with top and root land, counted like
    # alpha; the normals of an internal tooth point towards the axis
    end_t = atan2(o_t[1], side * o_t[0])
    end_r = atan2(o_r[1], side * o_r[0])
    gamma_t, gamma_r = _angle_of(o_t), _angle_of(o_r)
    advice = "; accepted: smaller radii or a smaller thickness_coefficient"
    if end_t < end_a:
        raise start.fault("profile.tip_radius_mm", "the tip arc turns back" + advice)
    if end_r < end_d:
        raise start.fault("profile.root_radius_mm", "the root arc turns back" + advice)
    if gamma_t < 0.0:
        raise start.fault("profile.tip_radius_mm", "the tooth is pointed" + advice)
    _check_root_end(start, gamma_r, "profile.dedendum_radius_mm")

    pieces: list[Piece] = [
        arc("tip", o_t, r_t, side * end_t, side * end_a, True),
        arc("addendum", o_a, r_a, side * end_a, side * alpha, True),
    ]
    if length > 0.0:
        pieces.append(line("straight", p_a, p_d))
    pieces += [
        arc("dedendum", o_d, r_d, side * alpha + pi, side * end_d + pi, False),
        arc("root", o_r, r_r, side * end_d + pi, side * end_r + pi, False),
    ]
    return start.profile(gamma_t, pieces, gamma_r, length)


def _double_arc(start: Blank, p: DoubleCircularArc) -> ToothProfile:
    r"""Double circular arc profile, thesis section 3.3.2 (eqs 3.21-3.39).

    The dedendum arc is tangent to the root circle if its centre is at the distance
    :math:`|O_d| = r_D \pm r_d` from the axis (upper sign for external teeth). With
    :math:`O_d = P_P + r_d n_l - (1 - c_l) l\, t_l` this is a quadratic equation for the
    length l of the straight segment. The third condition of (3.39) expresses the same
    tangency. The addendum arc meets the tip circle at an edge.
    """
    flank, side = _Flank(start), start.side
    alpha = flank.alpha
    r_a, r_d = p.addendum_radius_mm * mm, p.dedendum_radius_mm * mm
    share = p.straight_split
    if share >= 1.0:
        raise start.fault(
            "profile.straight_split",
            "the dedendum arc cannot reach the root with any length of the straight"
            " segment; accepted: < 1",
        )
    centre = start.root + side * r_d
    if centre <= 0.0:
        raise start.fault(
            "profile.dedendum_radius_mm", "larger than the radius of the root circle"
        )
    q = _along(flank.pitch_point, r_d, flank.n)
    along = q[0] * flank.t[0] + q[1] * flank.t[1]
    square = along**2 - (q[0] ** 2 + q[1] ** 2 - centre**2)
    smaller = "; accepted: a smaller dedendum_radius_mm"
    if square < 0.0:
        raise start.fault(
            "profile.dedendum_radius_mm", "the arc does not reach the root" + smaller
        )
    # of the two solutions, the one near the tooth
    reach = along - side * sqrt(square)
    length = reach / (1.0 - share)
    if length < SHORTEST:
        raise start.fault(
            "profile.dedendum_radius_mm",
            f"the straight length would be {length / mm:.4g} mm" + smaller,
        )
    p_a, p_d = flank.split(length, share)
    _check_straight(start, p_a, p_d, "profile.straight_split")
    o_a = _along(p_a, -r_a, flank.n)  # (3.32)
    o_d = _along(p_d, r_d, flank.n)  # (3.33)
    end_a = _reach(o_a, r_a, start.tip, side, alpha)  # r_A = |P_t|, (3.39)
    if end_a is None:
        raise start.fault(
            "profile.addendum_radius_mm",
            "the addendum arc does not reach the tip; accepted: a larger radius",
        )
    end_d = atan2(o_d[1], side * o_d[0])
    p_t = _along(o_a, r_a, (cos(end_a), side * sin(end_a)))  # (3.36)
    gamma_t, gamma_r = _angle_of(p_t), _angle_of(o_d)
    if gamma_t < 0.0:
        raise start.fault(
            "profile.addendum_radius_mm",
            "the tooth is pointed; accepted: a larger radius or a larger "
            "thickness_coefficient",
        )
    if end_d <= alpha:
        raise start.fault("profile.dedendum_radius_mm", "the arc turns back" + smaller)
    _check_root_end(start, gamma_r, "profile.dedendum_radius_mm")
    pieces: list[Piece] = [
        arc(
            "addendum",
            o_a,
            r_a,
            side * end_a,
            side * alpha,
            True,
            edge=gamma_t > 0.0,
        ),
        line("straight", p_a, p_d),
        arc("dedendum", o_d, r_d, side * alpha + pi, side * end_d + pi, False),
    ]
    return start.profile(gamma_t, pieces, gamma_r, length)


def _two_arc(start: Blank, p: TwoArc) -> ToothProfile:
    """Convex and concave arc joined by their common tangent, article on an 80:1 drive.

    In the tooth frame, the centres are (-L_1, r_P - X_1) and (L_2, r_P + X_2), as in
    the article. For an internal tooth, X_1 and X_2 are mirrored radially. The
    expressions of the article for X_1 and L_1 contradict its table and are not used.
    With the values of the table, the arcs are 0.005 modules apart, and the common
    tangent bridges this gap. Thickness and inclination at the pitch circle follow from
    the centres. The thickness coefficient rotates the flank by (c_P - 1) alpha_T / 2,
    which gives the backlash of thesis (6.3).
    """
    side = start.side

    def size(key: str) -> float:
        stated = getattr(p, key)
        return TWO_ARC[key] * start.module if stated is None else float(stated) * mm

    r_1, r_2 = size("addendum_radius_mm"), size("dedendum_radius_mm")
    r_r = size("root_radius_mm")
    turn = start.half_thickness - 0.5 * start.half_pitch

    def centre(across: float, up: float) -> Point:
        y = start.pitch + side * up
        return (
            across * cos(turn) + y * sin(turn),
            y * cos(turn) - across * sin(turn),
        )

    o_1 = centre(-size("addendum_offset_mm"), -size("addendum_shift_mm"))
    o_2 = centre(size("dedendum_offset_mm"), size("dedendum_shift_mm"))
    apart = (o_2[0] - o_1[0], side * (o_2[1] - o_1[1]))
    distance = hypot(*apart)
    if distance < r_1 + r_2:
        raise start.fault(
            "profile.dedendum_offset_mm",
            f"the arcs intersect: their centres are {distance / mm:.4g} mm apart;"
            " accepted: an offset that gives a distance of at least"
            f" {(r_1 + r_2) / mm:.4g} mm",
        )
    alpha = atan2(apart[1], apart[0]) + acos((r_1 + r_2) / distance)
    length = sqrt(max(distance**2 - (r_1 + r_2) ** 2, 0.0))
    if length < SHORTEST:
        length = 0.0
    if not alpha < LARGEST_CORRECTED_ANGLE:
        raise start.fault(
            "profile.dedendum_shift_mm", "the flank is tangential to the pitch circle"
        )
    n = (cos(alpha), side * sin(alpha))
    p_a, p_d = _along(o_1, r_1, n), _along(o_2, -r_2, n)
    _check_straight(start, p_a, p_d, "profile.dedendum_offset_mm")
    if not r_r < r_2:
        raise start.fault(
            "profile.root_radius_mm",
            f"expected a value below dedendum_radius_mm = {r_2 / mm:g} mm",
        )
    end_a = _reach(o_1, r_1, start.tip, side, alpha)
    gamma_t = -1.0
    if end_a is not None:
        p_t = _along(o_1, r_1, (cos(end_a), side * sin(end_a)))
        gamma_t = _angle_of(p_t)
    if end_a is None or gamma_t < 0.0:
        # intersection of the arc with the tooth axis
        height = o_1[1] + side * sqrt(max(r_1**2 - o_1[0] ** 2, 0.0))
        limit = side * (height - start.pitch) / start.module
        raise start.fault(
            "addendum_coefficient",
            f"the tooth is pointed; accepted: <= {limit:.4g} with these arcs",
        )
    end_d = _reach(o_2, -(r_2 - r_r), start.root + side * r_r, side, alpha)
    if end_d is None:
        limit = side * (start.pitch - (hypot(*o_2) - side * r_2)) / start.module
        raise start.fault(
            "dedendum_coefficient",
            f"the concave arc does not reach the root; accepted: <= {limit:.4g} with "
            "these arcs",
        )
    o_r = _along(o_2, -(r_2 - r_r), (cos(end_d), side * sin(end_d)))
    end_r = atan2(o_r[1], side * o_r[0])
    if end_r < end_d:
        raise start.fault(
            "profile.root_radius_mm",
            "the root arc turns back; accepted: a smaller radius",
        )
    gamma_r = _angle_of(o_r)
    _check_root_end(start, gamma_r, "profile.dedendum_offset_mm")
    pieces: list[Piece] = [
        arc(
            "addendum",
            o_1,
            r_1,
            side * end_a,
            side * alpha,
            True,
            edge=gamma_t > 0.0,
        )
    ]
    if length > 0.0:
        pieces.append(line("straight", p_a, p_d))
    pieces += [
        arc("dedendum", o_2, r_2, side * alpha + pi, side * end_d + pi, False),
        arc("root", o_r, r_r, side * end_d + pi, side * end_r + pi, False),
    ]
    return start.profile(gamma_t, pieces, gamma_r, length)

"""Parabolic wave generators, symmetric and asymmetric."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, atan2, cos, hypot, pi, sin, sqrt

from swgjoint.gear.wave_generators.chain import Chain
from swgjoint.gear.wave_generators.pieces import Arc, OutlinePiece, Parabola, Point
from swgjoint.units import deg, mm


@dataclass(frozen=True, kw_only=True)
class Side:
    """One side of a lobe: the parabola from its apex outwards and the connector arc."""

    coefficient: float
    """Coefficient a_p of the parabola [1/m]."""
    length_coefficient: float
    """Length coefficient C_p [-]; the parabola ends at x = C_p b, with the semi-minor
    axis b."""
    connector_radius: float
    """Radius r_c of the connector arc [m]."""


class OutlineFault(ValueError):
    """Error for parameters that give no outline.

    ``key`` is the key at fault in the table ``wave_generator``, and ``text`` the rest
    of the message.
    """

    def __init__(self, key: str, text: str) -> None:
        super().__init__(f"{key}{text}")
        self.key = key
        self.text = text


def parabolic(
    *,
    major: float,
    minor: float,
    left: Side,
    right: Side,
    turn: float = 0.0,
    prefixes: tuple[str, str] = ("", ""),
) -> Chain:
    """Outline with two parabolic lobes and three arcs on each side between them.

    From lobe to lobe there are a connector arc, a lateral arc and another connector
    arc. ``left`` and ``right`` are the sides of the upper lobe. The lower lobe is the
    upper lobe rotated by half a turn, so that both lobes deflect the flexspline
    identically for either direction of rotation. Equal sides without rotation give the
    symmetric outline of thesis 3.2.3.

    Args:
        major: Height a of the apex on the +y axis, the semi-major axis [m].
        minor: Semi-minor axis b; the lateral arcs touch the lines x = +-b [m].
        left: Side x < 0 of the upper lobe.
        right: Side x > 0 of the upper lobe.
        turn: Rotation of each lobe's parabola about its apex, counter-clockwise [rad]
            (lambda of thesis 5.7.1).
        prefixes: Prefixes of the keys of the left and right side in messages.

    Raises:
        OutlineFault: If the connector arcs cannot join the parabolas to lateral arcs.
    """
    apex = (0.0, major)
    x_l, x_r = left.length_coefficient * minor, right.length_coefficient * minor
    wing_l = Parabola(
        apex=apex, coefficient=left.coefficient, start=0.0, end=-x_l, turn=turn
    )
    wing_r = Parabola(
        apex=apex, coefficient=right.coefficient, start=x_r, end=0.0, turn=turn
    )
    # directions of the normals at the ends of the parabolas, thesis eq. (3.7)
    end_l = 0.5 * pi + turn + atan(2.0 * left.coefficient * x_l)
    end_r = 0.5 * pi + turn - atan(2.0 * right.coefficient * x_r)
    centre_l = _connector(wing_l, -x_l, left, end_l)
    centre_r = _connector(wing_r, x_r, right, end_r)
    for centre, side, prefix, end in (
        (centre_l, left, prefixes[0], end_l),
        (centre_r, right, prefixes[1], end_r),
    ):
        _check_connector(centre, side, prefix, end, minor)
    # the lateral arc at x < 0 joins the left side of the upper lobe to the right side
    # of the lower lobe, which is rotated by half a turn
    below = (-centre_r[0], -centre_r[1])
    centre, radius = _lateral(
        centre_l, left.connector_radius, below, right.connector_radius, minor
    )
    first = atan2(centre_l[1] - centre[1], centre_l[0] - centre[0])
    last = atan2(below[1] - centre[1], below[0] - centre[0]) % (2.0 * pi)
    for aperture, side, prefix in (
        (first - end_l, left, prefixes[0]),
        (end_r + pi - last, right, prefixes[1]),
    ):
        if aperture < 0.0:
            raise OutlineFault(
                f"{prefix}parabola_coefficient_per_mm",
                f" = {side.coefficient * mm:g} 1/mm: the connector arc would turn back"
                f" by {-aperture / deg:.4g} deg to meet the minor axis; accepted: a"
                " smaller value",
            )
    half: list[OutlinePiece] = [
        wing_l,
        Arc(centre=centre_l, radius=left.connector_radius, start=end_l, end=first),
        Arc(centre=centre, radius=radius, start=first, end=last),
        Arc(centre=below, radius=right.connector_radius, start=last, end=end_r + pi),
        _turned(wing_r),
    ]
    return Chain(pieces=(*half, *map(_turned, half)))


def _connector(wing: Parabola, x: float, side: Side, angle: float) -> Point:
    """Centre of the connector arc, r_p - r_c n_p [m], thesis eq. (3.8)."""
    c, d = cos(wing.turn), sin(wing.turn)
    y = -side.coefficient * x * x
    end = (wing.apex[0] + c * x - d * y, wing.apex[1] + d * x + c * y)  # (3.5)
    r = side.connector_radius
    return end[0] - r * cos(angle), end[1] - r * sin(angle)


def _check_connector(
    centre: Point, side: Side, prefix: str, angle: float, minor: float
) -> None:
    """Check that the connector arc is inside |x| = b and its centre above y = 0."""
    reach = abs(centre[0]) + side.connector_radius
    if reach >= minor:
        # from its fixed end point, the arc extends by r_c (1 - cos of the end normal)
        end = abs(centre[0]) + side.connector_radius * abs(cos(angle))
        limit = (minor - end) / (1.0 - abs(cos(angle)))
        accepted = (
            f"below {limit / mm:.4g} mm"
            if limit > 0.0
            else "a parabola_length_coefficient smaller than"
            f" {side.length_coefficient:g}"
        )
        raise OutlineFault(
            f"{prefix}connector_radius_mm",
            f" = {side.connector_radius / mm:g} mm: the connector arc reaches"
            f" {reach / mm:.4g} mm, beyond the semi-minor axis {minor / mm:.4g} mm;"
            f" accepted: {accepted}",
        )
    if centre[1] <= 0.0:
        raise OutlineFault(
            f"{prefix}parabola_coefficient_per_mm",
            f" = {side.coefficient * mm:g} 1/mm: the centre of the connector arc is"
            f" {-centre[1] / mm:.4g} mm below the minor axis; accepted: a smaller value"
            " or a smaller connector_radius_mm",
        )


def _lateral(
    upper: Point, r_upper: float, lower: Point, r_lower: float, minor: float
) -> tuple[Point, float]:
    """Centre [m] and radius [m] of the circle that forms the lateral arc.

    The circle touches the line x = -b and encloses both connector circles, which touch
    it from the inside. Let its centre be (R - b, y). For a connector with centre
    (-u, v) and radius r, tangency requires
    2 R (b - u - r) = (b - u)^2 - r^2 + (v - y)^2. R is eliminated from the two
    conditions, and the root y between the connectors is used. Equal connectors give
    y = 0 and thesis eq. (3.11).
    """
    gap, rest, height = [], [], []
    for (x, v), r in ((upper, r_upper), (lower, r_lower)):
        room = minor + x
        gap.append(room - r)
        rest.append(room * room - r * r + v * v)
        height.append(v)
    a = gap[1] - gap[0]
    b = -2.0 * (height[0] * gap[1] - height[1] * gap[0])
    c = rest[0] * gap[1] - rest[1] * gap[0]
    y = 2.0 * c / (-b + sqrt(max(b * b - 4.0 * a * c, 0.0)))
    centre_to_line = (rest[0] - 2.0 * height[0] * y + y * y) / (2.0 * gap[0])
    centre = (centre_to_line - minor, y)
    # computed from the tangency, which has less round-off at the junction
    radius = r_upper + hypot(upper[0] - centre[0], upper[1] - centre[1])
    return centre, radius


def _turned(piece: OutlinePiece) -> OutlinePiece:
    """The piece rotated by half a turn about the axis."""
    if isinstance(piece, Arc):
        x, y = piece.centre
        return Arc(
            centre=(-x, -y),
            radius=piece.radius,
            start=piece.start + pi,
            end=piece.end + pi,
        )
    assert isinstance(piece, Parabola)
    x, y = piece.apex
    return Parabola(
        apex=(-x, -y),
        coefficient=piece.coefficient,
        start=piece.start,
        end=piece.end,
        turn=piece.turn + pi,
    )

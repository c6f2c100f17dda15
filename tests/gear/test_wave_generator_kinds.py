"""Every kind of wave generator: closed, smooth, convex, and refused by name."""

from __future__ import annotations

import re
from itertools import pairwise
from math import asin, cos, pi, sin, tau

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import names, naming
from scipy.integrate import quad

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.chain import Chain
from swgjoint.gear.wave_generators.pieces import Arc
from swgjoint.gear.wave_generators.rollers import FourRoller
from swgjoint.gear.wave_generators.wave_generator import wave_generator

IMPROVED = {
    "parabola_coefficient_per_mm": 0.0097,
    "parabola_length_coefficient": 0.51,
    "connector_radius_mm": 10.0,
}
OTHER_SIDE = {
    "parabola_coefficient_per_mm": 0.0096,
    "parabola_length_coefficient": 0.48,
    "connector_radius_mm": 12.0,
}
ANGLES = [float(a) for a in range(-180, 180, 10)]
KINDS = {
    "elliptical": {"minor_axis_coefficient": 1.0},
    "simplified": {"minor_axis_coefficient": 0.8},
    "parabolic": IMPROVED,
    "turned": {"kind": "asymmetric_parabolic", "rotation_deg": 0.5, **IMPROVED},
    "bilateral": {
        "kind": "asymmetric_parabolic",
        "left": IMPROVED,
        "right": OTHER_SIDE,
    },
    "four_roller": {"aperture_deg": 10.0, "roller_radius_mm": 8.0},
    "cosine": {"minor_axis_coefficient": 1.0},
    "three_lobed": {"kind": "cosine", "minor_axis_coefficient": 1.0},
    "table": {
        "angle_deg": ANGLES,
        # unequal lobes: no symmetry at all
        "radius_mm": [
            58.2 + 0.95 * cos(2 * a * pi / 180) + 0.05 * cos(a * pi / 180)
            for a in ANGLES
        ],
    },
}
REFERENCE = Design.load("reference-2d")


def design_with(kind: str, **changes: object) -> Design:
    table = {"kind": kind, **KINDS[kind], **changes}
    teeth = {"drive.teeth_circular_spline": 123} if kind == "three_lobed" else {}
    return REFERENCE.with_changes({"wave_generator": table, **teeth})


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def outline(kind):
    return wave_generator(design_with(kind))


def check_invariants(outline) -> None:
    """Closed, tangent, counter-clockwise from +y, curvature 2 pi, normal = gradient."""
    perimeter = outline.perimeter
    band = outline.band if isinstance(outline, FourRoller) else outline
    s = perimeter * np.linspace(0.0, 1.0, 4001)
    points, normals, curvature = band.evaluate(s)
    for array in (points, normals, curvature):
        assert np.isfinite(array).all()
    size = outline.major
    # a lateral arc with a radius of kilometres rounds as its centre does
    radii = [arc.radius for arc in getattr(band, "pieces", ()) if isinstance(arc, Arc)]
    rounding = 8.0 * np.finfo(float).eps * max(radii, default=0.0)
    assert points[0] == pytest.approx(points[-1], abs=1e-13 * size)
    assert abs(points[0, 0]) < 1e-13 * size
    assert points[0, 1] > 0.0
    assert points[1, 0] < 0.0
    assert (curvature >= -1e-9 / perimeter).all()
    assert np.hypot(*points.T).max() <= outline.major * (1 + 1e-12)
    # the normal turns once
    cross = normals[:-1, 0] * normals[1:, 1] - normals[:-1, 1] * normals[1:, 0]
    turn = np.arctan2(cross, np.sum(normals[:-1] * normals[1:], axis=-1))
    assert np.sum(turn) == pytest.approx(tau, abs=1e-9)
    assert (turn >= -1e-12).all()
    # length and normal agree with the chords of a convex curve
    chords = np.diff(points, axis=0)
    length = np.hypot(*chords.T)
    step = perimeter / 4000
    loose = 1e-11 * size + rounding
    assert (length <= step + loose).all()
    assert (length >= step * np.cos(turn / 2) - loose).all()
    normal = np.stack([chords[:, 1], -chords[:, 0]], axis=-1) / length[:, None]
    ahead = normals[:-1, 0] * normal[:, 1] - normals[:-1, 1] * normal[:, 0]
    assert (ahead >= -1e-9).all()
    assert (np.arcsin(np.minimum(ahead, 1)) <= turn + 1e-9).all()
    # a point off the outline projects back on where it came from
    off = np.linspace(0.0, 0.05, 4000, endpoint=False) * size
    distance, found, bend_there = band.signed_distance(
        points[1:] + off[:, None] * normals[1:]
    )
    assert distance == pytest.approx(off, abs=1e-11 * size)
    assert found == pytest.approx(normals[1:], abs=1e-8)
    if isinstance(band, Chain):
        assert np.abs(band.corners()).max() < 1e-10
        assert band.gaps().max() < 1e-12 * size + rounding
    else:
        assert bend_there == pytest.approx(curvature[1:], rel=1e-6, abs=1e-9 / size)


def test_invariants(outline):
    """Every kind is closed, smooth, convex, and its distance is that to a foot."""
    check_invariants(outline)


def test_curvature_integrates_to_a_turn(outline):
    """The curvature along the outline sums up to 2 pi, by quadrature per piece."""
    band = outline.band if isinstance(outline, FourRoller) else outline
    if isinstance(band, Chain):
        cuts = band.stations
    else:
        cuts = np.linspace(0.0, band.perimeter, 37)
        if hasattr(band, "pin_radius"):  # the ends of the semicircles
            quarter = 0.25 * tau * band.pin_radius
            line = 0.5 * band.perimeter - 2 * quarter
            half = 0.5 * band.perimeter
            cuts = [0, quarter, quarter + line, half, half + quarter]
            cuts = np.array([*cuts, half + quarter + line, 2 * half])
    nodes, weights = np.polynomial.legendre.leggauss(24)
    half = 0.5 * np.diff(cuts)
    s = 0.5 * (cuts[1:] + cuts[:-1])[:, None] + half[:, None] * nodes
    total = np.sum(half * (band.evaluate(s.ravel())[2].reshape(s.shape) @ weights))
    # 1e-7: the table has a jump of the curvature's slope at its knots
    assert total == pytest.approx(tau, abs=1e-7 if "Table" in str(type(band)) else 1e-9)


def test_gradient_of_distance_is_the_normal(outline):
    """Signed distance by differences, points inside and outside the outline."""
    rng = np.random.default_rng(5)
    angle = rng.uniform(0, tau, 200)
    points = rng.uniform(0.054, 0.062, 200)[:, None] * np.stack(
        [np.sin(angle), np.cos(angle)], axis=-1
    )
    gap, normal, _ = outline.signed_distance(points)
    assert np.hypot(*normal.T) == pytest.approx(1.0, abs=1e-14)
    h = 1e-7
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = h
        up, down = (outline.signed_distance(points + k * step)[0] for k in (1, -1))
        assert (up - down) / (2 * h) == pytest.approx(normal[:, axis], abs=1e-6)
    outside = np.hypot(*points.T) > outline.major
    assert (gap[outside] > 0).all()


def test_distance_is_that_to_the_nearest_point(outline):
    """Signed distance against the nearest of many points of the closed curves."""
    rng = np.random.default_rng(2)
    points = rng.uniform(-0.065, 0.065, (40, 2))
    points = points[np.hypot(*points.T) > 0.03]
    gap, _, _ = outline.signed_distance(points)
    curves = np.concatenate(outline.outlines(100_001))
    nearest = np.array([np.hypot(*(curves - p).T).min() for p in points])
    assert np.abs(gap) == pytest.approx(nearest, abs=1e-8)


def test_turns_map_the_outline_onto_itself(outline):
    """Points turned by 2 pi over the folds stay on the outline."""
    points = np.concatenate(outline.outlines(301))
    turn = tau / outline.folds
    c, d = np.cos(turn), np.sin(turn)
    gap, _, _ = outline.signed_distance(points @ np.array([[c, d], [-d, c]]))
    assert np.abs(gap).max() < 1e-14


def test_folds():
    """Two for two lobes, three for three, one for a table with unequal lobes."""
    folds = {name: wave_generator(design_with(name)).folds for name in KINDS}
    assert folds == dict.fromkeys(KINDS, 2) | {"three_lobed": 3, "table": 1}


@pytest.mark.parametrize("name", ["elliptical", "parabolic", "cosine", "table"])
def test_perimeter_by_independent_quadrature(name):
    """Arc length integrated over the polar or eccentric angle by scipy's quad."""
    outline = wave_generator(design_with(name))
    if name == "elliptical":

        def speed(t):
            return np.hypot(59.2e-3 * sin(t), 57.2e-3 * cos(t))
    elif name == "cosine":

        def speed(t):
            return np.hypot(58.2e-3 + 1e-3 * cos(2 * t), 2e-3 * sin(2 * t))
    elif name == "table":

        def speed(t):
            phi = np.array([t])
            return float(np.hypot(outline.radius(phi), outline.radius(phi, 1))[0])
    else:
        # parabola y = a - a_p x^2, then the arcs with the angles of thesis 3.2.3
        a_p, x, r_c, b = 9.7, 0.51 * 57.2e-3, 0.01, 57.2e-3
        psi = np.arctan(2 * a_p * x)
        x_c, y_c = x - r_c * sin(psi), 59.2e-3 - a_p * x**2 - r_c * cos(psi)
        parabola, _ = quad(lambda t: np.hypot(1, 2 * a_p * t), 0, x, epsabs=1e-15)
        lateral = outline.pieces[2]
        alpha = asin(y_c / (lateral.radius - r_c))  # (3.11)
        assert lateral.centre[0] - lateral.radius == pytest.approx(-b, rel=1e-14)
        assert lateral.centre[1] == pytest.approx(0.0, abs=1e-17)
        assert x_c - (lateral.radius - r_c) * cos(alpha) == pytest.approx(
            b - lateral.radius, rel=1e-12
        )
        quarter = parabola + r_c * (pi / 2 - psi - alpha) + lateral.radius * alpha
        assert outline.perimeter == pytest.approx(4 * quarter, rel=1e-13)
        return
    cuts = np.linspace(0, tau, 73)
    total = sum(quad(speed, a, b, epsabs=1e-16)[0] for a, b in pairwise(cuts))
    assert outline.perimeter == pytest.approx(total, rel=1e-13)


@pytest.mark.parametrize("name", ["parabolic", "turned", "bilateral"])
def test_axes_of_parabolic_outlines(name):
    """The apex at a, the lateral arcs touching x = +-b."""
    outline = wave_generator(design_with(name))
    points, normals, _ = outline.evaluate(np.zeros(1))
    assert points[0] == pytest.approx([0.0, 59.2e-3], abs=1e-16)
    tilt = np.arctan2(-normals[0, 0], normals[0, 1])
    assert tilt == pytest.approx(0.5 * pi / 180 * (name == "turned"), abs=1e-15)
    for lateral in outline.pieces[2::5]:
        assert abs(lateral.centre[0]) - lateral.radius == pytest.approx(
            -57.2e-3, abs=1e-16
        )
        # and their extreme points belong to the arcs
        extreme = pi if lateral.start < pi else tau
        assert lateral.start < extreme < lateral.end


def test_turned_lobe_rises_by_its_angle():
    """Lambda > 0 raises the right side: the largest radius grows, on the right."""
    plain, turned = (wave_generator(design_with(n)) for n in ("parabolic", "turned"))
    assert plain.major == pytest.approx(59.2e-3, rel=1e-15)
    # r - a = lambda x - (a_p - 1/2a) x^2 has the maximum lambda^2/4(a_p - 1/2a)
    rise = (0.5 * pi / 180) ** 2 / (4 * (9.7 - 1 / (2 * 59.2e-3)))
    assert turned.major - 59.2e-3 == pytest.approx(rise, rel=0.01)
    points = turned.outline(100_001)
    top = points[points[:, 1] > 0]
    assert top[np.hypot(*top.T).argmax(), 0] > 1e-3


def test_bilateral_with_equal_sides_is_parabolic():
    """The same parameters on both sides give the symmetric outline."""
    both = wave_generator(design_with("bilateral", right=IMPROVED))
    plain = wave_generator(design_with("parabolic"))
    assert both.outline(501) == pytest.approx(plain.outline(501), abs=1e-17)


def test_rollers_lie_where_the_thesis_puts_them():
    """Axes at 10 deg from the major axis, outermost points on the circle of a."""
    outline = wave_generator(design_with("four_roller"))
    x, y = outline.centre
    assert np.arctan2(x, y) == pytest.approx(10 * pi / 180, rel=1e-14)
    assert np.hypot(x, y) + 8e-3 == pytest.approx(59.2e-3, rel=1e-14)
    tip = 59.2e-3 * np.array([[sin(10 * pi / 180), cos(10 * pi / 180)]])
    assert outline.signed_distance(tip)[0] == pytest.approx([0.0], abs=1e-17)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        # 10 mm at 10 deg interfere, thesis 5.5.2
        (
            "four_roller",
            {"roller_radius_mm": 10.0},
            ("wave_generator.roller_radius_mm", "10 mm", "8.759 mm", "aperture_deg"),
        ),
        (
            "four_roller",
            {"roller_radius_mm": 30.0},
            ("wave_generator.roller_radius_mm", "30 mm", "29.6 mm"),
        ),
        # thesis figure 5.18: flat parabolas protrude
        (
            "parabolic",
            {"parabola_coefficient_per_mm": 0.005},
            (
                "wave_generator.parabola_coefficient_per_mm",
                "0.005 1/mm",
                "62.456 mm",
                "59.4 mm",
                "59.2 mm",
                "0.2 mm",
            ),
        ),
        (
            "parabolic",
            {"connector_radius_mm": 56.0},
            ("wave_generator.connector_radius_mm", "56 mm", "57.2 mm", "55.23 mm"),
        ),
        (
            "parabolic",
            {"parabola_coefficient_per_mm": 0.05},
            ("wave_generator.parabola_coefficient_per_mm", "0.05 1/mm"),
        ),
        (
            "bilateral",
            {"right": {**OTHER_SIDE, "connector_radius_mm": 58.0}},
            (
                "wave_generator.right.connector_radius_mm",
                "58 mm",
                "57.2 mm",
                "55.73 mm",
            ),
        ),
        (
            "turned",
            {"rotation_deg": 5.0},
            (
                "wave_generator.rotation_deg",
                "5 deg",
                "parabola_coefficient_per_mm",
                "0.0097 1/mm",
                "0 deg",
            ),
        ),
        (
            "table",
            {"radius_mm": [58.0] * 36},
            ("wave_generator.radius_mm", "58 mm", "58.2 mm"),
        ),
        (
            "table",
            {"radius_mm": [58.2 + cos(0.3 * a * a) for a in range(36)]},
            ("wave_generator.radius_mm", "-0.05142 1/mm", "0 1/mm"),
        ),
    ],
)
def test_refusal_names_the_key(name, changes, message):
    """An outline that cannot be made is refused with key, value and what is taken."""
    with pytest.raises(DesignError) as info:
        wave_generator(design_with(name, **changes))
    lines = str(info.value).splitlines()
    assert all("accepted" in line for line in lines)
    assert any(names(line, *message) for line in lines), lines


def test_too_long_an_ellipse_is_refused():
    """Few teeth and a large deflection stretch the rim beyond what steel bears."""
    design = REFERENCE.with_changes(
        {"drive.teeth_flexspline": 60, "drive.teeth_circular_spline": 66}
    )
    with pytest.raises(
        DesignError,
        match=naming("wave_generator.minor_axis_coefficient", "1", "0.283 %", "0.2 %"),
    ):
        wave_generator(design)


# -- any parameters: accepted with all invariants true, or refused by name ---------

SIDES = st.fixed_dictionaries(
    {
        "parabola_coefficient_per_mm": st.floats(0.002, 0.05),
        "parabola_length_coefficient": st.floats(0.05, 1.0),
        "connector_radius_mm": st.floats(0.05, 60.0),
    }
)
MINOR = st.floats(0.05, 1.0)
TABLES = st.one_of(
    st.fixed_dictionaries(
        {
            "kind": st.sampled_from(["elliptical", "simplified", "cosine"]),
            "minor_axis_coefficient": MINOR,
        }
    ),
    st.builds(
        lambda side, minor: {
            "kind": "parabolic",
            "minor_axis_coefficient": minor,
            **side,
        },
        SIDES,
        MINOR,
    ),
    # about the improved one of Table 5.5, where most are accepted
    st.builds(
        lambda a_p, c_p, r_c, turn: {
            "kind": "asymmetric_parabolic",
            "rotation_deg": turn,
            "parabola_coefficient_per_mm": a_p,
            "parabola_length_coefficient": c_p,
            "connector_radius_mm": r_c,
        },
        st.floats(0.0088, 0.012),
        st.floats(0.3, 0.9),
        st.floats(1.0, 20.0),
        st.floats(-2.0, 2.0),
    ),
    st.builds(
        lambda left, right: {
            "kind": "asymmetric_parabolic",
            "left": left,
            "right": right,
        },
        SIDES,
        SIDES,
    ),
    st.fixed_dictionaries(
        {
            "kind": st.just("four_roller"),
            "aperture_deg": st.floats(0.5, 44.9),
            "roller_radius_mm": st.floats(0.1, 40.0),
        }
    ),
    st.builds(
        lambda swing, phase: {
            "kind": "table",
            "angle_deg": [float(a) for a in range(0, 360, 15)],
            "radius_mm": [
                57.9 + cos(2 * a * pi / 180) + swing * cos(a * pi / 60 + phase)
                for a in range(0, 360, 15)
            ],
        },
        st.floats(0.0, 0.5),
        st.floats(0.0, 6.0),
    ),
)


def scaled(table: dict, k: float) -> dict:
    """The same shape k times as large."""
    power = {
        "parabola_coefficient_per_mm": -1,
        "connector_radius_mm": 1,
        "roller_radius_mm": 1,
    }
    return {
        key: scaled(value, k)
        if isinstance(value, dict)
        else [k * r for r in value]
        if key == "radius_mm"
        else value * k ** power[key]
        if key in power
        else value
        for key, value in table.items()
    }


any_generator = given(
    table=TABLES,
    teeth=st.one_of(st.just(120), st.integers(40, 400)),
    module=st.one_of(st.just(1.0), st.floats(0.05, 5.0)),
)


@settings(max_examples=30, deadline=None)
@any_generator
def test_accepted_with_invariants_or_refused_by_name(table, teeth, module):
    """Over the parameter ranges nothing else happens, and no NaN."""
    assert_invariants_or_names(table, teeth, module)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@any_generator
def test_many_have_invariants_or_are_refused_by_name(table, teeth, module):
    """The same of more of them."""
    assert_invariants_or_names(table, teeth, module)


def assert_invariants_or_names(table, teeth, module):
    """A sound outline, or lines that name keys of the table."""
    bore = (0.5 * teeth - 0.8) * module - module
    table = scaled(table, bore / 58.2)
    design = REFERENCE.with_changes(
        {
            "wave_generator": table,
            "drive.teeth_flexspline": teeth,
            "drive.teeth_circular_spline": teeth + 2,
            "drive.module_mm": module,
            "flexspline.rim_mm": module,
        }
    )
    try:
        outline = wave_generator(design)
    except DesignError as error:
        for line in str(error).splitlines():
            key = re.search(r"wave_generator\.(?:left\.|right\.)?(\w+)", line)
            assert key is not None, line
            keys = {*table, *table.get("left", {})}
            assert key.group(1) in keys, line
            assert "accepted" in line
            assert "nan" not in line
    else:
        check_invariants(outline)

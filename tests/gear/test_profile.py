"""Tooth profiles: tangent arcs, wanted thickness, faults that name the key."""

from __future__ import annotations

import re
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile

MEMBERS = ("flexspline", "circular_spline")


def profile(member, **changes):
    design = Design.load("reference-2d")
    if changes:
        design = design.with_changes({f"{member}.{k}": v for k, v in changes.items()})
    return tooth_profile(design, member)


def check_profile(p):
    """Laws that hold for every profile."""
    s = p.stations
    step = 1e-12
    before, n_before, _ = p.evaluate(s[1:-1] - step)
    after, n_after, _ = p.evaluate(s[1:-1] + step)
    assert np.abs(after - before).max() < 3 * step
    assert np.abs(n_after - n_before).max() < 1e-7  # step times the curvature
    for segment, following in zip(p.segments, p.segments[1:], strict=False):
        assert segment.end == pytest.approx(following.start, abs=1e-15)
    points, normals, _ = p.evaluate(np.linspace(0.0, s[-1], 300))
    assert points[0] == pytest.approx([0.0, p.addendum_radius], abs=1e-15)
    assert np.hypot(*points[-1]) == pytest.approx(p.dedendum_radius, rel=1e-12)
    assert np.arctan2(*points[-1]) == pytest.approx(pi / p.teeth, rel=1e-12)
    gap, found, _ = p.signed_distance(points[5:-5] + 1e-6 * normals[5:-5])
    assert gap == pytest.approx(1e-6, rel=1e-6)
    assert np.abs(found - normals[5:-5]).max() < 1e-7


@pytest.mark.parametrize("member", MEMBERS)
def test_reference_profile(member):
    """The reference teeth are tangent chains of seven parts between their circles."""
    p = profile(member)
    check_profile(p)
    assert [q.name for q in p.segments] == [
        "top_land",
        "tip",
        "addendum",
        "straight",
        "dedendum",
        "root",
        "root_land",
    ]
    for name, radius in (("tip", 0.3e-3), ("addendum", 1e-3), ("root", 0.3e-3)):
        part = next(q for q in p.segments if q.name == name)
        assert part.radius == pytest.approx(radius)


@pytest.mark.parametrize("member", MEMBERS)
@pytest.mark.parametrize("coefficient", [0.8, 1.0])
def test_thickness_at_the_pitch_circle(member, coefficient):
    """The flank crosses the pitch circle at c_P pi/(2 N), inclined by 20 deg."""
    p = profile(member, thickness_coefficient=coefficient)
    low, high = p.range_of("straight", "straight")
    point, normal, _ = p.evaluate(np.array([0.5 * (low + high)]))
    angle = np.arctan2(point[0, 0], point[0, 1])
    assert np.hypot(*point[0]) == pytest.approx(p.pitch_radius, rel=1e-12)
    assert angle == pytest.approx(coefficient * pi / (2 * p.teeth), rel=1e-12)
    radial = point[0] / np.hypot(*point[0])
    sign = -1.0 if p.internal else 1.0
    # the flank's normal leans to the tip by the pressure angle
    assert sign * normal[0] @ radial == pytest.approx(np.sin(np.deg2rad(20.0)))


def test_members_mate_without_backlash():
    """Tooth and space have the same width on the rolling pitch circles."""
    widths = []
    for member in MEMBERS:
        p = profile(member)
        low, high = p.range_of("straight", "straight")
        point, _, _ = p.evaluate(np.array([0.5 * (low + high)]))
        widths.append(2 * np.arctan2(*point[0]) * p.pitch_radius)
    assert widths[0] == pytest.approx(widths[1], rel=1e-12)
    assert sum(widths) == pytest.approx(pi * 1e-3, rel=1e-12)


@settings(max_examples=150, deadline=None)
@given(
    member=st.sampled_from(MEMBERS),
    tip=st.floats(0.05, 0.9),
    addendum=st.floats(0.2, 3.0),
    dedendum=st.floats(0.3, 4.0),
    root=st.floats(0.05, 0.9),
    straight=st.floats(0.0, 1.0),
    split=st.floats(0.0, 1.0),
    thickness=st.floats(0.6, 1.0),
)
def test_any_profile_is_right_or_refused(
    member, tip, addendum, dedendum, root, straight, split, thickness
):
    """Parameters give a tangent chain, or one line that names a key of the file."""
    values = {
        "thickness_coefficient": thickness,
        "profile.tip_radius_mm": tip,
        "profile.addendum_radius_mm": addendum,
        "profile.dedendum_radius_mm": dedendum,
        "profile.root_radius_mm": root,
        "profile.straight_mm": straight,
        "profile.straight_split": split,
    }
    try:
        p = profile(member, **values)
    except DesignError as error:
        assert "\n" not in str(error)
        assert member in str(error) and "_mm" in str(error)
        return
    check_profile(p)


# Thesis Tables 6.9 and 6.10 and page text, r_a = 1 mm, c_P = 1, lengths in mm
DCA = [
    (0.6, 0.0, 0.4357, 0.4268),
    (0.5, 0.0, 0.5049, 0.4977),
    (0.6, 0.1, 0.4842, 0.4743),
    (0.6, 0.3, 0.6225, 0.6098),
    (0.6, 0.5, 0.8715, 0.8537),
]


def dca(dedendum, split, addendum=1.0):
    return {
        "kind": "dca",
        "addendum_radius_mm": addendum,
        "dedendum_radius_mm": dedendum,
        "straight_split": split,
    }


@pytest.mark.parametrize(("radius", "split", "flexspline", "ring"), DCA)
def test_straight_length_of_the_double_arc(
    make_profile, profile_laws, radius, split, flexspline, ring
):
    """Straight lengths are those that the thesis prints, to its last digit."""
    for member, length in (("flexspline", flexspline), ("circular_spline", ring)):
        p = make_profile(member, {"profile": dca(radius, split)})
        profile_laws(p)
        assert p.straight_length == pytest.approx(length * 1e-3, abs=5e-8)


def test_addendum_radius_leaves_the_straight_length(make_profile):
    """The straight length does not depend on the addendum arc (thesis 6.5.2)."""
    lengths = [
        make_profile("flexspline", {"profile": dca(0.6, 0.0, r)}).straight_length
        for r in (1.0, 1.5, 3.0)
    ]
    assert lengths == pytest.approx([lengths[0]] * 3, rel=1e-15)


def test_edge_of_the_double_arc_is_a_vertex(make_profile):
    """Outside the edge at the tip the distance is that to a point."""
    p = make_profile("flexspline", {"profile": dca(0.6, 0.0)})
    s = p.contact_range[0]
    (vertex,), (after,), _ = p.evaluate(np.array([s]))
    (_,), (before,), _ = p.evaluate(np.array([s - 1e-12]))
    between = (before + after) / np.hypot(*(before + after))
    gap, normal, curvature = p.signed_distance((vertex + 1e-5 * between)[None])
    assert gap[0] == pytest.approx(1e-5, rel=1e-9)
    assert normal[0] == pytest.approx(between, abs=1e-9)
    assert curvature[0] == pytest.approx(1e5, rel=1e-9)


def test_two_arcs_of_the_article_share_a_tangent(make_profile, profile_laws):
    """The article's centres leave a common tangent 0.1446 m long inclined 14.9 deg."""
    for member in MEMBERS:
        p = make_profile(member, {"profile": {"kind": "two_arc"}})
        profile_laws(p)
        # internal common tangent of the circles about (-0.71, -0.19) and (1.54, 0.26)
        distance, radii = np.hypot(2.25, 0.45), 1.09 + 1.2
        assert p.straight_length == pytest.approx(
            np.sqrt(distance**2 - radii**2) * 1e-3, rel=1e-9
        )
        low, high = p.range_of("straight", "straight")
        _, (normal,), _ = p.evaluate(np.array([0.5 * (low + high)]))
        inclined = np.arctan2(0.45, 2.25) + np.arccos(radii / distance)
        assert p.side * normal[1] == pytest.approx(np.sin(inclined), rel=1e-9)


def test_two_arc_says_how_deep_it_reaches(make_profile):
    """The article's root circle lies below its concave arc; the limit is printed."""
    values = {"profile": {"kind": "two_arc"}, "dedendum_coefficient": 1.1}
    with pytest.raises(
        DesignError, match=naming("dedendum_coefficient", "1.1", "<= 0.9203")
    ):
        make_profile("flexspline", values)
    values = {"profile": {"kind": "two_arc"}, "addendum_coefficient": 1.0}
    with pytest.raises(
        DesignError, match=naming("addendum_coefficient", "1.0", "<= 0.637")
    ):
        make_profile("flexspline", values)


@settings(max_examples=150, deadline=None)
@given(
    member=st.sampled_from(MEMBERS),
    kind=st.sampled_from(["dca", "two_arc"]),
    sizes=st.lists(st.floats(0.05, 4.0), min_size=6, max_size=6),
    split=st.floats(0.0, 1.0),
    angle=st.floats(0.1, 59.0),
    addendum=st.floats(0.05, 2.0),
    dedendum=st.floats(0.05, 2.0),
    thickness=st.floats(0.3, 1.5),
)
def test_any_arc_profile_is_right_or_refused(
    make_profile,
    profile_laws,
    member,
    kind,
    sizes,
    split,
    angle,
    addendum,
    dedendum,
    thickness,
):
    """Any parameters give a profile that obeys the laws, or a line with its key."""
    names = ("addendum_radius", "dedendum_radius", "addendum_offset")
    names += ("addendum_shift", "dedendum_offset", "dedendum_shift")
    section = {f"{n}_mm": v for n, v in zip(names, sizes, strict=True)}
    if kind == "dca":
        section = dca(sizes[1], split, sizes[0])
    values = {
        "profile": section | {"kind": kind},
        "pressure_angle_deg": angle,
        "addendum_coefficient": addendum,
        "dedendum_coefficient": dedendum,
        "thickness_coefficient": thickness,
    }
    try:
        p = make_profile(member, values)
    except DesignError as error:
        assert "\n" not in str(error)
        assert member in str(error)
        assert re.search(r"_(mm|deg|coefficient|split)\W+\d", str(error))
        return
    profile_laws(p)

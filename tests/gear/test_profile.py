"""Tooth profiles: tangent arcs, wanted thickness, faults that name the key."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swgjoint.errors import DesignError
from swgjoint.gear.design import Design
from swgjoint.gear.profile import tooth_profile

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


def test_unknown_kind_says_what_is_available():
    """A profile that cannot be built yet is refused in one line."""
    kind = {"kind": "conjugate"}
    with pytest.raises(DesignError, match=r"'conjugate'.*available"):
        profile("flexspline", profile=kind)

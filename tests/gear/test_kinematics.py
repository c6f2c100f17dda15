"""Layouts: signed ratios, the two gear angles."""

from __future__ import annotations

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from messages import naming

from swgjoint.gear.design.design import Design
from swgjoint.gear.kinematics import (
    LAYOUTS,
    angle_coefficients,
    member_angles,
    periodicity,
    ratio,
)

ANGLE = st.floats(-10.0, 10.0)


@pytest.mark.parametrize(
    ("layout", "expected"),
    [
        ("circular_spline_fixed", -60.0),
        ("flexspline_fixed", 61.0),
        ("wave_generator_fixed", 122 / 120),
    ],
)
def test_ratio_of_the_reference(layout, expected):
    """Thesis eq. (2.2) for 120/122 teeth, signed."""
    assert ratio(layout, 120, 122) == pytest.approx(expected, rel=1e-15)
    changed = Design.load("reference-2d").with_changes({"drive.layout": layout})
    assert changed.ratio == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("layout", LAYOUTS)
@given(theta=ANGLE, z=st.integers(40, 400), difference=st.integers(1, 12))
def test_teeth_roll_on_each_other(layout, theta, z, difference):
    """Seen from the wave generator both members pass the same number of teeth."""
    teeth = (z, z + difference)
    psi = theta / ratio(layout, *teeth)
    wave_generator, flexspline, circular_spline = member_angles(layout, theta, psi)
    passed = [
        (wave_generator - turned) * count
        for turned, count in ((flexspline, teeth[0]), (circular_spline, teeth[1]))
    ]
    assert passed[0] == pytest.approx(passed[1], abs=1e-10)


@pytest.mark.parametrize("layout", LAYOUTS)
@given(theta=ANGLE, psi=ANGLE)
def test_gear_angles_are_those_of_the_wave_generator(layout, theta, psi):
    """Alpha and beta: wave generator relative to circular spline and to flexspline."""
    wave_generator, flexspline, circular_spline = member_angles(layout, theta, psi)
    alpha, beta = (a * theta + b * psi for a, b in angle_coefficients(layout))
    assert alpha == pytest.approx(wave_generator - circular_spline, abs=1e-14)
    assert beta == pytest.approx(wave_generator - flexspline, abs=1e-14)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_one_member_stands_still(layout):
    """Exactly the member in the name of the layout does not turn."""
    members = ("wave_generator", "flexspline", "circular_spline")
    angles = member_angles(layout, 1.0, 2.0)
    still = [m for m, turned in zip(members, angles, strict=True) if turned == 0.0]
    assert still == [layout.removesuffix("_fixed")]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pattern_repeats_after_a_tooth_of_the_fixed_member(layout):
    """After one period of the input, every member stands on its own teeth again."""
    teeth = (120, 122)
    period = 2 * pi / periodicity(layout, *teeth)
    wave_generator, *members = member_angles(
        layout, period, period / ratio(layout, *teeth)
    )
    for turned, count in zip(members, teeth, strict=True):
        passed = (wave_generator - turned) * count / (2 * pi)
        assert passed == pytest.approx(round(passed), abs=1e-12)
        assert round(passed) != 0


def test_unknown_layout_says_what_is_accepted():
    """A layout of another name is refused with the three that exist."""
    with pytest.raises(
        ValueError,
        match=naming(
            "'ring_fixed'",
            "circular_spline_fixed",
            "flexspline_fixed",
            "wave_generator_fixed",
        ),
    ):
        ratio("ring_fixed", 120, 122)

"""Layouts: signed ratios, the two gear angles, the rotation that takes up backlash."""

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
from swgjoint.gear.teeth.backlash import circumferential_backlash, initial_rotation

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


# -- backlash ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("c_p", "backlash"),
    [(1.0, 0.0), (0.95, 0.07854), (0.9, 0.15708), (0.85, 0.23562), (0.8, 0.31416)],
)
def test_backlash_of_table_6_1(c_p, backlash):
    """Circumferential backlash over c_P of the ring gear, thesis Table 6.1."""
    design = Design.load("reference-2d").with_changes(
        {"circular_spline.thickness_coefficient": c_p}
    )
    assert circumferential_backlash(design) == pytest.approx(backlash * 1e-3, abs=5e-9)


@pytest.mark.parametrize("member", ["flexspline", "circular_spline"])
def test_initial_rotation(member):
    """Eq. (6.4): pi (1 - c_P)/(2 N_fs) with the lower c_P, wherever it is."""
    design = Design.load("reference-2d")
    assert initial_rotation(design) == 0.0
    changed = design.with_changes({f"{member}.thickness_coefficient": 0.9})
    assert initial_rotation(changed) == pytest.approx(pi * 0.1 / 240, rel=1e-12)


def test_initial_rotation_takes_up_the_backlash_at_the_pitch_circle():
    """On the pitch circle of the flexspline gamma is half the backlash B."""
    design = Design.load("reference-3d")  # c_P = 0.95 in the circular spline
    moved = initial_rotation(design) * 60e-3
    assert moved == pytest.approx(circumferential_backlash(design) / 2, rel=1e-12)


def test_initial_rotation_of_involutes():
    """Difference of the angular tooth thicknesses, pi/120 - pi/122."""
    design = Design.load("reference-2d-involute")
    assert initial_rotation(design) == pytest.approx(pi / 120 - pi / 122, rel=1e-12)

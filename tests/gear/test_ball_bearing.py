"""Hertz contact of the balls, and the load of a rigid race."""

from __future__ import annotations

from math import cos, pi, sqrt

import pytest

from swgjoint.errors import DesignError
from swgjoint.gear.ball_bearing import (
    BallBearing,
    effective_modulus,
    hamrock_brewe,
    point_contact,
    rigid_race_loads,
    stribeck_largest_load,
)
from swgjoint.gear.design import Design

MODULUS = 115e9


@pytest.mark.parametrize("radius", [1e-3, 7e-3])
def test_sphere_on_plane(radius):
    """Equal curvatures give Hertz's sphere, Q = 4/3 E* sqrt(R) delta^1.5."""
    expected = 4.0 / 3.0 * MODULUS * sqrt(radius)
    assert point_contact(1 / radius, 1 / radius, MODULUS) == pytest.approx(
        expected, rel=1e-9
    )


@pytest.mark.parametrize("ratio", [1.0, 1.5, 3.0, 10.0, 40.0, 90.0])
def test_ellipse_agrees_with_hamrock_and_brewe(ratio):
    """The approach under a load agrees with the fits, which err by some per cent."""
    exact = point_contact(800.0, 800.0 / ratio, MODULUS)
    fitted = hamrock_brewe(800.0, 800.0 / ratio, MODULUS)
    assert (fitted / exact) ** (-2 / 3) == pytest.approx(1.0, abs=0.04)


def test_planes_may_be_named_either_way():
    """Which of the two planes comes first does not matter."""
    assert point_contact(90.0, 700.0, MODULUS) == point_contact(700.0, 90.0, MODULUS)


def test_family_ball_is_near_palmgren():
    """The law of the handbooks for steel lies within a tenth in approach."""
    bearing = BallBearing.of(Design.load("size-25-100"))
    ratio = bearing.hertz_constant() / bearing.palmgren_constant()
    assert ratio ** (2 / 3) == pytest.approx(1.0, abs=0.1)


def test_cam_bulges_and_race_bends_around_the_ball():
    """Both contacts in series, with the curvature of the raceways on either side."""
    bearing = BallBearing.of(Design.load("size-25-100"))
    inner, outer = bearing.raceways
    ball = 2.0 / bearing.ball_diameter
    across = ball * (1.0 - 1.0 / (2.0 * 0.52))
    modulus = effective_modulus(bearing)
    approach = sum(
        point_contact(along, across, modulus) ** (-2 / 3)
        for along in (ball + 1.0 / inner, ball - 1.0 / outer)
    )
    assert bearing.hertz_constant() == pytest.approx(approach**-1.5, rel=1e-9)


def test_bearing_is_measured_inwards_from_the_bore():
    """Bore, fit, race, clearance and ball leave the cam, half of each on a radius."""
    design = Design.load("size-25-100").with_changes(
        {
            "wave_generator.bearing.fit_clearance_um": 6.0,
            "wave_generator.bearing.clearance_um": 20.0,
        }
    )
    bearing = BallBearing.of(design)
    inner, outer = bearing.raceways
    bore = design.flexspline_inner_radius
    assert outer == pytest.approx(bore - 3e-6 - bearing.race_thickness, abs=1e-15)
    assert outer - inner == pytest.approx(bearing.ball_diameter + 10e-6, abs=1e-15)


@pytest.mark.parametrize("balls", [13, 23, 40])
def test_stribeck_without_clearance(balls):
    """The balls of rigid races share a radial force as Stribeck says."""
    for start in (0.0, pi / balls):
        angles = [start + 2 * pi * k / balls for k in range(balls)]
        loads = rigid_race_loads(1e10, 0.0, 1e-5, angles)
        force = sum(q * cos(a) for q, a in zip(loads, angles, strict=True))
        # the ball under the load, where one stands there
        largest = 1e10 * 1e-5**1.5
        assert largest == pytest.approx(stribeck_largest_load(force, balls), rel=0.01)


def test_stribeck_with_clearance():
    """With clearance the arc is shorter and 5 F/Z the customary figure."""
    angles = [2 * pi * k / 23 for k in range(23)]
    loads = rigid_race_loads(1e10, 2.5e-6, 1e-5, angles)
    force = sum(q * cos(a) for q, a in zip(loads, angles, strict=True))
    assert max(loads) == pytest.approx(
        stribeck_largest_load(force, 23, clearance=True), rel=0.05
    )


def test_modulus_of_like_bodies():
    """E* is half of E/(1 - nu^2) for two bodies of one steel."""
    bearing = BallBearing.of(Design.load("size-25-100"))
    assert effective_modulus(bearing) == pytest.approx(210e9 / 2 / (1 - 0.29**2))


def test_constant_scales_with_the_root_of_length():
    """K of twice the bearing is the root of two times larger, Q/D^2 the same."""
    small = BallBearing.of(Design.load("size-20-100"))
    large = BallBearing.of(Design.load("size-40-100"))
    # only the clearance class does not scale
    assert large.hertz_constant() == pytest.approx(
        sqrt(2.0) * small.hertz_constant(), rel=1e-4
    )


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("groove_conformity", 0.5),
        ("groove_inertia_factor", 0.0),
        ("fit_clearance_um", -1.0),
        ("race_width_mm", 0.0),
    ],
)
def test_impossible_bearings_are_refused(key, value):
    """A groove tighter than the ball, no race, interference: one line with the key."""
    with pytest.raises(DesignError, match=f"wave_generator.*bearing.{key}"):
        Design.load("size-25-100").with_changes(
            {f"wave_generator.bearing.{key}": value}
        )

"""Hertz contact of the balls, and the load of a rigid race."""

from __future__ import annotations

from math import log, pi, sqrt

import pytest
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.gear.bearing.ball_bearing import (
    BallBearing,
    effective_modulus,
    point_contact,
)
from swgjoint.gear.design.design import Design

MODULUS = 115e9


@pytest.mark.parametrize("radius", [1e-3, 7e-3])
def test_sphere_on_plane(radius):
    """Equal curvatures give Hertz's sphere, Q = 4/3 E* sqrt(R) delta^1.5."""
    expected = 4.0 / 3.0 * MODULUS * sqrt(radius)
    assert point_contact(1 / radius, 1 / radius, MODULUS) == pytest.approx(
        expected, rel=1e-9
    )


def hamrock_brewe(curvature: float, across: float, modulus: float) -> float:
    r"""The same by simple fits of the elliptic integrals [N/m^1.5].

    .. math:: k = \alpha^{2/\pi}, \quad \mathcal E = 1 + \frac{q}{\alpha}, \quad
        \mathcal F = \frac\pi2 + q\ln\alpha, \quad
        K = \pi k E' \sqrt{\frac{R\mathcal E}{4.5\mathcal F^3}}

    with :math:`\alpha = R_y/R_x`, :math:`q = \pi/2 - 1`,
    :math:`1/R = 1/R_x + 1/R_y` and :math:`E' = 2E^*`.

    Source:
        Hamrock and Brewe (1983), "Simplified solution for stresses and deformations",
        ASME J. Lubrication Technology 105, 171-177 (textbook, not checked).
    """
    larger, smaller = max(curvature, across), min(curvature, across)
    ratio, q = larger / smaller, 0.5 * pi - 1.0
    first, second = 0.5 * pi + q * log(ratio), 1.0 + q / ratio
    form = second / ((larger + smaller) * 4.5 * first**3)
    return float(2.0 * pi * ratio ** (2.0 / pi) * modulus * sqrt(form))


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
    bearing = BallBearing.from_design(Design.load("size-25-100"))
    # both races of a steel ball D: 4.36e-4 Q^(2/3) / D^(1/3) mm, textbook figure
    palmgren = 4.36e-4 * 1e-3 / (bearing.ball_diameter * 1e3) ** (1 / 3)
    assert bearing.hertz_constant() ** (-2 / 3) == pytest.approx(palmgren, rel=0.1)


def test_cam_bulges_and_race_bends_around_the_ball():
    """Both contacts in series, with the curvature of the raceways on either side."""
    bearing = BallBearing.from_design(Design.load("size-25-100"))
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
    bearing = BallBearing.from_design(design)
    inner, outer = bearing.raceways
    bore = design.flexspline_inner_radius
    assert outer == pytest.approx(bore - 3e-6 - bearing.race_thickness, abs=1e-15)
    assert outer - inner == pytest.approx(bearing.ball_diameter + 10e-6, abs=1e-15)


def test_modulus_of_like_bodies():
    """E* is half of E/(1 - nu^2) for two bodies of one steel."""
    bearing = BallBearing.from_design(Design.load("size-25-100"))
    assert effective_modulus(bearing) == pytest.approx(210e9 / 2 / (1 - 0.29**2))


def test_constant_scales_with_the_root_of_length():
    """K of twice the bearing is the root of two times larger, Q/D^2 the same."""
    small = BallBearing.from_design(Design.load("size-20-100"))
    large = BallBearing.from_design(Design.load("size-40-100"))
    # only the clearance class does not scale
    assert large.hertz_constant() == pytest.approx(
        sqrt(2.0) * small.hertz_constant(), rel=1e-4
    )


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("groove_conformity", 0.5, ("0.5", "> 0.5", "<= 1")),
        ("groove_inertia_factor", 0.0, ("0", "> 0", "<= 1")),
        ("fit_clearance_um", -1.0, ("-1 µm", ">= 0 µm", "<= 2000 µm")),
        ("race_width_mm", 0.0, ("0 mm", "> 0 mm", "<= 10000 mm")),
    ],
)
def test_impossible_bearings_are_refused(key, value, message):
    """A groove tighter than the ball, no race, interference: one line with the key."""
    pattern = naming(f"wave_generator.bearing.{key}", *message)
    with pytest.raises(DesignError, match=pattern):
        Design.load("size-25-100").with_changes(
            {f"wave_generator.bearing.{key}": value}
        )

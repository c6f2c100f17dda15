"""The friction model of a bearing maker: hand calculation and limits."""

from __future__ import annotations

from dataclasses import replace
from math import acos, exp, pi, sin, sqrt

import pytest

from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.bearing.rolling_friction import GreasedBearing
from swgjoint.gear.design.design import Design
from swgjoint.units import rpm

BEARING = GreasedBearing(pitch_diameter=0.050, section=0.010, viscosity=100e-6)
"""40 mm bore, 60 mm outside."""


def test_hand_calculation():
    """1 kN at 1000 rpm, every factor on its own, in the units of the catalogue."""
    rolling, sliding = BEARING.parts(1000.0, 1000.0 * rpm)
    heating = 1.0 / (1.0 + 1.84e-9 * (1000.0 * 50.0) ** 1.28 * 100.0**0.64)
    fed = exp(-6e-8 * 100.0 * 1000.0 * (40.0 + 60.0) * sqrt(3.1 / (2.0 * 20.0)))
    wanted = heating * fed * 4.7e-7 * 50.0**1.96 * 1000.0**0.54 * 1e5**0.6
    assert 1e3 * rolling == pytest.approx(wanted, rel=1e-12)
    assert wanted == pytest.approx(34.2, abs=0.1)
    full_film = 6.5e-3 * 50.0**-0.26 * 1000.0 ** (5.0 / 3.0) * 0.05
    assert 1e3 * sliding == pytest.approx(full_film, rel=1e-3)


def test_at_rest_only_sliding_is_left():
    """The starting moment: boundary friction, without oil to roll through."""
    rolling, sliding = BEARING.parts(1000.0, 0.0)
    assert rolling == 0.0
    wanted = 0.15 * 6.5e-3 * 50.0**-0.26 * 1000.0 ** (5.0 / 3.0)
    assert 1e3 * sliding == pytest.approx(wanted, rel=1e-12)
    assert BEARING.friction_torque(0.0, 200.0) == 0.0


def test_powers_of_load_and_speed():
    """0.54 and 5/3 in load, 0.6 in slow speed; the direction does not matter."""
    one, double = (BEARING.parts(f, 100.0) for f in (500.0, 1000.0))
    assert double[0] / one[0] == pytest.approx(2.0**0.54)
    assert double[1] / one[1] == pytest.approx(2.0 ** (5.0 / 3.0))
    slow, faster = (BEARING.parts(500.0, n * rpm)[0] for n in (0.1, 0.2))
    assert faster / slow == pytest.approx(2.0**0.6, rel=1e-3)
    assert BEARING.parts(500.0, -100.0) == one


def test_thick_oil_starves_the_contacts():
    """Rolling grows with the viscosity, then falls as balls follow too fast."""
    torques = [
        replace(BEARING, viscosity=nu * 1e-6).parts(100.0, 2000.0 * rpm)[0]
        for nu in (10.0, 100.0, 1000.0)
    ]
    assert torques[0] < torques[1] > torques[2]


def test_dimensions_of_the_bearing_of_a_design():
    """The circle of ball centres, and the outside that is the bore of the rim."""
    design = Design.load("size-25-100")
    bearing = BallBearing.from_design(design)
    made = GreasedBearing.from_bearing(bearing, 1e-4)
    inner, outer = bearing.raceways
    assert made.pitch_diameter == pytest.approx(inner + outer)
    outside = 0.5 * (made.pitch_diameter + made.section)
    assert outside == pytest.approx(bearing.bore_radius, rel=1e-3)
    assert made.friction_torque(84.0, 200.0 * pi / 3.0) > 0.0


def test_drag_of_a_flooded_bearing_by_hand():
    """1000 rpm, level at the pitch diameter, in the units of the catalogue."""
    t = 2.0 * acos((0.6 * 50.0 - 50.0) / (0.6 * 50.0))
    assert t == pytest.approx(4.6010, abs=1e-4)
    f_a = 0.05 * 3.1 * (60.0 + 40.0) / (60.0 - 40.0)
    r_s = 0.36 * 50.0**2 * (t - sin(t)) * f_a
    wanted = 1.093e-7 * 1000.0**2 * 50.0**3 * (1000.0 * 2500.0 / 100.0) ** -1.379 * r_s
    assert 1e3 * BEARING.drag_torque(1000.0 * rpm) == pytest.approx(wanted, rel=1e-12)
    assert wanted == pytest.approx(45.9, abs=0.5)


def test_powers_of_drag():
    """n^0.621 in speed and nu^1.379 in viscosity; none at rest, either direction."""
    slow, fast = (BEARING.drag_torque(w) for w in (100.0, 200.0))
    assert fast / slow == pytest.approx(2.0 ** (2.0 - 1.379))
    thick = replace(BEARING, viscosity=2.0 * BEARING.viscosity)
    assert thick.drag_torque(100.0) / slow == pytest.approx(2.0**1.379)
    assert BEARING.drag_torque(0.0) == 0.0
    assert BEARING.drag_torque(-100.0) == slow


def test_film_separates_the_surfaces_at_its_speed():
    """phi_bl is 1/e there, and far above it only the film is left."""
    rest = BEARING.parts(500.0, 0.0)[1]
    film = BEARING.film_torque(500.0)
    mixed = BEARING.parts(500.0, BEARING.film_speed)[1]
    assert (mixed - film) / (rest - film) == pytest.approx(exp(-1.0), rel=1e-9)
    assert BEARING.parts(500.0, 100.0 * BEARING.film_speed)[1] == pytest.approx(film)

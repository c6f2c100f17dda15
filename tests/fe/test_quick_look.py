"""A quick look at a drive: a few equilibria that agree with each other and the map."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.drives.spec_sheet import spec_sheet
from swgjoint.fe.quick_look import COARSE, take_quick_look
from swgjoint.gear.design.design import Design
from swgjoint.maps.sheet.sampled_accuracy import fit_orders
from swgjoint.units import arcmin


@pytest.fixture(scope="module")
def design():
    return Design.load("reference-2d").with_changes({"mesh.refinement": COARSE})


@pytest.fixture(scope="module")
def look(design):
    return take_quick_look(design)


def test_torsion_is_the_difference_of_the_errors(look):
    """Torsion is kinematic minus transmission error, at the position of the curve."""
    lag = look.errors["no_load"][0] - look.errors["rated"][0]
    torsion = np.interp(look.rated, look.torque, look.torsion)
    assert lag == pytest.approx(torsion, rel=1e-4)  # tolerance of the solver


def test_stiffness_is_that_of_the_map(design, look):
    """K1 to K3 agree with the data sheet of a map with the same mesh."""
    keys = ("K1_Nm_rad", "K2_Nm_rad", "K3_Nm_rad")
    sheet = spec_sheet(design, model="2d", only=keys)
    for key in keys:  # the curve is interpolated between a few torques
        assert look.figures[key] == pytest.approx(sheet[key], rel=0.01)


def test_orders_are_multiples_of_the_tooth_passage(design, look):
    """A perfect drive repeats with every pitch; its orders add up to the error."""
    for key, error in look.errors.items():
        orders = look.orders[key]
        assert all(order % design.periodicity == 0 for order in orders)
        half = 0.5 * np.ptp(error)
        assert max(orders.values()) <= 1.3 * half  # 4/pi for a rectangular wave
        assert sum(orders.values()) >= half * (1 - 1e-9)


def test_known_orders_are_found(design):
    """Amplitudes of a made-up error come back at their orders, all others are zero."""
    theta = np.sort(np.random.default_rng(3).uniform(0, 120 * np.pi, 300))
    beta = theta / design.ratio  # the flexspline turns with the output
    error = 3.0 + 2.0 * np.cos(2 * theta + 0.3) + 0.5 * np.sin(4 * (theta - beta))
    found = fit_orders(theta, error, design)
    strong = {round(order, 9): a for order, a in found.items() if a > 1e-9}
    assert strong == pytest.approx({2.0: 2.0, round(4 * (1 + 1 / 60), 9): 0.5})


def test_errors_of_the_teeth_dominate(design):
    """An eccentric circular spline moves the output, by about its size at most."""
    flawed = design.with_changes({"tolerances.circular_spline_eccentricity_um": 5.0})
    look = take_quick_look(flawed)
    assert look.superposed
    assert look.figures["kinematic_error_arcmin"] > 0.05
    assert look.torsion == pytest.approx(take_quick_look(design).torsion)
    shift = 5e-6 / (0.5 * design.pitch_diameter) / arcmin
    assert look.figures["kinematic_error_arcmin"] < 4.0 * shift

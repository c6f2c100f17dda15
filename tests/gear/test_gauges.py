"""Bridges on the flexspline: gain, cancelled orders, misplaced gauges."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.gauges import (
    FlexsplineWall,
    GaugeRing,
    WallStrain,
    torque_in_wall,
)
from swgjoint.gear.kinematics import ratio

PLACE = 0.02
BETA = np.linspace(0.0, 2.0 * pi, 200, endpoint=False)


@pytest.fixture(scope="module")
def wall():
    """Of a cup on an elliptical wave generator."""
    return FlexsplineWall.from_design(Design.load("reference-3d"))


@pytest.fixture(scope="module")
def any_strain():
    """Random amplitudes of all orders from 1 to 12, in all components."""
    rng = np.random.default_rng(3)
    hoop, axial, shear = rng.normal(size=(3, 12)) + 1j * rng.normal(size=(3, 12))
    return WallStrain(
        torsion=0.7, orders=np.arange(1.0, 13.0), hoop=hoop, axial=axial, shear=shear
    )


def gauge(strain, torque, beta, angle, phi):
    """Strain along a gauge, from the tensor in axial and circumferential direction."""
    wave = np.exp(1j * strain.orders * (phi - beta))
    along = (strain.axial @ wave).real
    around = (strain.hoop @ wave).real
    half = 0.5 * (strain.torsion * torque + (strain.shear @ wave).real)
    direction = np.array([np.cos(angle), np.sin(angle)])
    return direction @ np.array([[along, half], [half, around]]) @ direction


def test_signal_is_that_of_four_gauges_each(any_strain):
    """Two gauges at +a, two at -a, rosettes shifted and turned: sum over all gauges."""
    ring = GaugeRing(
        place=PLACE,
        bridges=3,
        angle=0.6,
        gauge_factor=2.1,
        shifts=(0.1, -0.2, 0.05),
        turns=(0.03, 0.0, -0.1),
    )
    torque = 0.3
    for beta in (0.0, 0.4, 2.0):
        bridges = [
            2.1
            / 4.0
            * sum(
                sign * gauge(any_strain, torque, beta, sign * 0.6 + turn, phi)
                for sign in (1.0, 1.0, -1.0, -1.0)
            )
            for phi, turn in zip(
                (0.1, 2 * pi / 3 - 0.2, 4 * pi / 3 + 0.05), ring.turns, strict=True
            )
        ]
        signal = ring.signal(any_strain, [torque], [beta])
        assert signal == pytest.approx([np.mean(bridges)], rel=1e-12)


def test_gain_is_the_shear_of_a_thin_tube(wall):
    """k/2 T/(2 pi r^2 t G), to the curvature of the wall; no ripple without a lobe."""
    strain = wall.strain(PLACE)
    thin = 1.0 / (2.0 * pi * wall.radius**2 * wall.wall * wall.shear_modulus)
    assert wall.radius == pytest.approx(58.6e-3)
    for bridges in (1, 2, 3, 5):
        ring = GaugeRing(place=PLACE, bridges=bridges)
        assert ring.gain(strain) == pytest.approx(thin, rel=wall.wall / wall.radius)
        signal = ring.signal(strain, 10.0 + 0.0 * BETA, BETA)
        assert signal.mean() == pytest.approx(10.0 * ring.gain(strain), rel=1e-9)


@pytest.mark.parametrize("bridges", [1, 2, 3, 4, 5, 7])
def test_equal_distances_cancel_what_is_no_multiple(any_strain, bridges):
    """And leave the others as large as one bridge reads them."""
    one = GaugeRing(place=PLACE).ripple(any_strain)
    ripple = GaugeRing(place=PLACE, bridges=bridges).ripple(any_strain)
    left = any_strain.orders % bridges == 0
    assert ripple[left] == pytest.approx(one[left], rel=1e-12)
    assert np.abs(ripple[~left]).max(initial=0.0) < 1e-13
    assert np.abs(one).min() > 0.1


def test_two_bridges_at_right_angles_cancel_two_lobes(any_strain):
    """A quarter turn apart, orders 2, 6, 10 cancel and orders 4, 8, 12 stay."""
    ripple = GaugeRing(place=PLACE, bridges=2, spacing=0.5 * pi).ripple(any_strain)
    found = np.abs(ripple[1::2])
    assert found[::2].max() < 1e-14
    assert found[1::2].min() > 0.1


def test_a_misplaced_bridge_leaves_the_first_order_residual(any_strain):
    """One of n at delta from its place: m delta/n of order m; rest falls as delta^2."""
    one = GaugeRing(place=PLACE).ripple(any_strain)
    errors = []
    for delta in (0.01, 0.005):
        ring = GaugeRing(place=PLACE, bridges=5, shifts=(delta, 0.0, 0.0, 0.0, 0.0))
        theory = 1j * any_strain.orders * delta / 5.0 * one
        cancelled = any_strain.orders % 5 != 0
        errors.append(np.abs(ring.ripple(any_strain) - theory)[cancelled].max())
        assert errors[-1] < 0.1 * np.abs(theory[cancelled]).max()
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


def test_a_turned_rosette_reads_hoop_strain(any_strain):
    """One of n turned by delta: k delta/n of hoop minus axial strain."""
    delta = 1e-4
    ring = GaugeRing(place=PLACE, bridges=3, turns=(delta, 0.0, 0.0))
    theory = 2.0 * delta / 3.0 * (any_strain.hoop - any_strain.axial)
    cancelled = any_strain.orders % 3 != 0
    ripple = ring.ripple(any_strain)
    assert ripple[cancelled] == pytest.approx(theory[cancelled], rel=2e-3)
    gain = GaugeRing(place=PLACE).gain(any_strain)
    assert 1.0 - ring.gain(any_strain) / gain == pytest.approx(
        2.0 * delta**2 / 3.0, rel=1e-6
    )


def test_ovalisation_without_torque_reads_zero_on_average(wall):
    """Over a turn of the wave generator, while a bridge sees every lobe pass."""
    signal = GaugeRing(place=PLACE, turns=(0.05,)).signal(
        wall.strain(PLACE), 0.0 * BETA, BETA
    )
    assert np.ptp(signal) > 1e-4
    assert abs(signal.mean()) < 1e-12 * np.ptp(signal)
    spectrum = np.abs(np.fft.rfft(signal))
    assert int(spectrum.argmax()) == 2


def test_deflection_is_that_of_the_ellipse(wall):
    """w0 cos 2 theta, and the 3 w0^2/(4 r) cos 4 theta of an ellipse."""
    middle = 58.2e-3 + 0.5e-3
    assert wall.orders[:2] == pytest.approx([2.0, 4.0])
    assert wall.deflection[0] == pytest.approx(1e-3, rel=1e-3)
    assert wall.deflection[1] == pytest.approx(0.75e-6 / middle, rel=0.01)


@pytest.mark.parametrize(
    "layout", ["circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed"]
)
def test_torque_in_the_wall_balances_the_members(layout):
    """Moments on flexspline and circular spline are as their teeth, with other sign."""
    share = torque_in_wall(layout, ratio(layout, 120, 122))
    output_is_flexspline = layout == "circular_spline_fixed"
    assert share == pytest.approx(1.0 if output_is_flexspline else -120.0 / 122.0)


def test_a_ring_without_a_cup_is_refused():
    """It has no wall behind its teeth."""
    with pytest.raises(DesignError, match=r"reference-2d has no \[cup\]"):
        FlexsplineWall.from_design(Design.load("reference-2d"))

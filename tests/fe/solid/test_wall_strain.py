"""Strain of cups and rings by finite elements, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from harmonic_response import HarmonicResponse, finite_element_strain

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.deflected_wall import deflected_strain, wall_orders
from swgjoint.fe.solid.strip.mesh import flexspline_strip
from swgjoint.fe.solid.strip.smooth_strip import smooth_strip
from swgjoint.fe.solid.strip.strip import flexspline
from swgjoint.gear.design.design import Design
from swgjoint.gear.gauges import FlexsplineWall, GaugeRing
from swgjoint.gear.teeth.tooth_profile import tooth_profile

pytestmark = pytest.mark.fe
DESIGN = Design.load("reference-3d").with_changes({"mesh.refinement": 0.5})
MIDDLE = 0.0245
"""Between the boundary layers at the diaphragm and at the teeth [m]."""


def condensed(design, mesh):
    """One sector, with teeth or without."""
    return flexspline(design, tooth_profile(design, "flexspline"), mesh)


@pytest.fixture(scope="module")
def wall():
    """Closed form."""
    return FlexsplineWall.from_design(DESIGN)


@pytest.fixture(scope="module")
def toothed():
    """The strip of a cup with teeth."""
    mesh = flexspline_strip(DESIGN, tooth_profile(DESIGN, "flexspline"))
    return condensed(DESIGN, mesh)


def solved(strip, wall, place, count=1):
    """The first orders of the strain."""
    return finite_element_strain(
        strip,
        DESIGN.material_of("flexspline"),
        place,
        orders=wall.orders[:count],
        deflection=wall.deflection[:count],
    )


def test_pure_torsion_is_that_of_a_round_tube(wall):
    """The cup without teeth, all along its wall: within 0.3 % of r_o/(G J)."""
    strip = condensed(DESIGN, smooth_strip(DESIGN))
    for place in np.linspace(0.006, 0.038, 5):
        found = solved(strip, wall, place)
        assert found.torsion == pytest.approx(wall.torsion_strain(), rel=3e-3)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_ovalised_ring_bends_as_an_inextensional_one(order):
    """A narrow ring without teeth: hoop strain (n^2 - 1) t w/(2 r^2) within 2 %."""
    ring = DESIGN.with_changes({"cup": None, "drive.face_width_mm": 2.0})
    strip = condensed(ring, smooth_strip(ring))
    response = HarmonicResponse(strip, ring.material_of("flexspline"))
    hoop, axial, shear = response.deflect(order, 0.001)
    rim, poisson = 1e-3, 0.29
    radius = ring.flexspline_inner_radius + 0.5 * rim
    theory = (order**2 - 1) * 0.5 * rim / radius**2
    assert hoop == pytest.approx(theory, rel=0.02)
    assert axial == pytest.approx(-poisson * theory, rel=0.03)
    assert abs(shear) < 1e-3 * theory


def test_wall_of_a_toothed_cup_reads_the_closed_form(toothed, wall):
    """Mid-wall: torsion 0.2 %, shear of two lobes 2 % and of four 5 %, hoop 6 %.

    The closed form has no teeth, which stiffen the rim, and no bending of the
    diaphragm. Nearer to both, the shear of two lobes differs by up to 5 %.
    """
    found, theory = solved(toothed, wall, MIDDLE, 2), wall.strain(MIDDLE)
    assert found.torsion == pytest.approx(theory.torsion, rel=2e-3)
    assert found.shear[0] == pytest.approx(theory.shear[0], rel=0.02)
    assert found.shear[1] == pytest.approx(theory.shear[1], rel=0.05)
    assert found.hoop == pytest.approx(theory.hoop[:2], rel=0.06)
    assert np.abs(found.axial).max() < 0.06 * np.abs(theory.hoop).max()
    for place in (0.01, 0.035):
        near = solved(toothed, wall, place, 1).shear
        assert near == pytest.approx(wall.strain(place).shear[:1], rel=0.05)


def test_tooth_forces_that_follow_the_lobes_fade_in_the_wall(toothed, wall):
    """Mid-wall, orders 2 to 6 leave 4 % of the shear that they have at the teeth.

    Order zero is the torque itself. At the last place before the teeth more is left.
    """
    response = HarmonicResponse(toothed, DESIGN.material_of("flexspline"))
    torsion = wall.torsion_strain()
    assert response.twist(MIDDLE, 0)[2] == pytest.approx(torsion, rel=2e-3)
    for order in (2, 4, 6):
        left, near = (
            np.abs(response.twist(place, order)[2]) / torsion
            for place in (MIDDLE, 0.0385)
        )
        assert 0.02 < left < 0.04
        assert near > 1.5 * left


@pytest.mark.slow
def test_torque_on_the_wave_generator_shears_the_wall_as_a_tube(wall):
    """With contact and teeth at 20 N·m: mean shear T r_o/(G J) within 0.5 %.

    Tooth forces add little that follows the lobes: 6 % to the shear of two lobes.
    """
    drive = SolidContinuation(
        model=solid_sector_model(DESIGN, half=True), ratio=DESIGN.ratio
    )
    deflected = drive.deflect()
    loaded = drive.to_torque(drive.engage(deflected), 20.0)
    material, orders = DESIGN.material_of("flexspline"), np.array([0.0, 2.0])
    shear = []
    for state, torque in ((deflected, 0.0), (loaded, 20.0)):
        x, rows = wall_orders(drive.model, state, material, orders)
        middle = (x > 0.006) & (x < 0.036)
        assert middle.sum() >= 3
        mean = rows[middle, 0, 2].real / wall.torsion_strain()
        assert np.abs(mean - torque).max() < 0.005 * 20.0
        shear.append(rows[middle, 1, 2])
    assert np.abs(shear[1] - shear[0]).max() < 0.06 * np.abs(shear[0]).min()


def test_contact_twists_the_wall_less_than_the_outline(wall):
    """Two lobes: 0.70 of the closed form mid-wall; four lobes: three times of it."""
    found, theory = deflected_strain(DESIGN, 0.018), wall.strain(0.018)
    assert found.torsion == theory.torsion
    assert (found.orders[:2] == [2.0, 4.0]).all()
    # in the same direction, seen from the same lobe
    assert 0.65 < (found.shear[0] / theory.shear[0]).real < 0.75
    assert 2.9 < (found.shear[1] / theory.shear[1]).real < 3.5
    # symmetric about the lobe: only sines
    assert np.abs(found.shear.real).max() < 1e-3 * np.abs(found.shear).max()


def test_bridges_read_the_finite_elements_alike(toothed, wall):
    """One bridge with turned gauges: gain 0.2 %, ripple of two lobes 2 %."""
    ring = GaugeRing(place=MIDDLE, turns=(0.05,))
    found, theory = solved(toothed, wall, MIDDLE), wall.strain(MIDDLE)
    assert ring.gain(found) == pytest.approx(ring.gain(theory), rel=2e-3)
    assert ring.ripple(found)[0] == pytest.approx(ring.ripple(theory)[0], rel=0.02)

"""The toothed rim as a line against its plane finite elements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector, sector_model
from swgjoint.fe.plane.equilibrium import NewtonSolver
from swgjoint.fe.plane.newton_step import Load
from swgjoint.fe.rings.equilibrium import ThinRingSolver
from swgjoint.fe.rings.loading import solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.sections import rim_section
from swgjoint.fe.rings.state import initial_state
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile


def plain(design):
    """E A and E I of the rim without teeth, and the radius of its middle."""
    wall = design.flexspline.rim_mm * 1e-3
    width = design.drive.face_width_mm * 1e-3
    modulus = design.material_of("flexspline").youngs_modulus
    middle = design.flexspline_inner_radius + 0.5 * wall
    return modulus * width * wall, modulus * width * wall**3 / 12.0, middle


def on_many_balls(design):
    """The rings on stiff balls and a race that hardly bends: nearly a rigid cam."""
    changes = {
        "clearance_um": 0.0,
        "balls": 110,
        "ball_diameter_mm": 1.2,
        "race_thickness_mm": 0.1,
        "race_width_mm": design.drive.face_width_mm,
    }
    model = thin_ring(
        design.with_changes(
            {f"wave_generator.bearing.{k}": v for k, v in changes.items()}
        )
    )
    return replace(model, ball_constant=4.0 * model.ball_constant)


@pytest.mark.parametrize("name", ["size-25-50", "size-25-100"])
def test_teeth_stiffen_the_rim(name):
    """Between the rim without teeth and a smooth one up to the tips."""
    design = Design.load(name)
    found = rim_section(
        sector(design, "flexspline", tooth_profile(design, "flexspline"))
    )
    stretching, bending, middle = plain(design)
    high = 1.4 * design.drive.module_mm / design.flexspline.rim_mm
    assert 1.0 < found.stretching / stretching < 1.0 + high
    assert 1.0 < found.bending / bending < (1.0 + high) ** 3
    assert middle < found.neutral_radius < middle + design.drive.module_mm * 1e-3


def test_section_scales_with_the_size():
    """E A with the square, E I with the fourth power of all lengths."""
    one, two = (
        rim_section(sector(design, "flexspline", tooth_profile(design, "flexspline")))
        for design in (Design.load("size-20-80"), Design.load("size-40-80"))
    )
    # the figures of the family are rounded to a nanometre
    assert two.stretching == pytest.approx(4.0 * one.stretching, rel=1e-5)
    assert two.bending == pytest.approx(16.0 * one.bending, rel=1e-5)


@pytest.mark.fe
@pytest.mark.parametrize(
    ("name", "tolerance"), [("size-25-50", 0.03), ("size-25-100", 0.015)]
)
def test_deflected_rim_holds_the_energy_of_plane_elements(name, tolerance):
    """On many stiff balls of a thin race, as on a rigid wave generator."""
    design = Design.load(name)
    plane = sector_model(
        design, half=True, elastic_circular_spline=False, bearing=False
    )
    load = Load(rotation=0.0, teeth=False)
    peer = NewtonSolver()(plane, plane.initial_guess(), load)
    assert peer.outcome.ok
    model = on_many_balls(design)
    state = ThinRingSolver()(
        model, initial_state(model, 0.0), rotation=0.0, teeth=False
    )
    assert state.outcome.ok
    # without its teeth the rim would hold 21 and 38 % less
    assert state.energy == pytest.approx(peer.energy, rel=tolerance)


@pytest.mark.slow
@pytest.mark.fe
@pytest.mark.parametrize("name", ["size-25-50", "size-25-100"])
def test_rim_and_teeth_yield_as_plane_elements(name):
    """On a nearly rigid cam their part of the compliance is that of the plane model."""
    design = Design.load(name)
    plane = Continuation(
        model=sector_model(design, half=True, bearing=False),
        ratio=design.ratio,
        layout=design.drive.layout,
    )
    model = on_many_balls(design)
    peer = plane.engage(plane.deflect())
    state = solve_loaded(model, solve_unloaded(model, 0.0), 1.0)
    over = []
    for torque in (60.0, 75.0, 90.0, 105.0, 120.0):
        peer = plane.to_torque(peer, torque)
        state = solve_loaded(model, state, torque)
        assert peer.outcome.ok
        assert state.outcome.ok
        own = state.compliance * (state.shares["rim"] + state.shares["teeth"])
        over.append(own / peer.compliance)
    # teeth that come in at other torques move single tangents by some per cent
    assert np.mean(over) == pytest.approx(1.0, abs=0.08), over

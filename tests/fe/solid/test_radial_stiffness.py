"""A cup between two opposite loads: closed forms, work, energy, large rotations."""

from __future__ import annotations

import pytest
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.fe.solid.figures import radial_stiffness as module
from swgjoint.fe.solid.figures.pinched_cup import PLACES, pinched_cup
from swgjoint.fe.solid.figures.radial_stiffness import (
    radial_stiffness,
    smooth_cup_stiffness,
)
from swgjoint.gear.design.design import Design
from swgjoint.gear.shell_theory import ring_stiffness

FORCE = 120.0  # deflects the small cup by about its lobe height [N]


def model(width):
    """The smooth wall of XB1-100-80 as a free tube, and its closed form per length."""
    changes = {"cup": None, "drive.face_width_mm": width, "mesh.refinement": 0.5}
    design = Design.load("xb1-100-80").with_changes(changes)
    wall, steel = 0.68e-3, design.material_of("flexspline")
    radius = design.flexspline_inner_radius + 0.5 * wall
    per_length = ring_stiffness(steel.youngs_modulus, wall, radius)
    return pinched_cup(design, toothless=True), per_length * width * 1e-3


@pytest.fixture(scope="module")
def small_cup(thin_cup, few_masters):
    """Its flexspline."""
    return pinched_cup(thin_cup, orders=few_masters)


def test_narrow_free_tube_is_the_ring():
    """A ring of 0.5 mm of width: the inextensional closed form within 0.1 %."""
    cup, closed = model(0.5)
    # 1.7 % of thickness over radius: shear and stretch are 1e-4
    for place in PLACES:
        assert cup.pull(1.0, place).stiffness == pytest.approx(closed, rel=1e-3)


def test_wide_free_tube_keeps_its_generators_straight():
    """A tube 47 walls wide, loaded evenly: nearly 1/(1 - nu^2) of the ring."""
    cup, closed = model(32.0)
    stiff = cup.pull(1.0, "face_width").stiffness / closed
    assert 1.05 < stiff < 1.0 / (1.0 - 0.3**2)
    assert cup.pull(1.0, "open_edge").stiffness < 0.8 * closed


def test_work_of_the_loads_is_the_strain_energy(small_cup):
    """Clapeyron: F w is the energy of both halves, w of the loaded points."""
    for place in PLACES:
        found = small_cup.pull(2.0, place)
        work = found.force * found.under_load
        assert found.energy == pytest.approx(work, rel=1e-8)
        # the dent under the load is small, and it is not in the deflection
        assert 0.99 < found.deflection / found.under_load < 1.0


def test_loads_are_reciprocal(small_cup):
    """A load at mid-face moves the open edge as much as the other way round."""
    cup = small_cup
    middle, edge = cup.pull(1.0, "mid_face"), cup.pull(1.0, "open_edge")
    # mean over the wall, loads on the bore: the difference is the local dent
    there = edge.of_planes @ cup.share("mid_face")
    assert middle.of_planes[0] == pytest.approx(there, rel=1e-3)
    assert middle.deflection < edge.deflection


def test_linear_in_the_load_and_tangent_to_large_rotations(small_cup):
    """Twice the load, twice the deflection; tiny loads see no rotation."""
    cup = small_cup
    one, two = cup.pull(1.0), cup.pull(-2.0)
    assert two.deflection == pytest.approx(-2.0 * one.deflection, rel=1e-12)
    tiny = cup.pull(1e-3, nonlinear=True)
    # 9e-5: the masters place curved sections almost, so that the linear level resists
    # rotations of a sector a little, which the frames take out
    assert tiny.stiffness == pytest.approx(one.stiffness, rel=2e-4)
    out, back = (cup.pull(F, nonlinear=True).stiffness for F in (FORCE, -FORCE))
    # pulled apart it stiffens, pressed together it softens, alike to first order
    assert out > one.stiffness > back
    assert 0.5 * (out + back) == pytest.approx(one.stiffness, rel=5e-3)


def test_force_is_the_slope_of_the_energy(small_cup):
    """With large rotations, too: dU = 2 F dw, to the square of the step."""
    cup, step = small_cup, 0.01 * FORCE
    low, high = (cup.pull(FORCE + s, nonlinear=True) for s in (-step, step))
    slope = (high.energy - low.energy) / (high.under_load - low.under_load)
    assert slope == pytest.approx(2.0 * FORCE, rel=1e-5)


def test_smooth_cup_is_the_inextensional_one():
    """XB1-100-80 without teeth: 5 % at mid-face, 1 % at the open edge.

    The closed form keeps the wall straight under the load and forgets the diaphragm.
    """
    design = Design.load("xb1-100-80").with_changes({"mesh.refinement": 0.5})
    cup = pinched_cup(design, toothless=True)
    edge = smooth_cup_stiffness(design, open_edge=True)
    assert cup.pull(1.0, "open_edge").stiffness == pytest.approx(edge, rel=0.01)
    middle = cup.pull(1.0).stiffness
    assert middle == pytest.approx(smooth_cup_stiffness(design), rel=0.05)
    # teeth on the same wall add to its stiffness, by a fifth here
    assert 1.15 < pinched_cup(design).pull(1.0).stiffness / middle < 1.3


def test_an_odd_number_of_teeth_has_no_opposite_one():
    """Refused with the key and what is accepted."""
    odd = Design.load("xb1-100-80").with_changes(
        {"drive.teeth_flexspline": 199, "drive.teeth_circular_spline": 201}
    )
    with pytest.raises(
        DesignError, match=naming("xb1-100-80", "drive.teeth_flexspline", "199", "even")
    ):
        pinched_cup(odd)


def test_all_figures_in_their_units(monkeypatch, small_cup):
    """Everything about one cup, N/mm in the JSON object."""
    cup = small_cup
    monkeypatch.setattr(module, "pinched_cup", lambda design, orders=None: cup)
    seen = []
    found = radial_stiffness(
        Design.load("xb1-100-80"), progress=lambda *args: seen.append(args)
    )
    assert found.mid_face == pytest.approx(cup.pull(1.0).stiffness)
    assert found.finer == found.coarser == found.mid_face
    assert found.force == pytest.approx(0.4e-3 * found.mid_face)
    assert found.inward < found.mid_face < found.outward
    shown = found.to_json()
    assert shown["open_edge_N_mm"] == pytest.approx(found.open_edge / 1e3)
    assert shown["large_rotations"]["outward_N_mm"] == found.outward / 1e3
    assert seen[-1] == ("radial stiffness", 4, 4)


@pytest.mark.slow
def test_xb1_is_converged():
    """65.5 N/mm: finer displacements change nothing, finer meshes less and less.

    The error falls about with the size of the elements, from above: 0.69 % from half of
    them to all, 0.23 % on to 1.4 times as many per direction.
    """
    design = Design.load("xb1-100-80")

    def stiffness(refinement, orders=None):
        changed = design.with_changes({"mesh.refinement": refinement})
        return pinched_cup(changed, orders=orders).pull(1.0).stiffness

    half, own, more = (stiffness(refinement) for refinement in (0.5, 1.0, 1.4))
    assert own == pytest.approx(65.5e3, rel=5e-3)
    assert stiffness(1.0, module.FINER) == pytest.approx(own, rel=4e-4)
    assert more == pytest.approx(own, rel=3e-3)
    assert half > own > more
    assert own - more < 0.4 * (half - own)

"""The stated designs of the comparison with the catalogue can all be built."""

from __future__ import annotations

from math import pi

import pytest

from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks
from swgjoint.gear.torsional_buckling import torsional_buckling_stress
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.units import GPa, mm, um
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design

STUDY = CatalogueFile.load("catalogue")
CLEARANCE_UM = {14: 12.5, 17: 13.0, 20: 13.0, 25: 14.5, 32: 18.0}
"""Middle of the normal class of ISO 5753-1: 5-20, 6-20, 6-20, 6-23 and 8-28 um."""


@pytest.mark.parametrize("variant", STUDY.variants, ids=lambda v: v.name)
def test_every_variant_is_feasible(variant):
    """Every size and ratio with the changes of the variant passes all checks."""
    for size in STUDY.sizes:
        for ratio in STUDY.ratios:
            design = variant_design(size, ratio, variant)
            assert [c.fault for c in design_checks(design) if not c.ok] == []
            assert design.flexspline.pressure_angle_deg == variant.flank_deg


@pytest.mark.parametrize("size", STUDY.sizes)
@pytest.mark.parametrize("ratio", STUDY.ratios)
def test_what_is_stated_is_what_is_run(size, ratio):
    """The figures that the file prints with a source are those of the family."""
    design, stated = Design.preset(f"size-{size}-{ratio}"), STUDY.stated
    bearing, d = BallBearing.from_design(design), 2.54 * size * mm
    race, steel = stated["outer_race"], stated["steel"]
    for value, multiple in (
        (design.drive.face_width_mm * mm, stated["face_width"]["per_pitch_diameter"]),
        (bearing.ball_diameter, stated["balls"]["per_pitch_diameter"]),
        (bearing.race_thickness, race["thickness_per_pitch_diameter"]),
        (bearing.race_width, race["width_per_pitch_diameter"]),
    ):
        # the family rounds to a nanometre
        assert value == pytest.approx(multiple * d, abs=0.6e-9)
    module = design.drive.module_mm * mm
    lobes = stated["lobe_deflection"]["per_module"]
    assert lobe_height(design) == pytest.approx(lobes * module, rel=1e-9)
    assert bearing.balls == stated["balls"]["number"]
    assert bearing.groove_inertia_factor == race["groove_inertia_factor"]
    assert bearing.groove_conformity == stated["groove_conformity"]["value"]
    assert bearing.clearance == pytest.approx(CLEARANCE_UM[size] * um)
    fit = stated["fit_of_race_in_rim"]["clearance_um"]
    assert bearing.fit_clearance == pytest.approx(fit * um)
    for member in (design.flexspline, design.circular_spline):
        thickness = stated["backlash"]["thickness_coefficient"]
        assert member.thickness_coefficient == thickness
    for material in (design.material_of("flexspline"), bearing.material):
        modulus = steel["youngs_modulus_GPa"] * GPa
        assert material.youngs_modulus == pytest.approx(modulus)
        assert material.poisson_ratio == steel["poisson_ratio"]
    assert not design.friction.tooth_coefficient
    assert STUDY.coefficients == (0.05, 0.10)


@pytest.mark.parametrize("ratio", STUDY.ratios)
def test_rims_follow_the_tooth_count_and_nothing_else_does(ratio):
    """Both rules by hand; other lengths over d or module are equal for all ratios."""
    teeth = 2 * ratio
    by_hand = {
        "rim by teeth": (75.0 + teeth / 4.0) * 1e-4,
        "rim by ratio": (65.0 + 2.5 * ratio ** (2.0 / 3.0)) * 1e-4,
    }
    for variant in STUDY.variants:
        tables = []
        for one in (ratio, 100):
            design = variant_design(25, one, variant)
            table = design.model_dump()
            rim = table["flexspline"].pop("rim_mm")
            table["cup"].pop("thickness_coefficient")
            if one == ratio:
                assert rim == pytest.approx(63.5 * by_hand[variant.rim.name], rel=1e-9)
            tables.append((table["cup"], table["wave_generator"], design.drive))
        (cup, generator, drive), (other_cup, other_generator, other_drive) = tables
        assert (cup, generator) == (other_cup, other_generator)
        assert drive.face_width_mm == other_drive.face_width_mm


@pytest.mark.parametrize("variant", STUDY.variants, ids=lambda v: v.name)
def test_walls_bear_the_buckling_torque(variant):
    """260 to 3500 N·m of the table or 3.9e-3 d^3, by the formula, below yield."""
    printed = {14: 260.0, 17: 500.0, 20: 800.0, 25: 1700.0, 32: 3500.0}
    limit = STUDY.stated["yield_of_cup"]["shear_stress_MPa"]
    assert limit == pytest.approx(1275.0 / 3.0**0.5, rel=1e-3)
    for size, torque in printed.items():
        thick = variant.cup.name == "short cup, thick wall"
        torque = torque if thick else 3.9e-3 * (2.54 * size) ** 3
        for ratio in STUDY.ratios:
            design = variant_design(size, ratio, variant)
            assert design.cup is not None
            wall = design.cup.thickness_coefficient * design.flexspline.rim_mm * mm
            radius = design.flexspline_inner_radius + 0.5 * wall
            stress = torque / (2.0 * pi * radius**2 * wall)
            buckling = torsional_buckling_stress(
                wall=wall,
                radius=radius,
                length=design.cup.length_mm * mm,
                material=design.material_of("flexspline"),
            )
            knock_down = 0.67 if thick else 1.0
            assert stress == pytest.approx(knock_down * buckling, rel=1e-9)
            assert stress < limit * 1e6
            assert 0.0050 < wall / (2.54 * size * mm) < 0.0073


def test_everything_stated_has_a_source():
    """No figure without saying where it comes from."""
    for name, entry in STUDY.stated.items():
        assert len(entry["source"]) > 8, name
    assert len(STUDY.individuals.source) > 8
    for choice in (*STUDY.cups, *STUDY.flanks, *STUDY.rims, *STUDY.experiments):
        assert len(choice.source) > 8

"""The stated designs of the comparison with the catalogue can all be built."""

from __future__ import annotations

import pytest

from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.units import GPa, mm, um
from swgjoint.validation.catalogue.file import CatalogueFile, variant_design

STUDY = CatalogueFile.load()
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
        (design.flexspline.rim_mm * mm, stated["rim"]["per_pitch_diameter"]),
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


def test_cups_are_as_stiff_as_stated():
    """At size 25 the hard cup is about 1.8 times as stiff as the soft one."""
    by_cup = {v.cup: v for v in STUDY.variants}
    hard, soft = (
        cup_torsional_stiffness(variant_design(25, 100, by_cup[name]))
        for name in ("hard", "soft")
    )
    # 17.2 and 9.4 of a Fourier shell of the same cups, in 1e4 N·m/rad
    assert hard == pytest.approx(17.2e4, rel=0.03)
    assert soft == pytest.approx(9.4e4, rel=0.03)


def test_everything_stated_has_a_source():
    """No figure without saying where it comes from."""
    for name, entry in STUDY.stated.items():
        assert len(entry["source"]) > 8, name
    assert len(STUDY.individuals.source) > 8

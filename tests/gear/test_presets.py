"""Bundled designs and the family by rule."""

from __future__ import annotations

from math import pi

import pytest
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.family import family_design, family_text
from swgjoint.gear.design.feasibility import design_checks
from swgjoint.models_path import bundled_names, models_path

NAMES = bundled_names("drives", ".toml")
SCHEMA = "#:schema ../schemas/design.json\n"
SHIPPED = [(size, ratio) for size in (14, 17, 20, 25, 32) for ratio in (50, 80, 100)]


@pytest.mark.parametrize("name", NAMES)
def test_presets_load_and_check(name):
    """Every bundled design is feasible, is named as its file, and names a source."""
    design = Design.preset(name)
    assert design.drive.name == name == name.lower()
    assert len(design.drive.source) > 10
    checks = design_checks(design)
    assert len(checks) > 8
    assert [check.name for check in checks if not check.ok] == []


def test_no_preset_names_another_folder():
    """The files stand alone: no paths in them but that of their schema."""
    for name in NAMES:
        text = (models_path() / "drives" / f"{name}.toml").read_text()
        text = text.removeprefix(SCHEMA)
        assert "../" not in text
        assert "shared" not in text


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("parabolic", {"wave_generator"}),
        ("four-roller", {"wave_generator"}),
        ("simplified", {"wave_generator"}),
        ("asymmetric", {"wave_generator"}),
        ("flexspline-fixed", {"drive"}),
        ("qca-improved", {"flexspline", "circular_spline"}),
        ("dca", {"flexspline", "circular_spline"}),
        ("dca-improved", {"flexspline", "circular_spline"}),
        ("involute", {"flexspline", "circular_spline"}),
    ],
)
def test_variants_differ_from_the_reference_only_in_their_part(name, changes):
    """One variant, one difference: comparisons compare what they say."""
    reference = Design.preset("reference-2d").model_dump()
    variant = Design.preset(f"reference-2d-{name}").model_dump()
    for data in (reference, variant):
        del data["drive"]["name"], data["drive"]["source"]
    assert {k for k in variant if variant[k] != reference[k]} == changes


def test_stress_cup_has_the_radii_of_its_article():
    """Mean radius 31.35 mm of a wall of 1.376 mm, deflection 0.372 mm."""
    design = Design.preset("stress-cup")
    mean = design.flexspline_inner_radius + 0.5e-3 * design.flexspline.rim_mm
    assert mean == pytest.approx(31.35e-3, abs=1e-9)
    deflection = 0.5e-3 * design.drive.module_mm * design.tooth_difference
    assert deflection == pytest.approx(0.372e-3, rel=1e-12)


@pytest.mark.parametrize(("size", "ratio"), SHIPPED)
def test_shipped_family_equals_the_rule(size, ratio):
    """The files are what the rule writes, to the letter."""
    name = f"size-{size}-{ratio}"
    assert name in NAMES
    path = models_path() / "drives" / f"{name}.toml"
    assert path.read_text() == SCHEMA + family_text(size, ratio)
    by_rule = Design.model_validate(family_design(size, ratio))
    assert Design.load(name) == Design.preset(name) == by_rule


@pytest.mark.parametrize("size", [8, 11, 40, 58, 100])
@pytest.mark.parametrize("ratio", [30, 50, 120, 160, 200])
def test_family_by_name(size, ratio):
    """Any size from 8 to 100 by name: size/10 inch, its ratio, feasible, similar."""
    design = Design.load(f"size-{size}-{ratio}")
    assert design == Design.preset(f"size-{size}-{ratio}")
    assert design.ratio == -ratio
    assert design.pitch_diameter == pytest.approx(size * 2.54e-3, rel=1e-7)
    assert all(check.ok for check in design_checks(design))
    ratings = ratings_of(design)
    assert 0 < ratings.rated_torque < ratings.repeated_peak
    # similar to the member of size 25, but for the rounding of the figures
    scale = size / 25
    twin = Design.load(f"size-25-{ratio}")
    for get in (
        lambda d: d.drive.face_width_mm,
        lambda d: d.flexspline.rim_mm,
        lambda d: d.cup.length_mm,
        lambda d: d.wave_generator.bearing.ball_diameter_mm,
        lambda d: d.flexspline.profile.root_radius_mm,
    ):
        assert get(design) == pytest.approx(scale * get(twin), abs=3e-6)


def test_balls_fit_around_the_bearing():
    """23 balls leave room on their circle, inside the bore of the flexspline."""
    design = Design.load("size-25-100")
    bearing = design.wave_generator.bearing
    bore = design.flexspline_inner_radius * 1e3
    circle = bore - bearing.race_thickness_mm - bearing.ball_diameter_mm / 2
    assert 2 * circle * pi > 1.02 * bearing.balls * bearing.ball_diameter_mm
    inner = circle - bearing.ball_diameter_mm / 2
    assert inner > 0.5 * 0.71 * 63.5


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("size-7-50", ("size-7-50", "size 7", "8", "100")),
        ("size-101-50", ("size-101-50", "size 101", "8", "100")),
        ("size-25-20", ("size-25-20", "ratio 20", "30", "200")),
        ("size-25", ("size-25", "models/drives", "reference-2d", "size-NN-RRR")),
    ],
)
def test_family_names_out_of_range(name, message):
    """A size or ratio beyond the rule is refused with its range."""
    with pytest.raises(DesignError, match=naming(*message)):
        Design.load(name)


def test_the_bought_drive_is_the_bundled_one_with_errors_and_friction():
    """Its coarse variant differs from it in the pitch error of the flexspline only."""
    plain = Design.load("size-25-100").model_dump()
    bought = Design.load("size-25-100-bought").model_dump()
    coarse = Design.load("size-25-100-bought-coarse").model_dump()
    stated = {"tolerances", "friction"}
    for one in (plain, bought, coarse):
        del one["drive"]["name"], one["drive"]["source"]
    assert {key for key in plain if plain[key] != bought[key]} == stated
    assert {key for key in bought if bought[key] != coarse[key]} == {"tolerances"}
    fine, rough = bought["tolerances"], coarse["tolerances"]
    (key,) = (key for key in fine if fine[key] != rough[key])
    assert key == "flexspline_cumulative_pitch_um"
    # three classes of ISO 1328-1, each of which is a factor of sqrt(2)
    assert rough[key] / fine[key] == pytest.approx(8.0**0.5, rel=2e-3)

"""Designs of other teeth and modules: to scale, feasible, and what had to be moved."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from messages import names, naming

from swgjoint.errors import DesignError
from swgjoint.gear.design.bounds import nearest_bound
from swgjoint.gear.design.defaults import defaults_taken
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import design_checks, engagement_checks
from swgjoint.gear.design.scaling import scaled_design
from swgjoint.gear.teeth.tooth_path import tooth_path
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.gear.wave_generators.wave_generator import wave_generator
from swgjoint.units import mm

MEMBERS = ("flexspline", "circular_spline")


def test_the_module_alone_gives_a_similar_drive():
    """Twice the module: twice every coordinate, nothing is moved, torques times eight.

    Micro-geometry follows the deflection, manufacturing errors stay.
    """
    old = Design.preset("reference-2d-parabolic").with_changes(
        {
            "tolerances.random_pitch_um": 2.0,
            "micro_geometry.flexspline_crowning_um": 5.0,
        }
    )
    found = scaled_design(old, name="twice", module=2.0)
    new = found.design
    assert found.moved == () and new.drive.name == "twice"
    for member in MEMBERS:
        before, after = tooth_profile(old, member), tooth_profile(new, member)
        s = np.linspace(0.0, before.stations[-1], 50)
        ratio = after.stations[-1] / before.stations[-1]
        assert ratio == pytest.approx(2.0, rel=1e-5)
        points, _, _ = before.evaluate(s)
        np.testing.assert_allclose(
            after.evaluate(s * ratio)[0], 2.0 * points, atol=1e-5 * mm
        )
    # six digits of the parabola's coefficient
    outlines = wave_generator(old), wave_generator(new)
    assert outlines[1].perimeter == pytest.approx(2.0 * outlines[0].perimeter, rel=1e-5)
    assert new.ratings.rated_torque_Nm == 8.0 * old.ratings.rated_torque_Nm
    assert new.micro_geometry.flexspline_crowning_um == 10.0
    assert new.tolerances == old.tolerances


@pytest.mark.parametrize(
    "template",
    ["reference-2d", "reference-2d-dca", "reference-2d-simplified", "size-25-80"],
)
@pytest.mark.parametrize("teeth", [(160, 162), (60, 62), (120, 124)])
def test_other_teeth_are_feasible(template, teeth):
    """All checks pass, those of the engagement too; teeth and module are the asked."""
    found = scaled_design(Design.preset(template), name="new", teeth=teeth, module=0.4)
    design = found.design
    drive = design.drive
    asked = (drive.teeth_flexspline, drive.teeth_circular_spline, drive.module_mm)
    assert asked == (*teeth, 0.4)
    checks = design_checks(design)
    checks += engagement_checks(design, tooth_path(design, positions=241, points=101))
    assert [check.fault for check in checks if not check.ok] == []
    assert Design.from_toml(design.to_toml()) == design


def test_what_cannot_be_scaled_is_moved_with_its_bound():
    """A tip radius set too large elsewhere: one value moves, just beyond its bound."""
    template = Design.preset("reference-2d")
    changes = {"flexspline.addendum_coefficient": 0.75}
    found = scaled_design(template, name="new", module=0.5, changes=changes)
    (moved,) = found.moved
    assert found.design.flexspline.addendum_coefficient == 0.75
    assert moved.bound.rejected != moved.value
    at_bound = found.design.with_changes({moved.key: moved.bound.accepted})
    assert all(check.ok for check in design_checks(at_bound))
    short = moved.bound.rejected + 0.99 * (moved.bound.accepted - moved.bound.rejected)
    before = found.design.with_changes({moved.key: short})
    assert not all(check.ok for check in design_checks(before))
    assert names(str(moved), moved.key, f"{moved.bound.accepted:.6g}", "accepted")


def test_a_design_that_no_single_value_mends_is_refused():
    """The faults of the part, with bounds; teeth and modules outside their range."""
    template = Design.preset("reference-2d")
    steep = {"flexspline.pressure_angle_deg": 40.0}
    with pytest.raises(DesignError, match=naming("pressure_angle_deg", "<=")):
        scaled_design(template, name="new", changes=steep)
    with pytest.raises(DesignError, match=naming("module_mm", "-1 mm", "50 mm")):
        scaled_design(template, name="new", module=-1.0)
    with pytest.raises(DesignError, match=naming("teeth_circular_spline", "'new'")):
        scaled_design(template, name="new", teeth=(160, 161))


@pytest.mark.parametrize("limit", [0.3, 0.87, 1.13, 4.2])
def test_a_bound_is_the_nearest_accepted_value(limit):
    """Of an interval on either side, to four digits, never outside it."""
    below = nearest_bound(1.0, lambda v: v <= limit if limit < 1.0 else v >= limit)
    assert below is not None
    assert below.accepted == pytest.approx(limit, rel=2e-4)
    assert (below.accepted <= limit) == (limit < 1.0) or below.accepted == limit
    assert below.sign == ("<=" if limit < 1.0 else ">=")
    assert nearest_bound(1.0, lambda v: False) is None
    assert (
        nearest_bound(1.0, lambda v: v > limit, high=0.5 * limit) is None or limit < 1
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"flexspline.profile.tip_radius_mm": 0.9},
        {"flexspline.profile.root_radius_mm": 1.9},
        {"circular_spline.profile.straight_mm": 1.4},
        {"flexspline.thickness_coefficient": 1.5},
        {"flexspline.pressure_angle_deg": 50.0},
    ],
)
def test_a_tooth_that_cannot_be_built_tells_what_can(changes):
    """The bound in the message, set in the design, makes the tooth possible."""
    design = Design.preset("reference-2d").with_changes(changes)
    member = next(iter(changes)).partition(".")[0]
    with pytest.raises(DesignError) as caught:
        tooth_profile(design, member)
    text = str(caught.value)
    # as a process of a sweep hands it on
    assert str(pickle.loads(pickle.dumps(caught.value))) == text
    where, _, accepted = text.partition("; accepted: ")
    first = accepted.split(" or ")[0]
    words = first.removesuffix(" mm").removesuffix(" deg").split()
    own = where.split(" = ")[0].partition(f"{member}.")[2]
    key = own if words[0] in ("<=", ">=") else words[0]
    value = float(words[-1])
    tooth_profile(design.with_changes({f"{member}.{key}": value}), member)
    worse = 1.001 if "<=" in first else 0.999
    with pytest.raises(DesignError):
        tooth_profile(design.with_changes({f"{member}.{key}": value * worse}), member)


def test_teeth_on_another_module_tell_the_common_factor():
    """No single length helps; all of them times the factor in the message do."""
    design = Design.preset("reference-2d").with_changes({"drive.module_mm": 0.4})
    with pytest.raises(DesignError, match=naming("tip_radius_mm", "<=")) as caught:
        tooth_profile(design, "flexspline")
    factor = float(str(caught.value).partition("<= ")[2].split(",")[0])
    profile = design.flexspline.profile.model_dump()
    lengths = {k: v * factor for k, v in profile.items() if k.endswith("_mm")}
    scaled = {f"flexspline.profile.{key}": value for key, value in lengths.items()}
    tooth_profile(design.with_changes(scaled), "flexspline")


def test_defaults_are_those_that_the_file_leaves_out():
    """A design without [material] takes steel; what is stated is no default."""
    design = Design.preset("reference-2d")
    text = design.to_toml()
    assert defaults_taken(Design.from_toml(text)) == {}
    head, _, rest = text.partition("[material]")
    bare = Design.from_toml(head + "[flexspline]" + rest.split("[flexspline]", 1)[1])
    taken = defaults_taken(bare)
    assert taken["material.youngs_modulus_GPa"] == 210.0
    assert taken["material.poisson_ratio"] == 0.29
    assert set(taken) == {key for key in taken if key.startswith("material.")}


def test_overlap_of_the_flanks_is_a_check():
    """Teeth thickened beyond their room fail it, and the value it names passes it."""
    design = Design.preset("reference-2d")

    def clearance(of):
        path = tooth_path(of, positions=241, points=101)
        return engagement_checks(of, path)[0]

    fine = clearance(design)
    assert fine.ok and -2.0 < fine.value < 0.0  # µm, limit -10
    thick = design.with_changes({"circular_spline.thickness_coefficient": 1.05})
    bad = clearance(thick)
    assert not bad.ok and bad.value < fine.value - 10.0
    assert names(bad.fault, "thickness_coefficient", "1.05", "at most 10 µm")
    named = float(bad.fault.partition("about ")[2].split()[0])
    less = design.with_changes({"circular_spline.thickness_coefficient": named})
    assert clearance(less).value == pytest.approx(-10.0, abs=2.0)

"""The springs between the members and what they are mounted to."""

from __future__ import annotations

import pytest
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.gear import kinematics
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import coupling_share, series_compliance, springs_of

STIFFNESS = 500.0


def coupled(layout):
    """A drive without cup behind a coupling."""
    return Design.load("reference-2d").with_changes(
        {
            "drive.layout": layout,
            "coupling.torsional_stiffness_Nm_rad": STIFFNESS,
        }
    )


@pytest.mark.parametrize(
    ("layout", "member"),
    [
        ("circular_spline_fixed", "circular_spline_fixed"),
        ("flexspline_fixed", "flexspline_fixed"),
        # with the input held the wave generator drives the output alone
        ("wave_generator_fixed", "flexspline_fixed"),
    ],
)
def test_output_yields_as_the_wave_generator_would_turn_it(layout, member):
    """A twist of the coupling turns the output by the share of torque it carries."""
    design = coupled(layout)
    # turn of the output per turn of the wave generator, the other member still
    turned = 1.0 / kinematics.ratio(member, 120, 122)
    assert coupling_share(design) == pytest.approx(turned, rel=1e-12)
    expected = turned**2 / STIFFNESS
    assert series_compliance(design, cup=True) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("layout", "boss", "housing"),
    [
        ("circular_spline_fixed", 1.0, 122 / 120),
        ("flexspline_fixed", 120 / 122, 1.0),
        ("wave_generator_fixed", 120 / 122, 1.0),
    ],
)
def test_output_yields_as_the_other_springs_would_turn_it(layout, boss, housing):
    """Under a held wave generator the teeth hand a turn on by their numbers."""
    stiffness = {"boss": 2e5, "housing": 1e5}
    turned = {"boss": boss, "housing": housing}
    for used in (["boss"], ["housing"], ["boss", "housing"]):
        design = Design.load("reference-2d").with_changes(
            {"drive.layout": layout}
            | {f"{name}.torsional_stiffness_Nm_rad": stiffness[name] for name in used}
        )
        expected = sum(turned[name] ** 2 / stiffness[name] for name in used)
        assert series_compliance(design, cup=True) == pytest.approx(expected, rel=1e-12)


def test_the_label_names_it():
    """Maps say which springs are in them; absent ones are not there."""
    design = coupled("circular_spline_fixed")
    assert springs_of(design) == {"coupling": STIFFNESS}
    assert springs_of(Design.load("reference-2d")) is None


def test_designs_without_it_keep_their_hash():
    """Kept results of designs without a coupling stay theirs; with one they change."""
    plain = coupled("circular_spline_fixed").with_changes({"coupling": None})
    assert plain.content_hash() == Design.load("reference-2d").content_hash()
    assert plain.content_hash() != coupled("circular_spline_fixed").content_hash()


def test_a_coupling_without_stiffness_is_refused():
    """One line with the key."""
    with pytest.raises(
        DesignError,
        match=naming(
            "coupling.torsional_stiffness_Nm_rad",
            "0 N·m/rad",
            "> 0 N·m/rad",
            "<= 1e+12 N·m/rad",
        ),
    ):
        Design.load("reference-2d").with_changes(
            {"coupling.torsional_stiffness_Nm_rad": 0.0}
        )

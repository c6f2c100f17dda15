"""What every level of a map carries of a whole drive, and what it names as left out."""

from __future__ import annotations

import itertools

import pytest

from swgjoint.drives.build_map import build_map
from swgjoint.drives.solve_map import check_level
from swgjoint.errors import DesignError
from swgjoint.fe.plane.drive2d import unmodelled_parts
from swgjoint.gear.design.design import Design
from swgjoint.gear.kinematics import LAYOUTS
from swgjoint.gear.mounting import series_compliance
from swgjoint.maps.equilibrium import output_angle

FEATURES = {
    "plain": {},
    "crowning": {"micro_geometry.wave_generator_crowning_um": 20.0},
    "tooth errors": {"tolerances.circular_spline_cumulative_pitch_um": 5.0},
    "wave generator errors": {"tolerances.wave_generator_ovality_um": 3.0},
    "misalignment": {"tolerances.misalignment_arcmin": 2.0},
    "friction": {"friction.tooth_coefficient": 0.1},
    "springs": {"housing": {"torsional_stiffness_Nm_rad": 1e6}},
}
PLAIN = "reference-2d"
CUP = "reference-3d-modified"
BEARING = "size-25-100"
MICRO, LEAN = "micro_geometry", "tolerances.misalignment_arcmin"
RING = {"tooth passage", "rim of the circular spline"}
PATCH = "tooth contact narrower than a contact patch"


def whole(name: str, layout: str, features: tuple[str, ...]) -> Design:
    """A bundled design in a layout, with features."""
    changes = {"drive.layout": layout}
    for feature in features:
        changes |= FEATURES[feature]
    return Design.load(name).with_changes(changes)


def left_out(design: Design, model: str) -> set[str]:
    """Parts that the label names."""
    return set((unmodelled_parts(design, model) or "").split(" and ")) - {""}


PAIRS = [*itertools.combinations(FEATURES, 2), tuple(FEATURES)]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("features", PAIRS, ids=" and ".join)
def test_no_level_refuses_a_design(layout, features):
    """2D takes any design, 3D any with a cup, thin rings any with a bearing.

    What is left out is named: micro-geometry and leaning axes in the plane, a bearing
    in space and, in the plane, in layouts whose balls roll otherwise.
    """
    leans, shaped = "misalignment" in features, "crowning" in features
    for name in (PLAIN, CUP, BEARING):
        design = whole(name, layout, features)
        check_level(design, "2d")
        parts = left_out(design, "2d")
        assert (LEAN in parts) == leans
        assert (MICRO in parts) == (shaped or name != PLAIN)
        held = layout == "circular_spline_fixed"
        assert ("wave_generator.bearing" in parts) == (name == BEARING and not held)
        if design.cup is not None:
            check_level(design, "3d")
            parts = left_out(design, "3d")
            assert parts - {PATCH} == ({"wave_generator.bearing"} & {*parts})
            assert ("wave_generator.bearing" in parts) == (name == BEARING)
        if name == BEARING:
            check_level(design, "ring")
            parts = left_out(design, "ring")
            assert RING < parts and (LEAN in parts) == leans


def test_what_a_level_needs_is_named():
    """A cup in space; a bearing for thin rings."""
    with pytest.raises(DesignError, match="cup"):
        check_level(Design.load(PLAIN), "3d")
    with pytest.raises(DesignError, match="bearing"):
        check_level(Design.load(CUP), "ring")
    with pytest.raises(DesignError, match="'ring', '2d' or '3d'"):
        check_level(Design.load(PLAIN), "4d")


@pytest.mark.parametrize("layout", ["flexspline_fixed", "wave_generator_fixed"])
def test_thin_rings_carry_all_layouts(layout):
    """Their compliance, springs included, grows with the square of the torsion."""
    maps = {
        name: build_map(whole(BEARING, name, ("springs",)), model="ring", angles=3)
        for name in ("circular_spline_fixed", layout)
    }
    held, moved = maps["circular_spline_fixed"], maps[layout]
    s = held.teeth_flexspline / held.teeth_circular_spline
    torque = 30.0
    twist = [
        float(output_angle(drive, 0.0, -load) - output_angle(drive, 0.0, load))
        for drive, load in ((held, torque), (moved, torque / s))
    ]
    assert twist[1] == pytest.approx(s * twist[0], rel=1e-3)
    assert (
        moved.info["design_hash"] == whole(BEARING, layout, ("springs",)).content_hash()
    )
    assert moved.layout == layout
    series = [
        series_compliance(whole(BEARING, name, ("springs",)), cup=True)
        for name in ("circular_spline_fixed", layout)
    ]
    assert series[1] == pytest.approx(s**2 * series[0], rel=1e-12)

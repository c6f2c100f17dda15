"""Generated involutes: analytic flank, cutters that touch and never cut, refusals."""

from __future__ import annotations

from math import pi, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile

MEMBERS = ("flexspline", "circular_spline")
INVOLUTE = {"profile": {"kind": "involute"}}


@pytest.mark.parametrize("member", MEMBERS)
@pytest.mark.parametrize("angle", [19.8, 20.4, 28.0])
@pytest.mark.parametrize("thickness", [0.9, 1.0])
def test_flank_is_the_analytic_involute(make_profile, member, angle, thickness):
    """A point at radius r stands at c_P pi/2N +- (inv alpha - inv alpha_r)."""
    values = {"pressure_angle_deg": angle, "thickness_coefficient": thickness}
    p = make_profile(member, INVOLUTE | values)
    points, normals, curvature = p.evaluate(
        np.linspace(*p.range_of("involute", "involute"), 400)
    )
    r = np.hypot(*points.T)
    alpha = np.deg2rad(angle)
    base = p.pitch_radius * np.cos(alpha)
    alpha_r = np.arccos(base / r)
    roll = np.tan(alpha_r) - alpha_r
    sign = -1.0 if member == "circular_spline" else 1.0
    expected = thickness * pi / (2 * p.teeth) + sign * (tan(alpha) - alpha - roll)
    assert np.abs((np.arctan2(*points.T) - expected) * r).max() < 1e-12
    # the normal is tangent to the base circle and curvature is that of the string
    arm = np.abs(points[:, 0] * normals[:, 1] - points[:, 1] * normals[:, 0])
    assert arm == pytest.approx(base, rel=1e-9)
    string = base * np.tan(alpha_r)
    assert curvature[:-1] == pytest.approx(sign / string[:-1], rel=1e-5)


@pytest.mark.parametrize("member", MEMBERS)
def test_generated_profile_obeys_the_laws(make_profile, profile_laws, member):
    """Top land, edge, involute, fillet and root land form a chain."""
    p = make_profile(member, INVOLUTE)
    profile_laws(p)
    assert [q.name for q in p.segments] == [
        "top_land",
        "involute",
        "fillet",
        "root_land",
    ]
    assert [j.edge for j in p.junctions()] == [True, False, False]


def cutter_points(half_width, depth, rho, alpha, count=4000):
    """Right side of a rack tooth that points to -y, pitch line y = 0."""
    y_c = depth - rho
    x_c = half_width - y_c * tan(alpha) - rho / np.cos(alpha)
    turn = np.linspace(-pi / 2, -alpha, count)
    tip = np.stack([x_c + rho * np.cos(turn), -y_c + rho * np.sin(turn)], axis=-1)
    y = np.linspace(tip[-1, 1], 0.9e-3, count)
    return np.concatenate(
        [tip, np.stack([half_width + y * tan(alpha), y], axis=-1)[1:]]
    )


def test_rack_touches_everywhere_and_cuts_nowhere(make_profile):
    """A rack rolled along the finished tooth finds every point of the flank."""
    p = make_profile("flexspline", INVOLUTE)
    alpha, m = np.deg2rad(20.0), 1e-3
    rack = cutter_points(pi * m / 4, 0.8 * m, 0.25 * m, alpha)
    r = p.pitch_radius
    s = np.linspace(*p.contact_range, 60)[1:-1]
    flank, _, _ = p.evaluate(s)
    nearest = np.full(len(s), np.inf)
    for turn in np.linspace(-0.06, 0.08, 141):
        # rack tooth axis half a pitch beside the tooth; mirrored: its other side cuts
        x = pi * m / 2 - rack[:, 0] - r * turn
        y = r + rack[:, 1]
        c, d = np.cos(turn), np.sin(turn)
        seen = np.stack([x * c + y * d, y * c - x * d], axis=-1)
        gap, _, _ = p.signed_distance(seen[::4])
        assert gap.min() > -1e-9
        away = np.hypot(*(flank[:, None] - seen[::8]).transpose(2, 0, 1)).min(axis=1)
        nearest = np.minimum(nearest, away)
    # half the spacing of the rack's points, and the steps of the roll
    assert nearest.max() < 3e-6


def test_shaper_touches_everywhere_and_cuts_nowhere():
    """A cutter with half the teeth rolls inside the ring and leaves its flank."""
    values = {"circular_spline.profile": {"kind": "involute"}}
    p = tooth_profile(
        Design.load("reference-2d").with_changes(values), "circular_spline"
    )
    # the cutter as an external involute gear, rounded: its own generated twin
    cutter = Design.load("reference-2d").with_changes(
        {
            "drive.teeth_flexspline": 61,
            "drive.teeth_circular_spline": 63,
            "flexspline.profile": {"kind": "involute"},
            "flexspline.addendum_coefficient": 0.8 - 0.25 * (1 - np.sin(0.349066)),
        }
    )
    q = tooth_profile(cutter, "flexspline")
    teeth, r, r_g = 61, p.pitch_radius, q.pitch_radius
    flank, _, _ = q.evaluate(np.linspace(*q.range_of("involute", "involute"), 800))
    mine, _, _ = p.evaluate(np.linspace(*p.range_of("involute", "involute"), 40)[:30])
    nearest = np.full(len(mine), np.inf)
    for turn in np.linspace(-0.15, 0.1, 301):  # of the cutter, counter-clockwise
        c, d = np.cos(turn), np.sin(turn)
        x, y = flank[:, 0] * c - flank[:, 1] * d, flank[:, 0] * d + flank[:, 1] * c
        y = y + r - r_g
        back = turn * teeth / p.teeth
        c, d = np.cos(back), np.sin(back)
        x, y = x * c + y * d, y * c - x * d
        # from the space's right flank to the tooth's: half a pitch, mirrored
        c, d = np.cos(p.half_pitch), np.sin(p.half_pitch)
        seen = np.stack([-(x * c - y * d), x * d + y * c], axis=-1)
        gap, _, _ = p.signed_distance(seen)
        assert gap[np.isfinite(gap)].min() > -1e-9
        away = np.hypot(*(mine[:, None] - seen).transpose(2, 0, 1)).min(axis=1)
        nearest = np.minimum(nearest, away)
    assert nearest.max() < 3e-6


@settings(max_examples=120, deadline=None)
@given(
    member=st.sampled_from(MEMBERS),
    angle=st.floats(1.0, 45.0),
    addendum=st.floats(0.1, 2.0),
    dedendum=st.floats(0.1, 2.0),
    thickness=st.floats(0.5, 1.5),
    tip=st.none() | st.floats(0.01, 1.0),
    cutter=st.none() | st.integers(10, 140),
)
def test_any_involute_is_right_or_refused(
    make_profile, profile_laws, member, angle, addendum, dedendum, thickness, tip,
    cutter
):  # fmt: skip
    """Parameters give a chain that obeys the laws, or one line that names a key."""
    section = {"kind": "involute"}
    section |= {} if tip is None else {"cutter_tip_radius_mm": tip}
    section |= {} if cutter is None else {"cutter_teeth": cutter}
    values = {
        "pressure_angle_deg": angle,
        "addendum_coefficient": addendum,
        "dedendum_coefficient": dedendum,
        "thickness_coefficient": thickness,
        "profile": section,
    }
    try:
        p = make_profile(member, values)
    except DesignError as error:
        assert "\n" not in str(error)
        keys = ("_coefficient", "_deg", "_mm", "cutter_teeth")
        assert member in str(error) and any(key in str(error) for key in keys)
        return
    profile_laws(p)


def test_undercut_is_refused(make_profile):
    """A small pressure angle makes the rack undercut: one line that says so."""
    with pytest.raises(
        DesignError,
        match=naming(
            "flexspline.pressure_angle_deg",
            "4.0 deg",
            "0.5674 mm",
            "< 0.2745 mm",
            "dedendum_coefficient",
            "cutter_tip_radius_mm",
        ),
    ):
        make_profile("flexspline", INVOLUTE | {"pressure_angle_deg": 4.0})

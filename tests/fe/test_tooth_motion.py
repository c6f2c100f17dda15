"""Motion of the teeth by finite elements, and the profiles that follow from it."""

from __future__ import annotations

import numpy as np
import pytest
from fe_tooth_motion import conjugate_by_fe, deflected_rim

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.linearise import linearise
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.neutral_line import neutral_line

THETA = np.linspace(-np.pi, 2.0 * np.pi, 31)


def design(**changes) -> Design:
    return Design.preset("reference-2d").with_changes(
        {"circular_spline.profile": {"kind": "conjugate"}} | changes
    )


def test_teeth_on_an_ellipse_follow_the_neutral_line():
    """An independent twin: rigid teeth on the outline, within half a micrometre."""
    found = deflected_rim(design()).pose(THETA)
    line = neutral_line(design()).pose(THETA)
    assert np.abs(found.point - line.point).max() < 0.5e-6
    assert np.abs(found.angle - line.angle).max() < 1.5e-5


def test_where_nothing_carries_the_rim_it_leaves_the_outline():
    """Half-way between the lobes of two half-circles the rim stands off."""
    simplified = Design.preset("reference-2d-simplified")
    rim, line = deflected_rim(simplified), neutral_line(simplified)
    across = np.array([0.5 * np.pi])
    apart = rim.pose(across).point - line.pose(across).point
    assert np.abs(apart).max() > 20e-6


def test_pose_is_differentiated_right():
    """Derivatives against central differences, and a period of half a turn."""
    rim, step = deflected_rim(design()), 1e-5
    pose, ahead, behind = (rim.pose(THETA + h) for h in (0.0, step, -step))
    slope = (ahead.point - behind.point) / (2.0 * step)
    assert pose.d_point == pytest.approx(slope, abs=1e-9)
    slope = (ahead.angle - behind.angle) / (2.0 * step)
    assert pose.d_angle == pytest.approx(slope, abs=1e-7)
    again = rim.pose(THETA + np.pi)
    assert again.point == pytest.approx(-pose.point, abs=1e-12)


@pytest.mark.fe
def test_conjugate_teeth_just_touch_where_the_elements_put_them():
    """Over a pitch the closest flanks of the deflected drive meet within 0.3 um."""
    drive = design()
    profile = conjugate_by_fe(drive, "circular_spline")
    model = sector_model(drive, half=True, profiles={"circular_spline": profile})
    follow = Continuation(model=model, ratio=drive.ratio)
    for angle in 2.0 * np.pi / 122 * np.arange(4) / 4:
        state = follow.deflect(float(angle))
        ring = linearise(model, state, None)
        gap = ring.search.search(ring.flank, 2e-5, None).gap
        assert abs(gap.min()) < 0.3e-6
    # and they carry: engaged and loaded like any other teeth
    loaded = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    assert loaded.outcome.ok
    assert -25e-6 < loaded.rotation < -15e-6

"""Flanks of arcs and lines evaluated at once, against their pieces one by one."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile

DESIGNS = ("reference-2d", "reference-2d-dca", "size-25-100")


@pytest.mark.parametrize("member", ["flexspline", "circular_spline"])
@pytest.mark.parametrize("name", DESIGNS)
def test_at_once_equals_piece_by_piece(name, member):
    """Points, normals and curvatures to round-off, beyond both ends, too."""
    profile = tooth_profile(Design.load(name), member)
    s = np.linspace(-1e-5, profile.stations[-1] + 1e-5, 997)
    points, normals, curvature = profile.evaluate(s)
    index = np.searchsorted(profile.stations, s, side="right") - 1
    index = np.clip(index, 0, len(profile.segments) - 1)
    for k, part in enumerate(profile.segments):
        here = index == k
        along = s[here] - profile.stations[k]
        point, normal, bend = part.evaluate_at(along, profile.side)
        assert np.abs(points[here] - point).max() < 1e-16
        assert np.abs(normals[here] - normal).max() < 2e-15
        assert np.array_equal(curvature[here], bend)


def test_other_curves_go_piece_by_piece():
    """An involute is no arc."""
    profile = tooth_profile(Design.load("reference-2d-involute"), "flexspline")
    assert profile._arcs is None
    _, normals, _ = profile.evaluate(np.linspace(0.0, profile.stations[-1], 50))
    assert np.abs(np.hypot(*normals.T) - 1.0).max() < 1e-12

"""Laws that every tooth profile obeys, and designs with other profiles."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile


def _laws(p):
    """Closed, tangent but at edges, from tip to root circle, a distance field."""
    for junction in p.junctions():
        assert junction.gap < 1e-13
        assert junction.edge or junction.corner < 1e-10
    s = p.stations
    assert np.diff(s).min() > 0.0
    points, normals, curvature = p.evaluate(np.linspace(0.0, s[-1], 600))
    assert np.isfinite(points).all() and np.isfinite(curvature).all()
    assert np.hypot(*normals.T) == pytest.approx(1.0, rel=1e-12)
    assert points[0] == pytest.approx([0.0, p.addendum_radius], abs=1e-15)
    assert np.hypot(*points[-1]) == pytest.approx(p.dedendum_radius, rel=1e-12)
    assert np.arctan2(*points[-1]) == pytest.approx(pi / p.teeth, rel=1e-12)
    # from tip to root without turning back, on one side of the tooth axis
    radius = p.side * np.hypot(*points.T)
    assert np.diff(radius).max() < 1e-15
    angle = np.arctan2(points[:, 0], points[:, 1])
    assert angle.min() >= -1e-15 and angle.max() <= pi / p.teeth * (1 + 1e-12)
    # the distance field: a hair outside, on the normal, is that far away
    low, high = p.contact_range
    s = np.linspace(low, high, 202)[1:-1]
    points, normals, _ = p.evaluate(s)
    gap, found, _ = p.signed_distance(points + 1e-7 * normals)
    assert gap == pytest.approx(1e-7, rel=1e-6)
    assert np.abs(found - normals).max() < 1e-6
    # arc length and tangent: differences along the flank
    step = 1e-9
    ahead, behind = p.evaluate(s + step)[0], p.evaluate(s - step)[0]
    tangent = p.side * np.stack([normals[:, 1], -normals[:, 0]], axis=-1)
    inside = np.searchsorted(p.stations, s - step) == np.searchsorted(
        p.stations, s + step
    )
    slope = (ahead - behind) / (2.0 * step)
    # 1e-4: how far a spline may be from unit speed in the sharpest fillets
    assert np.abs(slope - tangent)[inside].max() < 1e-4


@pytest.fixture(scope="session")
def profile_laws():
    """Check the laws of a profile."""
    return _laws


@pytest.fixture(scope="session")
def make_profile():
    """Profile of a member of the 2D reference with other values of its keys."""
    reference = Design.load("reference-2d")

    def make(member, values):
        changes = {f"{member}.{key}": value for key, value in values.items()}
        return tooth_profile(reference.with_changes(changes), member)

    return make

"""A 3D map of a drive with tooth friction: hysteresis of the 2D model."""

from __future__ import annotations

import pytest

from swgjoint.drives import solve_map as solving
from swgjoint.drives.build_map import build_map

pytestmark = [pytest.mark.fe, pytest.mark.slow]


def test_friction_of_the_teeth_gives_hysteresis(
    small_design, small_pattern, monkeypatch
):
    """Elements as those of the 2D map, on the potential of the drive in space."""
    monkeypatch.setattr(
        solving, "sample_map", lambda design, **_: small_pattern(design)
    )
    rubbing = small_design.with_changes({"friction.tooth_coefficient": 0.1})
    smooth, found = (
        build_map(design, model="3d", cache=False) for design in (small_design, rubbing)
    )
    assert found.hysteresis and not smooth.hysteresis
    assert (found.potential == smooth.potential).all()
    assert "2d" in found.info["label"]["friction"]
    assert smooth.info["label"]["friction"] is None

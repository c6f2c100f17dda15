"""Dimensions of a drive as figures of a sweep."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.explore.sweep.figures import SIZE_FIGURES, Asked, compute
from swgjoint.explore.sweep.tasks import SizeTask
from swgjoint.fe.solid.strip.mesh import flexspline_strip
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile
from swgjoint.units import mm


def sizes(design: Design) -> dict[str, float]:
    """Diameter, length and volume of a design."""
    task = SizeTask(figures=SIZE_FIGURES)
    asked = Asked(
        key="", design=design, scene=None, meshing=None, spec=None, size=task, run=None
    )
    record = compute(asked)
    assert record.ok
    return record.figures


@pytest.mark.parametrize("name", ["reference-3d", "dca-80-to-1"])
def test_the_flexspline_fits_into_the_cylinder_of_the_drive(name):
    """The length is that of the 3D mesh with its teeth; no node is outside."""
    design = Design.load(name).with_changes({"mesh.refinement": 0.5})
    if design.cup.kind == "hat":
        design = design.with_changes({"cup.bore_radius_mm": 60.0})
    found = sizes(design)
    strip = flexspline_strip(design, tooth_profile(design, "flexspline"))
    nodes = [np.asarray(segment.mesh.p) for segment in strip.segments]
    x, y, z = np.concatenate(nodes, axis=1) / mm
    assert found["length_mm"] == pytest.approx(np.ptp(z), rel=1e-9)
    assert found["outer_diameter_mm"] >= 2.0 * np.hypot(x, y).max() * (1.0 - 1e-9)


def test_wider_teeth_lengthen_a_drive_with_a_cup():
    """A millimetre of face width is a millimetre of length."""
    design = Design.load("reference-3d")
    wider = design.with_changes(
        {"drive.face_width_mm": design.drive.face_width_mm + 1.0}
    )
    before, after = sizes(design), sizes(wider)
    assert after["length_mm"] == pytest.approx(before["length_mm"] + 1.0)
    area = 0.25e-3 * np.pi * before["outer_diameter_mm"] ** 2
    assert after["volume_cm3"] == pytest.approx(before["volume_cm3"] + area)

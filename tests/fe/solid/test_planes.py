"""What depends on where the planes of the mesh are, in which teeth touch."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.strip import mesh

TORQUE = 5.0


@pytest.mark.slow
def test_stiffness_depends_on_the_planes(small_design, few_masters, monkeypatch):
    """11 to 13 elements over the face width: 5.8 % (tangent) and 5.7 % (secant).

    The crowned teeth touch in one or two planes, depending on where these are.
    """
    tangent, secant = [], []
    for elements in (11, 12, 13):
        monkeypatch.setattr(mesh, "FACE_WIDTH", elements / 0.5)
        model = solid_sector_model(small_design, half=True, orders=few_masters)
        assert model.strip.planes == elements + 1
        drive = SolidContinuation(model=model, ratio=small_design.ratio)
        low = drive.to_torque(drive.engage(drive.deflect()), 0.5 * TORQUE)
        low = drive.to_angle(low, 0.4 * 2 * np.pi / 42)
        high = drive.to_torque(low, TORQUE)
        assert low.outcome.ok and high.outcome.ok
        tangent.append(1.0 / high.compliance)
        secant.append(0.5 * TORQUE / (low.rotation - high.rotation))
    for values in (tangent, secant):
        assert np.ptp(values) < 0.07 * np.mean(values)


def test_compliance_is_the_slope_of_the_torsion(small_drive, loaded):
    """By central differences; the tangent leaves out that normals turn, 0.5 %."""
    near = [small_drive.to_torque(loaded, TORQUE + d) for d in (-0.02, 0.02)]
    slope = (near[0].rotation - near[1].rotation) / 0.04
    assert loaded.compliance == pytest.approx(slope, rel=6e-3)

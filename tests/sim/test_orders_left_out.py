"""Strength of harmonics, in the kinematic error and in the torque together."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from swgjoint.sim.figures.line_source import error_may_exceed, order_strength
from swgjoint.units import arcmin

STIFFNESS = 2e4


def test_strength_adds_error_and_torque(synthetic_map):
    """A ripple of the torque counts as the torsion that it causes."""
    attached = SimpleNamespace(drive=synthetic_map, stiffness=STIFFNESS)
    torsion = synthetic_map.mean_torsion(synthetic_map.ratings.rated_torque)
    error = np.hypot(*synthetic_map.kinematic_error.T)
    torque = np.hypot(*synthetic_map.coefficients(torsion, 1).T)
    assert torque[1:].max() > 0.0
    assert order_strength(attached) == pytest.approx(error + torque / STIFFNESS)


@pytest.mark.parametrize(
    ("error", "torsion", "may"),
    [(0.3, 0.3, True), (0.6, 0.0, True), (0.0, 0.6, True), (0.0, 0.4, False)],
)
def test_error_and_torque_left_out_may_raise_the_largest_error(error, torsion, may):
    """Twice their sum raises 1 arcmin of one joint above the 2 arcmin of the other."""
    left = SimpleNamespace(error=error * arcmin, torque=torsion * arcmin * STIFFNESS)
    drives = [
        SimpleNamespace(attached=SimpleNamespace(unresolved=one, stiffness=STIFFNESS))
        for one in ([left], [])
    ]
    run = SimpleNamespace(
        joints=("a", "b"), assembly=SimpleNamespace(transmissions=drives)
    )
    joints = {
        name: {"transmission_error_arcmin": {"pp": value}}
        for name, value in (("a", 1.0), ("b", 2.0))
    }
    assert error_may_exceed(run, joints) is may

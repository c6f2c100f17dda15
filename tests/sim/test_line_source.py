"""Which drives cause a line of a torque spectrum."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from swgjoint.sim.figures.left_out import _weak_harmonics
from swgjoint.sim.figures.line_source import drive_order, sharing_joints
from swgjoint.view.validity import shared_orders


def run_of(turns, orders, levels):
    """A run whose motors make the given turns at constant speeds."""
    transmissions = [
        SimpleNamespace(attached=SimpleNamespace(level=level, kept_orders=kept))
        for level, kept in zip(levels, orders, strict=True)
    ]
    return SimpleNamespace(
        joints=("a", "b", "c", "d"),
        assembly=SimpleNamespace(transmissions=transmissions),
        motor_position=np.linspace(0.0, 1.0, 9)[:, None] * 2.0 * np.pi * turns,
        steady=slice(0, 9),
    )


def test_joints_share_a_line_at_the_same_frequency():
    """Order times turns of the window agree within half a wave."""
    run = run_of(
        np.array([30.0, 30.1, -60.0, 30.0]),
        [(2.0, 4.0), (2.02, 8.0), (1.0, 4.0), (2.0, 4.0)],
        ["full", "full", "kinematic", "linear"],
    )
    # 60 waves: 2.02 x 30.1 = 60.8 is another line, 1 x 60 is not
    assert sharing_joints(run, 0, 2.0) == ["c"]
    assert sharing_joints(run, 0, 2.02) == ["b"]
    assert sharing_joints(run, 0, 4.0) == []
    assert sharing_joints(run, 2, 1.0) == ["a"]
    assert drive_order(run, 0, 2.01) == 2.0
    assert drive_order(run, 0, 3.0) is None


@pytest.mark.parametrize("level", ["full", "kinematic", "linear"])
def test_dropped_harmonics_are_named_with_their_ripple(level):
    """Stiffness times the rms of the error, relative to the rated torque."""
    transmission = SimpleNamespace(
        drive=SimpleNamespace(
            info={"tolerances": {"dropped_error_rms_rad": 1e-5}},
            ratings=SimpleNamespace(rated_torque=50.0),
        ),
        attached=SimpleNamespace(level=level, stiffness=4e4),
    )
    items = _weak_harmonics(transmission)
    if level == "linear":
        assert items == []
        return
    assert "0.034 arcmin rms" in items[0]["part"]
    assert "0.8 % of rated torque" in items[0]["reason"]
    transmission.drive.info = {}
    assert _weak_harmonics(transmission) == []


def test_each_group_of_joints_is_named_once():
    """Only orders of the own drive count, and only where a ripple is told."""

    def joint(shared, missing=None):
        lines = [
            {"drive_order": 2.0, "shared_with": shared},
            {"drive_order": None, "shared_with": ["far"]},
        ]
        return {"orders": lines, "ripple_missing": missing}

    joints = {
        "hip": joint(["knee"]),
        "knee": joint(["hip"]),
        "foot": joint([]),
        "toe": joint(["foot"], "below the noise"),
    }
    (line,) = shared_orders(joints)
    assert line.startswith("hip, knee: ")

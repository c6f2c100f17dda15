"""Tips of teeth that pass each other outside the engagement."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design

TORQUE = 20.0
"""Rated torque of the drive [N·m]."""


@pytest.fixture(scope="module")
def follow():
    """Continuation of a drive with sharp tips."""
    design = Design.load("reference-2d-involute").with_changes({"mesh.refinement": 0.5})
    model = sector_model(design, half=True)
    return Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)


@pytest.mark.fe
@pytest.mark.parametrize("kernels", ["compiled", "numpy"])
def test_equilibria_do_not_depend_on_the_way(follow, kernels, monkeypatch):
    """An eighth of an input turn at once leads to the same state as small steps.

    A tooth that had left the engagement pressed with 377 N against a tip that was 0.06
    mm above its own: the output error was 8.16 instead of -4.05 arcsec.
    """
    if kernels == "numpy":
        monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    start = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
    angle = 0.25 * pi
    pitches = angle * 122.0 / (2.0 * pi)
    # the pattern repeats after every pitch
    slow = start
    for k in range(1, 4):
        slow = follow.to_angle(slow, (pitches % 1.0) * 2.0 * pi / 122.0 * k / 3)
    fast = follow.to_angle(start, angle)
    assert slow.outcome.ok
    assert fast.outcome.ok
    errors = [
        follow.output_angle(s) - follow.input_angle(s) / follow.ratio
        for s in (slow, fast)
    ]
    assert errors[1] == pytest.approx(errors[0], abs=1e-10)
    moments = [follow.input_torque(s) for s in (slow, fast)]
    assert moments[1] == pytest.approx(moments[0], abs=1e-6)


@pytest.mark.fe
def test_contacts_are_outside_the_tip_circle(follow):
    """No tooth of the flexspline touches inside the tips of the circular spline."""
    state = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
    for angle in (0.25 * pi, 0.5 * pi):
        state = follow.to_angle(state, angle)
        assert state.outcome.ok
        touching = state.contacts.point[state.tooth_force > 0.0]
        radius = np.hypot(touching[:, 0], touching[:, 1])
        tips = follow.model.circular_spline.profile.addendum_radius
        assert len(radius) > 5
        assert radius.min() > tips

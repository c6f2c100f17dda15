"""Fields of a map against the equilibria that they come from, and others."""

from __future__ import annotations

import numpy as np
import pytest
from solved import PITCH, coarse

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.fields import flexspline_field
from swgjoint.fe.plane.shape_fields import plane_surface


@pytest.fixture(scope="module")
def design():
    """Half-circles let teeth move more."""
    return coarse("reference-2d-simplified")


ROUNDED = 1.5e-8
"""Four steps of single precision at the radius of the teeth [m]."""


@pytest.fixture(scope="module")
def shown(coarse_samples):
    """Of twelve positions."""
    assert coarse_samples.fields is not None
    return coarse_samples.fields


@pytest.fixture(scope="module")
def follow(design):
    """Follows equilibria of the whole drive."""
    return Continuation(
        model=sector_model(design, half=False, friction=False),
        ratio=design.ratio,
        layout=design.drive.layout,
    )


def compared(shown, follow, design, torque, angle):
    """Largest difference of positions [m] and stresses [Pa]; the largest of those."""
    state = follow.to_torque(follow.engage(follow.deflect()), torque)
    state = follow.to_angle(state, angle)
    assert state.outcome.ok
    surface = plane_surface(follow.model)
    field = flexspline_field(follow.model, state)
    at = shown.flexspline(design.drive.teeth_flexspline, state.rotation, angle, torque)
    mises = field.maxima[2][:, surface.nodes]
    return (
        np.abs(at.points[..., :2] - field.points[:, surface.nodes]).max(),
        np.abs(at.von_mises - mises).max(),
        mises.max(),
        at,
    )


def test_a_sampled_position_comes_back(design, shown, follow):
    """The whole drive, in the plane; tooth forces turn the output."""
    torque = float(shown.torque[-2])
    apart, missed, largest, at = compared(shown, follow, design, torque, 0.0)
    assert apart < ROUNDED
    assert missed < 1e-3 * largest
    x, y, _ = at.points.mean(axis=1).T
    moment = (x * at.tooth_force[:, 1] - y * at.tooth_force[:, 0]).sum()
    # T z_cs/z_fs, but for the arm of the contacts on the flanks
    assert moment == pytest.approx(torque * 122 / 120, rel=0.03)
    # the wave generator carries the rest
    total = at.tooth_force + at.wave_generator_force
    assert np.abs(total.sum(axis=0)).max() < 1e-3 * np.abs(at.tooth_force).sum()


def test_the_opposite_torque_is_the_mirror_image(design, shown, follow):
    """Solved on its own, not mirrored."""
    torque = float(shown.torque[1])
    assert torque < 0.0
    apart, missed, largest, _ = compared(shown, follow, design, torque, PITCH / 4.0)
    assert apart < ROUNDED
    assert missed < 1e-3 * largest


def test_positions_and_torques_between_are_near(design, shown, follow):
    """Neither angle nor torque is a sampled one."""
    torque = 0.5 * float(shown.torque[-2] + shown.torque[-1])
    angle = 3.4 * PITCH
    apart, missed, largest, _ = compared(shown, follow, design, torque, angle)
    # 1 % of the deflection, and a stress that travels over the roots
    assert apart < 1e-5
    assert missed < 0.15 * largest

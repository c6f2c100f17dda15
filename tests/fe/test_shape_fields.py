"""Fields of a map against the equilibria that they come from, and others."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from solved import PITCH, coarse

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.fields import flexspline_field
from swgjoint.fe.plane.figures.shape_fields import plane_surface
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.figures.shape_fields import solid_surface
from swgjoint.maps.root_stress import root_points, root_stress
from swgjoint.units import mm


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


def test_root_stress_is_the_principal_stress(design, shown, follow):
    """With its sign, at the root of every tooth of the whole drive."""
    torque = float(shown.torque[-2])
    state = follow.to_torque(follow.engage(follow.deflect()), torque)
    points = root_points(shown)
    nodes = plane_surface(follow.model).nodes[points]
    tensile, compressive, _ = flexspline_field(follow.model, state).maxima
    principal = np.where(tensile > compressive, tensile, -compressive)[:, nodes]
    stress = root_stress(shown)
    teeth = design.drive.teeth_flexspline
    place = 2.0 * np.pi / teeth * np.arange(teeth) + state.rotation
    loads = np.full(teeth, torque)
    largest = np.abs(principal).max()
    free = 0.0
    for k in range(len(points)):
        own = stress.evaluate_at(place, loads, k)
        clear = np.abs(principal[:, k]) > 0.2 * largest
        assert np.array_equal(np.sign(own[clear]), np.sign(principal[clear, k]))
        free = max(free, float(np.abs(own - principal[:, k]).max()))
    # a load on a flank adds a second principal stress at the top of the fillet
    assert free < 0.1 * largest


def test_root_points_of_a_cup():
    """At both edges of the face width, from the root land up to a quarter tooth."""
    design = coarse("reference-3d")
    surface = solid_surface(solid_sector_model(design, half=True))

    points = surface.points[root_points(SimpleNamespace(points=surface.points))]
    land = design.flexspline_inner_radius + design.flexspline.rim_mm * mm
    height = np.hypot(*surface.points[:, :2].T).max() - land
    radius = np.hypot(*points[:, :2].T)
    assert radius.min() == pytest.approx(land, rel=1e-6)
    assert land + 0.05 * height < radius.max() <= land + 0.25 * height
    # both edges of the face width, none of the rows of the cup
    assert np.ptp(points[:, 2]) == pytest.approx(design.drive.face_width_mm * mm)
    assert len(set(points[:, 2].round(9))) == 2

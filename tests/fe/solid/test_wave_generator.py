"""Surface of the wave generator: crowning, slope and their gradients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.solid.wave_generator.surface import WaveGeneratorSurface, crown
from swgjoint.gear.design.design import Design

ALPHA = 0.7


def surface(**changes):
    return WaveGeneratorSurface.from_design(
        Design.load("reference-3d-modified").with_changes(**changes)
    )


def points():
    """Around the bore, inside and outside the surface, over the whole width."""
    rng = np.random.default_rng(1)
    phi, radius = rng.uniform(0, 2 * np.pi, 40), rng.uniform(56e-3, 61e-3, 40)
    z = rng.uniform(-5.2e-3, 5.2e-3, 40)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=-1)


@pytest.mark.parametrize("error", [0.0, 50.0])
@pytest.mark.parametrize("kind", ["parabolic", "circular"])
def test_gradient_of_the_gap(kind, error):
    """Against central differences in x, y and z; round and centred, and not."""
    found = surface(
        micro_geometry__crowning_kind=kind,
        tolerances__wave_generator_eccentricity_um=error,
        tolerances__wave_generator_ovality_um=error,
    )
    _, gradient, _ = found.gap(points(), ALPHA)
    h = 1e-8
    for axis in range(3):
        step = h * np.eye(3)[axis]
        by = found.gap(points() + step, ALPHA)[0] - found.gap(points() - step, ALPHA)[0]
        assert gradient[:, axis] == pytest.approx(by / (2 * h), abs=1e-6)


def on_axes(found, z):
    """Points of the plain outline at the major and the minor axis, at three z."""
    plain = replace(found, crowning=0.0, slope=0.0)
    result = []
    for direction in ([0.0, 1.0], [1.0, 0.0]):
        point = np.array([*(0.058 * np.array(direction)), 0.0])[None]
        for _ in range(30):
            gap, normal, _ = plain.gap(point, 0.0)
            point = point - gap[:, None] * normal
        result.append(np.array([[*point[0, :2], k] for k in z]))
    return result


@pytest.mark.parametrize("kind", ["parabolic", "circular"])
def test_edges_lie_as_far_below_as_the_design_says(kind):
    """Crowning 100 at both edges; slope raises the open edge at the major axis by 90.

    At the minor axis the slope has the other sign; the middle stays where it is.
    """
    found = surface(micro_geometry__crowning_kind=kind)
    major, minor = on_axes(found, [-5e-3, 0.0, 5e-3])
    # a gap is positive outside the surface: raised by 90, lowered by 100
    assert found.gap(major, 0.0)[0] == pytest.approx([10e-6, 0, 190e-6], abs=1e-10)
    assert found.gap(minor, 0.0)[0] == pytest.approx([190e-6, 0, 10e-6], abs=1e-10)


def test_circular_crowning_is_an_arc():
    """All points at one distance from a centre; flatter than the parabola inside."""
    z = np.linspace(-5e-3, 5e-3, 11)
    depth, slope = crown(z, 1e-3, 10e-3, circular=True)
    radius = (25e-6 + 1e-6) / 2e-3
    assert np.hypot(z, radius - depth) == pytest.approx(np.full(11, radius))
    parabola, steep = crown(z, 1e-3, 10e-3, circular=False)
    assert depth[[0, -1]] == pytest.approx(parabola[[0, -1]])
    assert (depth[1:5] < parabola[1:5]).all()
    assert np.sign(slope) == pytest.approx(np.sign(steep))


def test_surface_turns_with_its_angle():
    """The gap of points that turn along stays."""
    found = surface()
    cos, sin = np.cos(ALPHA), np.sin(ALPHA)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    at_rest, normal, _ = found.gap(points(), 0.0)
    turned, normals, _ = found.gap(points() @ turn.T, ALPHA)
    assert turned == pytest.approx(at_rest, abs=1e-15)
    assert normals == pytest.approx(normal @ turn.T, abs=1e-12)


def test_eccentric_surface_is_the_centred_one_moved():
    """By its offset, which turns with it."""
    eccentric = surface(tolerances__wave_generator_eccentricity_um=50.0)
    assert eccentric.offset is not None
    centred = replace(eccentric, offset=None)
    moved = points()
    moved[:, :2] += rotate(eccentric.offset, ALPHA)
    gap, gradient, curvature = eccentric.gap(moved, ALPHA)
    wanted = centred.gap(points(), ALPHA)
    assert gap == pytest.approx(wanted[0], abs=1e-14)
    assert gradient == pytest.approx(wanted[1], abs=1e-9)
    assert curvature == pytest.approx(wanted[2], rel=1e-9)

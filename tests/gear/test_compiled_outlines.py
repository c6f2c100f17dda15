"""Compiled distance from an ellipse against the numpy code and a closed form."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.wave_generators.ellipse import Elliptical
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)


@pytest.mark.parametrize("minor", [1.0, 0.98, 0.5, 0.1])
def test_distances_are_those_of_numpy(monkeypatch, minor):
    """Inside, outside, on the axes, at the centre and at the evolute's cusps."""
    outline = Elliptical(major=0.03, minor=0.03 * minor)
    rng = np.random.default_rng(3)
    axis = np.linspace(-0.05, 0.05, 101)
    still = np.zeros_like(axis)
    points = np.concatenate(
        [
            rng.uniform(-0.05, 0.05, (4000, 2)),
            outline.evaluate(np.linspace(0.0, outline.perimeter, 500))[0],
            np.stack([axis, still], -1),
            np.stack([still, axis], -1),
        ]
    )
    distance, normal, curvature = outline.signed_distance(points)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    wanted = outline.signed_distance(points)
    np.testing.assert_allclose(distance, wanted[0], rtol=0.0, atol=1e-15)
    # the foot of a point on the inner part of the minor axis is not unique
    off = (np.abs(points) > 1e-12).all(axis=1)
    np.testing.assert_allclose(normal[off], wanted[1][off], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(curvature[off], wanted[2][off], rtol=1e-10)


def test_distance_from_a_circle():
    """Radius of the point less that of the circle."""
    points = np.random.default_rng(5).uniform(-0.05, 0.05, (1000, 2))
    circle = Elliptical(major=0.03, minor=0.03)
    distance, normal, curvature = circle.signed_distance(points)
    radius = np.hypot(*points.T)
    np.testing.assert_allclose(distance, radius - 0.03, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(normal, points / radius[:, None], atol=1e-14)
    np.testing.assert_allclose(curvature, 1.0 / 0.03, rtol=1e-14)

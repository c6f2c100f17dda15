"""Wave generators: axes, distance to the outline, curvature."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.cup import cup_torsional_stiffness
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import wave_generator

NAMES = ("reference-2d", "reference-2d-simplified")


@pytest.mark.parametrize(("name", "minor"), [(NAMES[0], 57.2), (NAMES[1], 55.484)])
def test_axes(name, minor):
    """Major axis 59.2 mm, minor axis C (58.2 - 1) mm."""
    wg = wave_generator(Design.load(name))
    x, y = np.abs(wg.outline(4001)).max(axis=0)
    assert y == pytest.approx(59.2e-3, rel=1e-6)
    assert x == pytest.approx(minor * 1e-3, rel=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_distance_is_that_to_the_nearest_point(name):
    """Signed distance against the nearest of many points; gradient is the normal."""
    wg = wave_generator(Design.load(name))
    rng = np.random.default_rng(2)
    angle = rng.uniform(0, 2 * np.pi, 30)
    points = rng.uniform(0.05, 0.062, 30)[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=-1
    )
    points[:4] = [[0, 0.059], [0.058, 0], [0, -0.06], [-0.056, 0]]  # on the axes
    gap, normal, _ = wg.signed_distance(points)
    outline = wg.outline(200_001)
    nearest = np.array([np.hypot(*(outline - p).T).min() for p in points])
    assert np.abs(gap) == pytest.approx(nearest, abs=2e-9)
    h = 1e-7
    for axis in range(2):
        step = np.zeros(2)
        step[axis] = h
        slope = (
            wg.signed_distance(points + step)[0] - wg.signed_distance(points - step)[0]
        ) / (2 * h)
        assert slope == pytest.approx(normal[:, axis], abs=1e-6)
    assert (gap[np.hypot(*points.T) > 0.0593] > 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_curvature_integrates_to_a_full_turn(name):
    """The curvature along the closed outline sums up to 2 pi."""
    wg = wave_generator(Design.load(name))
    outline = wg.outline(20_001)
    middle = 0.5 * (outline[1:] + outline[:-1])
    length = np.hypot(*np.diff(outline, axis=0).T)
    _, _, curvature = wg.signed_distance(middle)
    assert np.sum(curvature * length) == pytest.approx(2 * np.pi, rel=1e-3)


def test_cup_is_cylinder_and_diaphragm_in_series():
    """A cup of 40 mm: 2 pi G r^3 t/L and 4 pi G t/(1/b^2 - 1/r^2), by hand."""
    design = Design.load(NAMES[0]).with_changes(
        {
            "cup": {
                "length_mm": 40.0,
                "thickness_coefficient": 0.8,
                "fillet_mm": 2.0,
                "bore_radius_mm": 20.0,
            }
        }
    )
    shear, wall, r = 210e9 / (2 * 1.29), 0.8e-3, 58.6e-3
    cylinder = 2 * np.pi * shear * r**3 * wall / 0.04
    plate = 4 * np.pi * shear * wall / (1 / 0.02**2 - 1 / r**2)
    assert cup_torsional_stiffness(design) == pytest.approx(
        1 / (1 / cylinder + 1 / plate), rel=1e-12
    )

"""Wave generators that are not quite as drawn."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import flawed_wave_generator
from swgjoint.gear.wave_generators.oval import Oval
from swgjoint.gear.wave_generators.wave_generator import wave_generator

NAMES = ("reference-2d", "reference-2d-simplified", "reference-2d-parabolic")


def ring_of(outline, gap, count=400):
    """Points at a distance from an outline and their places on it."""
    s = np.linspace(0.0, outline.perimeter, count, endpoint=False)
    points, normals, _ = outline.evaluate(s)
    return points + gap * normals


@pytest.mark.parametrize("name", NAMES)
def test_deviation_has_the_given_range(name):
    """Points of the nominal outline: largest minus smallest distance is the key."""
    design = Design.preset(name).with_changes(
        {"tolerances.wave_generator_ovality_um": 8.0}
    )
    outline = flawed_wave_generator(design)
    nominal = wave_generator(design)
    distance, _, _ = outline.signed_distance(ring_of(nominal, 0.0))
    assert np.ptp(distance) == pytest.approx(8e-6, rel=1e-3)
    assert np.abs(distance).max() == pytest.approx(4e-6, rel=1e-3)
    # its own points are on it
    distance, _, _ = outline.signed_distance(ring_of(outline, 0.0))
    assert np.abs(distance).max() < 1e-11


@pytest.mark.parametrize("name", NAMES)
def test_normal_is_the_gradient_of_the_distance(name):
    """In both directions, on and above the outline, also of the deviation alone."""
    nominal = wave_generator(Design.preset(name))
    outline = Oval(nominal=nominal, ovality=20e-6, angle=0.4)
    for gap in (0.0, 1e-4):
        points, step = ring_of(nominal, gap), 1e-6
        _, normal, _ = outline.signed_distance(points)
        _, straight, _ = nominal.signed_distance(points)
        for axis in np.eye(2):
            ends = [
                outline.signed_distance(points + side * step * axis)[0]
                - nominal.signed_distance(points + side * step * axis)[0]
                for side in (1.0, -1.0)
            ]
            slope = (ends[0] - ends[1]) / (2.0 * step)
            found = (normal - straight) @ axis
            assert np.abs(slope).max() > 1e-4
            # kinks of curvature of the nominal outline jump within a step
            assert np.quantile(np.abs(found - slope), 0.95) < 2e-6


def test_seed_turns_the_ovality():
    """The same size at another angle; without the key the nominal outline."""
    design = Design.preset("reference-2d")
    assert type(flawed_wave_generator(design)) is type(wave_generator(design))
    angles = []
    for seed in (1, 2):
        changes = {
            "tolerances.wave_generator_ovality_um": 5.0,
            "tolerances.seed": seed,
        }
        outline = flawed_wave_generator(design.with_changes(changes))
        assert isinstance(outline, Oval) and outline.folds == 2
        angles.append(outline.angle)
    assert abs(angles[0] - angles[1]) > 0.01

"""Manufacturing errors of the teeth as numbers."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import (
    has_errors,
    tooth_errors,
    wave_generator_offset,
)


def errors(member="circular_spline", **values):
    changes = {f"tolerances.{key}": value for key, value in values.items()}
    return tooth_errors(Design.preset("reference-2d").with_changes(changes), member)


def spectrum(values):
    return np.abs(np.fft.rfft(values)) / values.size * 2.0


def test_cumulative_pitch_error_is_peak_to_peak_of_four_harmonics():
    """Harmonics 1 to 4 with amplitudes 1/k, scaled to the key, for either member."""
    for member in ("flexspline", "circular_spline"):
        found = errors(member, **{f"{member}_cumulative_pitch_um": 10.0})
        assert np.ptp(found.tangential) == pytest.approx(10e-6)
        orders = spectrum(found.tangential)
        assert orders[1:5] == pytest.approx(orders[1] / np.arange(1, 5))
        assert orders[5:].max() < 1e-9 * orders[1]
        assert not found.radial.any()


def test_eccentricity_is_a_translation_and_ovality_a_second_harmonic():
    """Every tooth moves by the same vector; radii differ by the key."""
    found = errors(circular_spline_eccentricity_um=5.0)
    angle = 2.0 * np.pi / 122 * np.arange(122)
    x = -found.radial * np.sin(angle) - found.tangential * np.cos(angle)
    y = found.radial * np.cos(angle) - found.tangential * np.sin(angle)
    assert np.ptp(x) < 1e-18 and np.ptp(y) < 1e-18
    assert np.hypot(x[0], y[0]) == pytest.approx(5e-6)
    # the shift in the frames of the teeth is the same vector, turned to each of them
    sine, cosine = np.sin(angle), np.cos(angle)
    assert found.shift[:, 0] == pytest.approx(cosine * x + sine * y, abs=1e-18)
    assert found.shift[:, 1] == pytest.approx(cosine * y - sine * x, abs=1e-18)
    oval = spectrum(errors(circular_spline_ovality_um=6.0).radial)
    assert oval[2] == pytest.approx(3e-6) and np.delete(oval, 2).max() < 1e-18


def test_random_part_has_the_given_deviation_and_no_mean():
    """Its scatter is the key; the members and the seeds differ; a seed repeats."""
    one, two = errors(random_pitch_um=2.0), errors("flexspline", random_pitch_um=2.0)
    assert one.tangential.std() == pytest.approx(2e-6, rel=0.2)
    assert abs(one.tangential.mean()) < 1e-18
    assert not np.allclose(one.tangential[:120], two.tangential, atol=1e-7)
    other = errors(random_pitch_um=2.0, seed=2)
    assert not np.allclose(one.tangential, other.tangential, atol=1e-7)
    again = errors(random_pitch_um=2.0)
    assert np.array_equal(one.tangential, again.tangential)


def test_a_key_does_not_change_what_the_others_are():
    """Errors add up; the streams of the seed are their own."""
    both = errors(random_pitch_um=2.0, circular_spline_cumulative_pitch_um=10.0)
    alone = [
        errors(random_pitch_um=2.0),
        errors(circular_spline_cumulative_pitch_um=10.0),
    ]
    total = alone[0].tangential + alone[1].tangential
    assert both.tangential == pytest.approx(total, abs=1e-20)


def test_a_perfect_design_has_none():
    """No errors, no offset."""
    perfect = Design.preset("reference-2d")
    assert not has_errors(perfect)
    assert not tooth_errors(perfect, "circular_spline").shift.any()
    assert not wave_generator_offset(perfect).any()
    tilted = perfect.with_changes({"tolerances.wave_generator_eccentricity_um": 3.0})
    assert has_errors(tilted)
    assert np.hypot(*wave_generator_offset(tilted)) == pytest.approx(3e-6)

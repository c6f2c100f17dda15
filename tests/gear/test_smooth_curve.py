"""Smooth pieces of a flank: their polynomials against the textbook form."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.smooth_curve import SmoothCurve
from swgjoint.gear.teeth.tooth_profile import tooth_profile


def curves():
    profile = tooth_profile(Design.load("dca-80-to-1"), "circular_spline")
    return [part for part in profile.segments if isinstance(part, SmoothCurve)]


@pytest.mark.parametrize("count", [1, 7, 300])
def test_points_and_derivatives_are_those_of_the_plain_scheme_bit_for_bit(count):
    """Horner's scheme and its derivatives point by point, zeros included."""
    for curve in curves():
        s = np.random.default_rng(5).uniform(0.0, curve.length, count)
        s[0] = curve.length
        wanted = np.empty((3, count, 2))
        for i, at in enumerate(s):
            k = int(np.searchsorted(curve.stations[1:-1], at, side="right"))
            h = curve.stations[k + 1] - curve.stations[k]
            t = (at - curve.stations[k]) / h
            value, first, second = curve.coefficients[k, 5], np.zeros(2), np.zeros(2)
            for j in (4, 3, 2, 1, 0):
                second = second * t + 2.0 * first
                first = first * t + value
                value = value * t + curve.coefficients[k, j]
            wanted[:, i] = value, first / h, second / h**2
        found = np.array(curve._derivatives(s))
        assert np.array_equal(found, wanted)


def test_derivatives_are_those_of_the_points():
    """Central differences of the points give the tangent, those of it the bend."""
    for curve in curves():
        s = np.linspace(0.05, 0.95, 40) * curve.length
        step = 1e-5 * curve.length
        before, _, after = (curve._derivatives(s + d) for d in (-step, 0.0, step))
        _, tangent, bend = curve._derivatives(s)
        for low, high, slope in (
            (before[0], after[0], tangent),
            (before[1], after[1], bend),
        ):
            scale = np.abs(slope).max()
            assert np.abs((high - low) / (2.0 * step) - slope).max() < 1e-5 * scale

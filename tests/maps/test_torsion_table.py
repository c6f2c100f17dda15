"""Curves over torsion carried to common knots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BPoly

from swgjoint.maps.fit.torsion_table import interpolate_on_knots

KNOTS = np.linspace(-1.2, 1.2, 9)


def test_agrees_with_scipy_inside():
    """Quintic Hermite pieces, every curve with its own torsions."""
    rng = np.random.default_rng(2)
    x = np.sort(rng.uniform(-1.4, 1.4, (6, 5)), axis=0)
    x[0], x[-1] = -1.5, 1.5
    data = rng.standard_normal((3, 6, 5))
    found = interpolate_on_knots(x, data, KNOTS)
    for k in range(5):
        curve = BPoly.from_derivatives(x[:, k], data[:, :, k].T)
        for order in range(3):
            wanted = curve(KNOTS, order)
            scale = np.abs(wanted).max()
            assert found[k, order] == pytest.approx(wanted, abs=1e-12 * scale)


def test_continues_as_a_parabola_of_the_mean_bend():
    """Beyond the ends value and slope go on; the bend is that of all curves."""
    x = np.array([[-1.0, -0.6], [0.0, 0.0], [1.0, 0.6]])
    bend = np.array([2.0, 4.0])
    data = np.stack([0.5 * bend * x**2, bend * x, np.broadcast_to(bend, x.shape)])
    found = interpolate_on_knots(x, data, np.array([-1.2, 1.2]))
    for k, (end, stiff) in enumerate(zip(x[-1], bend, strict=True)):
        out, slope = 1.2 - end, stiff * end
        value = 0.5 * stiff * end**2 + slope * out + 0.5 * 3.0 * out**2
        assert found[k, 0] == pytest.approx([value, value])
        assert found[k, 1] == pytest.approx([-slope - 3.0 * out, slope + 3.0 * out])
        assert found[k, 2] == pytest.approx([3.0, 3.0])

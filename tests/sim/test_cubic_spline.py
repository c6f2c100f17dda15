"""Cubic splines through samples."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from swgjoint.sim.figures.cubic_spline import interpolate_cubic


@pytest.mark.parametrize("decades", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("count", [5, 6, 40, 3000])
@pytest.mark.parametrize("kernels", ["compiled", "numpy"])
def test_a_spline_is_that_of_scipy(decades, count, kernels, monkeypatch):
    """To round-off, also for spacings that differ a hundredfold, and at the ends."""
    monkeypatch.setenv("SWGJOINT_KERNELS", kernels)
    rng = np.random.default_rng(count)
    x = np.cumsum(10.0 ** rng.uniform(0.0, decades, count))
    y = rng.normal(size=count)
    at = np.concatenate([x, np.linspace(x[0], x[-1], 2000)])
    wanted = CubicSpline(x, y)(at)
    found = interpolate_cubic(x, y, at)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-12 * np.ptp(wanted))


def test_a_spline_of_a_cubic_is_the_cubic():
    """Uneven samples; third derivatives do not jump anywhere."""
    rng = np.random.default_rng(1)
    x = np.sort(rng.uniform(-2.0, 2.0, 30))
    at = rng.uniform(x[0], x[-1], 500)
    cubic = np.polynomial.Polynomial([0.3, -1.0, 0.5, 2.0])
    np.testing.assert_allclose(
        interpolate_cubic(x, cubic(x), at), cubic(at), atol=1e-12
    )

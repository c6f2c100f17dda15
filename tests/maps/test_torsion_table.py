"""Curves over torsion carried to common knots."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BPoly

from swgjoint.maps.fit.torsion_table import (
    BETWEEN,
    interpolate_on_knots,
    refine_over_torque,
)

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


def softened(torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torsion and curve of drives whose compliance is largest at a torque of 2.

    Up to a torque of 1 the compliance is 1, from there to 3 it is a parabola.
    """
    size, sign = np.abs(torque)[:, None], np.sign(torque)[:, None]
    beyond = np.maximum(size - 1.0, 0.0)
    most = np.array([0.5, 4.0])
    compliance = 1.0 + most * beyond * (2.0 - beyond)
    torsion = size + most * (beyond**2 - beyond**3 / 3.0)
    potential = 0.5 * size**2 + most * (beyond**3 / 3.0 - beyond**4 / 12.0)
    energy = size * torsion - potential
    load = np.broadcast_to(torque[:, None], energy.shape)
    return sign * torsion, np.stack([energy, load, 1.0 / compliance])


def test_a_soft_range_between_two_torques_is_followed():
    """Points between the torques are exact; the torque at knots nearly so."""
    torque = np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    x, curve = softened(torque)
    refined, found = refine_over_torque(x, curve)
    assert len(refined) == torque.size + 2 * BETWEEN
    wanted_x, wanted = softened(found[1, :, 0])
    assert refined == pytest.approx(wanted_x, abs=1e-12)
    assert found == pytest.approx(wanted, abs=1e-12)
    dense_x, dense = softened(np.linspace(1.0, 3.0, 400))
    knots = np.linspace(1.2, 6.0, 9)
    for k, most in enumerate((5e-3, 5e-2)):
        inside = knots[knots < dense_x[-1, k]]
        exact = np.interp(inside, dense_x[:, k], dense[1, :, k])
        wrong = [
            np.abs(interpolate_on_knots(a, b, inside)[k, 1] - exact).max()
            for a, b in ((refined, found), (x, curve))
        ]
        assert wrong[0] < most and wrong[0] < 0.3 * wrong[1]


def test_a_curve_that_would_turn_back_stays_as_it_was():
    """Two soft ends of a stiff interval: a cubic compliance would be negative."""
    torque = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    x = torque[:, None] * np.ones(2)
    bend = np.ones_like(x)
    bend[3:, 0] = 0.05
    load = np.broadcast_to(torque[:, None], x.shape)
    curve = np.stack([0.5 * x**2, load, bend])
    refined, found = refine_over_torque(x, curve)
    assert (np.diff(refined, axis=0) > 0.0).all() and (found[2] > 0.0).all()
    knots = np.linspace(-1.9, 1.9, 21)
    before = interpolate_on_knots(x, curve, knots)
    after = interpolate_on_knots(refined, found, knots)
    assert after == pytest.approx(before, rel=1e-9, abs=1e-9)

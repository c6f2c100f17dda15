"""Upper bounds of sums of harmonics: above every value, and close to the largest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.maps import phase_bounds
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.phase_bounds import (
    largest_sums,
    largest_total,
    max_stiffness,
    stiffness_range,
)


def random_orders(rng, count):
    """Different orders (p, q), none of them the opposite of another one."""
    orders = np.stack(np.meshgrid(np.arange(1, 60), np.arange(-40, 41)), -1)
    return rng.permutation(orders.reshape(-1, 2))[:count]


def values_at(orders, amplitudes, angles):
    """Sums at pairs of angles (n_angles, m)."""
    phase = angles @ orders.T
    return np.cos(phase) @ amplitudes[..., 0].T + np.sin(phase) @ amplitudes[..., 1].T


@pytest.mark.parametrize("sums", [1, 2, 5])
def test_the_bound_of_many_harmonics_holds_and_is_close(sums):
    """It exceeds the largest of 20 000 values, by less than half of the sum's bound."""
    rng = np.random.default_rng(sums)
    orders = random_orders(rng, 1500)
    amplitudes = rng.normal(size=(sums, 1500, 2))
    bounds = largest_sums(orders, amplitudes)
    angles = rng.uniform(0.0, 2.0 * np.pi, (20_000, 2))
    found = np.abs(values_at(orders, amplitudes, angles)).max(axis=0)
    assert (found <= bounds).all()
    # random angles miss the maximum by up to a quarter
    assert (bounds <= 1.8 * found).all()
    assert (bounds < 0.2 * np.hypot(*np.moveaxis(amplitudes, -1, 0)).sum(axis=1)).all()


def test_equal_phases_reach_the_bound():
    """Cosines have their sum at zero angles, which is a point of the grid."""
    orders = random_orders(np.random.default_rng(0), 400)
    amplitudes = np.zeros((1, 400, 2))
    amplitudes[..., 0] = np.arange(1.0, 401.0)
    assert largest_sums(orders, amplitudes) == pytest.approx([400 * 401 / 2], rel=1e-12)


def test_a_harmonic_may_be_written_with_the_opposite_orders():
    """Its sine then has the other sign; the bounds remain the same."""
    rng = np.random.default_rng(2)
    orders, amplitudes = random_orders(rng, 300), rng.normal(size=(3, 300, 2))
    sign = rng.choice([-1, 1], 300)
    turned = amplitudes * np.stack([np.ones(300), sign], axis=-1)
    wanted = largest_sums(orders, amplitudes)
    found = largest_sums(sign[:, None] * orders, turned)
    assert found == pytest.approx(wanted, rel=1e-13)
    # without the change of sign it is another sum
    other = largest_sums(sign[:, None] * orders, amplitudes)
    assert np.abs(other / wanted - 1.0).max() > 1e-3


def test_few_harmonics_are_bounded_by_their_amplitudes():
    """As many as the limit: 3, 4, 5 per harmonic."""
    orders = random_orders(np.random.default_rng(0), phase_bounds.MANY)
    amplitudes = np.tile([3.0, 4.0], (2, phase_bounds.MANY, 1))
    assert largest_sums(orders, amplitudes) == pytest.approx(5.0 * phase_bounds.MANY)
    assert largest_sums(orders[:0], amplitudes[:, :0]).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("count", [phase_bounds.MANY, 900])
@pytest.mark.parametrize("spread", [0.0, 0.1, 1.0, 10.0])
def test_the_largest_total_is_that_of_all_bounds(count, spread, monkeypatch):
    """Whether the constants or the sums decide; bounds of few sums are evaluated."""
    rng = np.random.default_rng(int(10 * spread) + count)
    orders = random_orders(rng, count)
    sums = 40
    amplitudes = rng.normal(size=(sums, count, 2))
    amplitudes *= rng.uniform(0.3, 1.0, (sums, 1, 1))
    bounds = largest_sums(orders, amplitudes)
    constants = spread * bounds.mean() * rng.normal(size=sums)
    evaluated = []

    def counted(orders, amplitudes):
        evaluated.append(len(amplitudes))
        return largest_sums(orders, amplitudes)

    monkeypatch.setattr(phase_bounds, "largest_sums", counted)
    found = largest_total(orders, amplitudes, constants)
    assert found == pytest.approx((constants + bounds).max(), rel=1e-14)
    assert sum(evaluated) < sums or count == phase_bounds.MANY


def test_a_total_up_to_enough_may_be_too_large():
    """Above it, the result is the same bit for bit; few bounds are evaluated below."""
    rng = np.random.default_rng(5)
    orders, amplitudes = random_orders(rng, 900), rng.normal(size=(40, 900, 2))
    amplitudes *= np.linspace(0.1, 1.0, 40)[:, None, None]
    constants = rng.normal(size=40)
    wanted = largest_total(orders, amplitudes, constants)
    by_amplitudes = np.hypot(*np.moveaxis(amplitudes, -1, 0)).sum(axis=-1).max() + 9.0
    for enough in (0.0, 0.5 * wanted, 0.999 * wanted):
        found = largest_total(orders, amplitudes, constants, enough=enough)
        assert found == wanted
    for enough in (wanted, 2.0 * wanted, by_amplitudes):
        found = largest_total(orders, amplitudes, constants, enough=enough)
        assert wanted <= found <= enough


def test_stiffness_of_many_harmonics_is_bounded():
    """At random torsions and phases, with harmonics that change the stiffness."""
    rng, count = np.random.default_rng(3), 300
    linear = DriveMap.linear(1e4, rated_torque=50.0)
    knots = np.linspace(-0.01, 0.01, 5)
    potential = 1e-5 * rng.normal(size=(count + 1, 2, 4, 5))
    potential *= np.array([0.0, 0.0, 1e6, 1e8, 1e10])
    potential[0] = [0.0, 0.0, 5e3, 0.0, 0.0]
    ends = 10.0 * rng.normal(size=(count + 1, 2, 2))
    ends[0] = [[1e4, 1e4], [0.0, 0.0]]
    drive = replace(
        linear,
        torsion_knots=knots,
        orders=np.concatenate([[[0, 0]], random_orders(rng, count)]),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=np.zeros((count + 1, 2)),
    )
    low, high = stiffness_range(drive)
    theta, psi = rng.uniform(0.0, 600.0, (2, 4000))
    found = drive.stiffness(rng.uniform(-0.01, 0.01, 4000), theta, psi)
    assert low <= found.min() and found.max() <= high
    assert high - low < 3.0 * np.ptp(found)
    assert drive.stiffness(np.tile(knots, 800), theta, psi).max() <= drive.max_stiffness
    assert drive.max_stiffness <= high
    for enough in (0.9, 1.0, 1.5, 9.0):
        enough *= drive.max_stiffness
        bound = max_stiffness(drive, enough=enough)
        assert drive.max_stiffness <= bound <= max(enough, drive.max_stiffness)

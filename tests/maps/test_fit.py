"""Fitting a potential: a known one comes back, unseen torques agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from known_samples import N, samples_of

from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.fit.fit_checks import stiffness_range
from swgjoint.maps.quartic import quartic_chain


def test_known_potential_comes_back():
    """Unseen input torque within 0.5 % of its ripple, residuals small."""
    samples = samples_of()
    drive = fit_map(samples)
    assert drive.info["energy_check"]["relative"] < 5e-3
    assert drive.info["residual"]["torque_Nm"] < 5e-3
    assert drive.info["residual"]["kinematic_error_rad"] < 1e-12
    assert drive.info["stiffness_range_Nm_rad"][0] > 0.0
    # the mean curve: K x (1 + 2 h x^2)
    x = 0.7 * drive.torsion_knots[-1]
    expected = 2e4 * x * (1 + 8e4 * x**2)
    assert drive.coefficients(x, 1)[0, 0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("keep", [0.0, 0.01])
def test_stiffness_range_covers_a_pitch(keep):
    """Least half a pitch after its largest, however many harmonics are kept."""
    drive = fit_map(samples_of(), keep=keep)
    low, high = drive.info["stiffness_range_Nm_rad"]
    largest = np.abs(drive.torsion_knots[[0, -1]]).max()
    assert low == pytest.approx(2e4 * (1.0 - 0.1), rel=0.01)
    assert high == pytest.approx(2e4 * (1 + 24e4 * largest**2) * (1 + 0.1), rel=0.02)


@pytest.mark.parametrize("too_much", [0.15, 0.2, -0.2])
def test_stiffness_range_covers_all_torsions(synthetic_map, too_much):
    """One interval stores more or less energy than its torques: its stiffness swings.

    At the breakpoints, the torque grows.
    """
    stiffness, knots = 2e4, np.linspace(-5e-3, 5e-3, 5)
    width = knots[1] - knots[0]
    energy = 0.5 * stiffness * knots**2
    energy[knots > 0.5 * width] += too_much * stiffness * width**2
    data = np.stack([energy, stiffness * knots, np.full_like(knots, stiffness)])
    breaks, chain = quartic_chain(knots, data)
    assert (np.diff(chain[:, 1]) > 0.0).all()
    drive = replace(
        synthetic_map.with_harmonics([False] * len(synthetic_map.orders)),
        torsion_knots=breaks,
        potential=np.stack([chain, 0.0 * chain])[None],
    )
    dense = drive.coefficients(np.linspace(knots[0], knots[-1], 20_001), 2)[..., 0, 0]
    low, high = stiffness_range(drive)
    assert (low < 0.0) == (abs(too_much) > 0.16)
    np.testing.assert_allclose([low, high], [dense.min(), dense.max()], rtol=1e-3)


def test_integration_constant_is_the_cogging_energy():
    """Without load the input feels the derivative of the strain energy."""
    drive = fit_map(samples_of(error=0.0, cogging=2e-6, swing=0.0), keep=1e-6)
    theta = np.linspace(0, 2 * np.pi / N, 50)
    psi = theta / drive.ratio
    on_input, on_output = drive.forces(theta, psi)
    assert -on_input == pytest.approx(4e-6 * N * np.cos(2 * N * theta), rel=1e-6)
    assert np.abs(on_output).max() < 1e-9


def test_threshold_drops_small_harmonics_and_says_so():
    """A high threshold keeps the largest harmonic only; the record lists the rest."""
    full, sparse = fit_map(samples_of(), keep=0.0), fit_map(samples_of(), keep=0.9)
    assert len(sparse.orders) < len(full.orders)
    listed = sparse.info["harmonics"]
    assert len(listed) == len(full.orders)
    assert sum(h["kept"] for h in listed) == len(sparse.orders)
    assert sparse.info["residual"]["kinematic_error_rad"] > 0.0


def test_continuation_is_stable():
    """Beyond the sampled range the stiffness stays positive at every angle."""
    drive = fit_map(samples_of(swing=0.3))
    far = 3 * drive.torsion_knots[[0, -1]][:, None]
    theta = np.linspace(0, 2 * np.pi / N, 40)
    assert (drive.stiffness(far, theta, theta / drive.ratio) > 0).all()


def test_quartic_chain_meets_its_data():
    """Value, slope and second derivative at uneven knots, C2 in the middles."""
    knots = np.array([0.0, 0.3, 0.5, 1.1])
    data = np.stack([np.exp(knots)] * 3)
    breaks, coefficients = quartic_chain(knots, data)
    pieces = [np.polynomial.Polynomial(c) for c in coefficients]
    for k, piece in enumerate(pieces):
        h = breaks[k + 1] - breaks[k]
        for order in range(3):
            part = piece.deriv(order) if order else piece
            if k + 1 < len(pieces):
                after = pieces[k + 1].deriv(order) if order else pieces[k + 1]
                assert part(h) == pytest.approx(after(0.0), rel=1e-12)
            if k % 2 == 0:
                assert part(0.0) == pytest.approx(np.exp(breaks[k]), rel=1e-12)
        assert piece(0.4 * h) == pytest.approx(np.exp(breaks[k] + 0.4 * h), rel=1e-3)


def test_many_quartic_chains_are_single_ones():
    """Those of two harmonics with two amplitudes, to the last bit."""
    knots = np.array([0.0, 0.3, 0.5, 1.1])
    data = np.random.default_rng(0).standard_normal((2, 2, 3, 4))
    breaks, chains = quartic_chain(knots, data)
    for mode in range(2):
        for part in range(2):
            alone = quartic_chain(knots, data[mode, part])
            assert np.array_equal(breaks, alone[0])
            assert np.array_equal(chains[mode, part], alone[1])


def test_fit_gives_a_map_that_round_trips(tmp_path):
    """The fitted map, its record included, survives its file."""
    drive = fit_map(samples_of())
    drive.save(tmp_path / "known.swg")
    again = DriveMap.load(tmp_path / "known.swg")
    assert np.array_equal(again.potential, drive.potential)
    assert again.info["energy_check"] == drive.info["energy_check"]

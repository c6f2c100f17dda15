"""Harmonics of tooth errors are left out only if they are weak together."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from swgjoint.fe.tolerances.main_harmonics import SHARE, main_harmonics

TORQUE = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
ORDERS = np.arange(3000) / 100.0


def spectrum_of(amplitudes):
    """Output error and energy of equal size at every torque, with random phases."""
    rng = np.random.default_rng(0)
    shape = (2, TORQUE.size, ORDERS.size)
    return amplitudes * np.exp(2j * np.pi * rng.uniform(size=shape))


def rms_by_octave(values, waves=None):
    """Rms of output error and input torque in four octaves from 1 on (4, n_rows)."""
    error, energy = values
    rows = np.concatenate([error, ORDERS * (energy + TORQUE[:, None] * error)])
    power = 0.5 * np.abs(rows) ** 2
    if waves is not None:
        power[:, waves] = 0.0
    edges = np.searchsorted(ORDERS, [1.0, 2.0, 4.0, 8.0, 16.0])
    parts = (slice(a, b) for a, b in pairwise(edges))
    return np.sqrt([power[:, part].sum(axis=1) for part in parts])


def test_four_hundred_weak_harmonics_next_to_a_strong_one_are_kept():
    """Each has 0.9 % of the strong one; together they are 18 % of its rms.

    Compared with the strong one alone, all of them would be left out.
    """
    amplitudes = np.zeros(ORDERS.size)
    amplitudes[1600:2000] = 0.009
    amplitudes[200] = 1.0
    waves, dropped = main_harmonics(spectrum_of(amplitudes), TORQUE, ORDERS, free=False)
    assert waves[0] == 0 and 200 in waves
    # one of ten equal harmonics may be missing: 0.31² of the power of their octave
    weak = np.count_nonzero(waves > 1000)
    assert 400 * (1.0 - SHARE**2) <= weak <= 400 * (1.0 - SHARE**2) + 1
    assert dropped == pytest.approx(0.009 * np.sqrt(0.5 * (400 - weak)))


def test_every_octave_keeps_its_rms_at_every_torque():
    """With the smallest number of harmonics: one less would exceed the share."""
    rng = np.random.default_rng(1)
    strong = np.where(ORDERS > 0.0, rng.exponential(1.0, ORDERS.size), 0.0)
    values = spectrum_of(strong * rng.uniform(0.5, 1.5, (2, TORQUE.size, ORDERS.size)))
    waves, dropped = main_harmonics(values, TORQUE, ORDERS, free=False)
    part = rms_by_octave(values, waves) / rms_by_octave(values)
    assert part.max() <= SHARE
    assert (part.max(axis=1) > 0.98 * SHARE).all()
    assert 0.3 * ORDERS.size < waves.size < 0.9 * ORDERS.size
    left = np.setdiff1d(np.arange(ORDERS.size), waves)
    rms = np.sqrt(0.5 * np.sum(np.abs(values[0][:, left]) ** 2, axis=1))
    assert dropped == pytest.approx(rms.max(), rel=1e-12)


def test_round_off_is_no_harmonic():
    """Octaves with a millionth of the strongest harmonic are left out as a whole."""
    amplitudes = np.full(ORDERS.size, 1e-9)
    amplitudes[[200, 400]] = 1.0, 1e-2
    values = spectrum_of(amplitudes)
    assert main_harmonics(values, TORQUE, ORDERS, free=False)[0].tolist() == [
        0,
        200,
        400,
    ]


def test_without_load_the_input_torque_of_a_free_output_does_not_count():
    """A harmonic of the energy at zero torque alone matters only to a held output."""
    values = np.zeros((2, TORQUE.size, ORDERS.size), dtype=complex)
    values[0, :, 200] = 1.0
    values[1, 2, 250] = 1.0
    for free, wanted in ((True, [0, 200]), (False, [0, 200, 250])):
        assert main_harmonics(values, TORQUE, ORDERS, free=free)[0].tolist() == wanted


def test_one_pitch_has_no_harmonics():
    """Errors of the wave generator alone repeat with every pitch."""
    values = np.ones((2, TORQUE.size, 1), dtype=complex)
    waves, dropped = main_harmonics(values, TORQUE, np.zeros(1), free=True)
    assert waves.tolist() == [0] and dropped == 0.0

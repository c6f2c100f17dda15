"""Ripple of a drive with tooth errors, by which errors of its pattern are judged."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.tolerances.ripple import SHARE, ripple_with_errors
from swgjoint.maps.samples import ToleranceSamples

TORQUE = np.array([-20.0, -0.1, 0.0, 0.1, 20.0])
PITCHES, PHASES, TEETH = 50, 4, 100


def samples(onsets: bool) -> ToleranceSamples:
    """An error of one wave in the cycle, which grows with the torque."""
    wave = np.cos(2.0 * np.pi * np.arange(PITCHES * PHASES) / (PITCHES * PHASES))
    error = (1.0 + 0.1 * np.abs(TORQUE))[:, None] * wave
    table = np.stack([error, np.zeros_like(error), np.ones_like(error)])
    perfect = np.ones((3, TORQUE.size, PHASES))
    return ToleranceSamples(
        pitches=PITCHES,
        phases=PHASES,
        torque=TORQUE,
        table=table,
        perfect=perfect,
        onsets=onsets,
    )


@pytest.mark.parametrize("onsets", [False, True])
def test_heights_are_a_share_of_those_with_errors(onsets):
    """The input torque is T de/dtheta; two waves per input turn, by hand."""
    ripple = ripple_with_errors(samples(onsets), TEETH)
    error, moment = ripple(np.array([-20.0, 20.0]))
    assert error == pytest.approx([6.0 * SHARE] * 2)
    # peak to peak of 20 N·m times 3 times two waves
    assert moment == pytest.approx([240.0 * SHARE] * 2, rel=1e-3)
    assert ripple(0.0)[0] == pytest.approx(2.0 * SHARE)
    # within a clearance the input torque is not known: that of the nearest torques
    assert ripple(0.0)[1] == pytest.approx(240.0 * SHARE if onsets else 0.0, rel=1e-3)


def test_any_shape_of_torques():
    """One pair of heights for a number, arrays for arrays."""
    ripple = ripple_with_errors(samples(onsets=False), TEETH)
    assert ripple(3.0).shape == (2,) and ripple(np.ones((3, 2))).shape == (2, 3, 2)

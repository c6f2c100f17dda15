"""A wave generator with three lobes, for a tooth difference of three."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from solved import coarse

from swgjoint.fe.meshing import simulate_meshing

TEETH = 120, 123
TORQUE, RATIO = 20.0, -40.0
DESIGN = {
    "drive.teeth_flexspline": TEETH[0],
    "drive.teeth_circular_spline": TEETH[1],
    "wave_generator": {"kind": "cosine"},
}


@cache
def run():
    """Twelve positions of one pitch of the circular spline."""
    design = coarse(**DESIGN)
    return simulate_meshing(design, torque=TORQUE, steps=12, turn=1 / TEETH[1])


def test_balance_and_mean_torque():
    """Moments balance at every step; the input does the output's work on average."""
    input_torque = run().series("wave_generator_torque")
    balance = run().series("tooth_moment") + input_torque - TORQUE
    assert np.abs(balance).max() < 1e-6 * TORQUE
    # trapezoidal sum of a periodic torque with kinks at twelve positions
    assert input_torque.mean() == pytest.approx(TORQUE / RATIO, rel=5e-3)


def test_lobes_carry_the_same():
    """Tooth counts are multiples of three: a third of a turn repeats all forces."""
    force = run().states[0].flank_force
    thirds = force.reshape(3, -1)
    assert np.abs(thirds).max() > 1.0
    for third in thirds[1:]:
        assert np.abs(third - thirds[0]).max() < 1e-6 * np.abs(thirds).max()

"""Torques and positions of the full solves that validate a map with tooth errors."""

from __future__ import annotations

import numpy as np
import pytest
from solved import coarse

from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.rest import influences
from swgjoint.fe.tolerances.unseen import (
    HARD,
    spread_positions,
    unseen_positions,
    unseen_torques,
)

ERRORS = {
    "tolerances.circular_spline_cumulative_pitch_um": 10.0,
    "tolerances.circular_spline_eccentricity_um": 5.0,
}


def test_torques_lie_in_the_middle_of_all_intervals():
    """Zero and the rated torque as well; nothing within a clearance."""
    levels = np.array([2.0, 6.0, 20.0])
    found = unseen_torques(levels, 12.0, has_play=False)
    assert found.tolist() == [0.0, 1.0, 4.0, 12.0, 13.0]
    assert unseen_torques(levels, 12.0, has_play=True).tolist() == [0, 4, 12, 13]


def test_half_of_the_positions_are_soft_ones_of_their_sign():
    """The others are spread over the cycle and over all phases of a pitch."""
    pitches, phases, count = 500, 6, 24
    torque = np.array([-40.0, -10.0, 0.0, 10.0, 40.0])
    table = -np.repeat(torque[:, None], pitches * phases, axis=1)
    every = np.random.default_rng(1).permutation(pitches * phases)
    share = int(HARD * every.size)
    soft = {1.0: every[:share], -1.0: every[share : 2 * share]}
    table[4, soft[1.0]] -= 50.0
    table[0, soft[-1.0]] += 50.0
    spread = spread_positions(pitches, phases, count)
    assert np.diff(np.sort(spread // phases)).max() < 1.5 * pitches / count
    assert np.unique(spread % phases).size == phases
    chosen, signs = unseen_positions(table, torque, spread)
    assert signs.sum() == 0.0
    for sign in (1.0, -1.0):
        mine = chosen[signs == sign]
        assert np.isin(mine, soft[sign]).sum() >= count // 4
        assert np.isin(mine, spread[signs == sign]).sum() == count // 4
    # with a single torque of a sign there is no interval to judge
    few, _ = unseen_positions(table[[0, 2, 4]], torque[[0, 2, 4]], spread)
    assert np.array_equal(few, spread)


@pytest.mark.fe
def test_positions_between_the_samples_are_equilibria_like_all_others():
    """The same position counted in one and in half pitches, under both signs."""
    design = coarse(**ERRORS)
    one, two = (
        full_solves(
            design,
            *influences(design, phases=phases),
            np.array([31, 64]) * phases,
            (0.0, 12.0),
            np.array([1.0, -1.0]),
        )
        for phases in (1, 2)
    )
    assert one.torque.tolist() == [0.0, 12.0, 0.0, -12.0]
    for key in ("input_angle", "torque", "output_error", "input_torque"):
        found, wanted = getattr(one, key), getattr(two, key)
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9)

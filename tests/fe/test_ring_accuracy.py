"""The output of a thin-ring drive over input turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming
from solved import hundred_elements

from swgjoint.errors import ComputationError, Outcome
from swgjoint.fe.rings import accuracy as ring_accuracy
from swgjoint.fe.rings.accuracy import output_turn_angles, transmission_error
from swgjoint.gear.design.design import Design
from swgjoint.units import arcmin

PERFECT = Design.preset("size-25-50")
PITCH_UM = 4.0
FLAWED = PERFECT.with_changes(
    {
        "tolerances.flexspline_cumulative_pitch_um": PITCH_UM,
        "tolerances.circular_spline_cumulative_pitch_um": PITCH_UM,
        "tolerances.seed": 2,
    }
)
TURN = 2.0 * np.pi * 50.0
"""Input angle of one output turn [rad]."""
ANGLES = np.array([100.0, 250.0, 100.0 + TURN])
"""On both sides of half an output turn, and the first again a turn later."""


@pytest.fixture(scope="module", autouse=True)
def few_elements():
    """The laws hold for rings of any number of elements."""
    with hundred_elements():
        yield


def test_errors_of_teeth_return_after_one_output_turn():
    """Perfect teeth leave the passage of the balls; others no more than their errors.

    A turn later the balls are elsewhere, but the teeth meet as before.
    """
    perfect, flawed = (transmission_error(d, ANGLES) for d in (PERFECT, FLAWED))
    assert np.ptp(perfect) < 0.05 * arcmin
    # the play and 1 % of rated torque hold the output back
    assert (perfect < 0.0).all()
    for error in (perfect, flawed):
        assert error[2] == pytest.approx(error[0], abs=0.01 * arcmin)
    pitch_radius = 25 * 2.54e-3 / 2.0
    bound = 2.0 * PITCH_UM * 1e-6 / pitch_radius
    assert 0.05 * bound < np.ptp(flawed - perfect) < bound


def test_half_an_output_turn_is_no_jump():
    """Where the direction of the output wraps, the error goes on as before."""
    half = 0.5 * TURN
    error = transmission_error(PERFECT, [half - 1e-3, half, half + 1e-3])
    assert error == pytest.approx(error[0], abs=0.01 * arcmin)


def test_angles_are_strewn_over_the_output_turn():
    """One in each of the equal parts, no two of one spacing."""
    angles = output_turn_angles(PERFECT, 16)
    assert (np.floor(angles / (TURN / 16)) == np.arange(16)).all()
    assert np.ptp(np.diff(angles)) > 1.0


def test_a_failure_says_where(monkeypatch):
    """An equilibrium that is not found is an error, not a number."""

    def stuck(model, state, torque):
        return replace(state, outcome=Outcome.MAX_ITERATIONS)

    monkeypatch.setattr(ring_accuracy, "solve_loaded", stuck)
    with pytest.raises(
        ComputationError, match=naming("size-25-50", "5 N·m", "0.5 rad", "load steps")
    ):
        transmission_error(PERFECT, [0.5], torque=5.0)

"""Full solves of a drive with manufacturing errors: what shows, and at which order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming
from solved import FEW_PITCH, coarse, few_teeth

from swgjoint.errors import DesignError
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import can_halve, sector_model
from swgjoint.gear.design.design import Design


def flawed(**values) -> Design:
    changes = {f"tolerances.{key}": value for key, value in values.items()}
    return few_teeth(**changes)


def orders(torque=4.0, positions=16, **values):
    """Amplitudes per turn of the wave generator, whole pitches apart [rad]."""
    design = flawed(**values)
    follow = Continuation(model=sector_model(design), ratio=design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), torque)
    error = []
    for k in range(positions):
        angle = FEW_PITCH * round(62 * k / positions)
        state = follow.to_angle(state, angle)
        assert state.outcome.ok
        error.append(follow.output_angle(state) - angle / design.ratio)
    return np.abs(np.fft.rfft(error)) / positions * 2.0


@pytest.mark.fe
def test_opposite_lobes_cancel_odd_pitch_errors():
    """Cumulative pitch error of harmonics 1 to 4 shows at 2 and 4 per turn."""
    found = orders(circular_spline_cumulative_pitch_um=10.0)
    assert found[2] > 2e-5 and found[4] > 1e-5
    assert found[[1, 3]].max() < 0.05 * found[[2, 4]].min()


@pytest.mark.fe
def test_unequal_lobes_show_odd_pitch_errors():
    """1 per turn needs an eccentric wave generator and pitch errors together."""
    alone = orders(
        positions=8, wave_generator_eccentricity_um=5.0, wave_generator_ovality_um=5.0
    )
    assert alone[1:].max() < 1e-9
    both = orders(
        wave_generator_eccentricity_um=5.0, circular_spline_cumulative_pitch_um=10.0
    )
    assert both[1] > 1e-6


@pytest.mark.fe
def test_oval_circular_spline_shows_twice_a_turn():
    """Ovality alone: 2 per turn, nothing odd."""
    found = orders(circular_spline_ovality_um=5.0)
    assert found[2] > 1e-6
    assert found[[1, 3, 5, 7]].max() < 0.05 * found[2]


@pytest.mark.fe
def test_teeth_shifted_alike_turn_the_member():
    """A common pitch error is a rotation of the member by error over radius."""
    design = coarse()
    perfect, shift = sector_model(design, half=True), 2e-6
    moved = replace(
        perfect,
        tooth_shift=np.tile([-shift, 0.0], (60, 1)),
        circular_spline_tooth_shift=np.zeros((61, 2)),
    )
    angles = []
    for model in (perfect, moved):
        follow = Continuation(model=model, ratio=design.ratio)
        state = follow.to_torque(follow.engage(follow.deflect()), 4.0)
        angles.append(follow.output_angle(state))
    # the teeth touch on radii from 60.4 to 61.6 mm
    assert angles[0] - angles[1] == pytest.approx(shift / 61e-3, rel=0.02)


@pytest.mark.fe
def test_errors_keep_the_energy_balance():
    """T_wg is the slope of U + T psi, outline eccentric and oval, teeth flawed."""
    design = flawed(
        wave_generator_eccentricity_um=5.0,
        wave_generator_ovality_um=5.0,
        random_pitch_um=2.0,
        circular_spline_ovality_um=5.0,
    )
    follow = Continuation(model=sector_model(design), ratio=design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    potential, step = [], 1e-4
    for angle in (0.013 - step, 0.013, 0.013 + step):
        state = follow.to_angle(state, angle)
        assert state.outcome.ok
        potential.append(state.energy + 20.0 * state.rotation)
        if angle == 0.013:
            torque = state.wave_generator_torque
    slope = (potential[2] - potential[0]) / (2.0 * step)
    assert torque == pytest.approx(slope, rel=1e-5)


def test_errors_need_all_sectors():
    """No half model."""
    design = flawed(random_pitch_um=2.0)
    assert not can_halve(design)
    with pytest.raises(
        DesignError,
        match=naming("reference-2d", "60/62 teeth", "half model", "even", "tolerances"),
    ):
        sector_model(design, half=True)

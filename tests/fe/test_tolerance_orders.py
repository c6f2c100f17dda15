"""Which orders errors of the teeth and of the wave generator show in an output turn."""

from __future__ import annotations

import numpy as np
import pytest
from solved import coarse

from swgjoint.fe.tolerances.cycle import MEMBERS, pitches_of, shift_errors
from swgjoint.fe.tolerances.rest import influences
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import ToothErrors, tooth_errors

pytestmark = pytest.mark.fe

NOISE = 5e-8
"""What the mesh leaves of the kinematic error of the reference drive [rad]."""
ECCENTRIC = {"wave_generator_eccentricity_um": 5.0}


def flawed(**values) -> Design:
    changes = {f"tolerances.{key}": value for key, value in values.items()}
    return coarse(**changes)


@pytest.fixture(scope="module")
def perfect(perfect_influences):
    """Influences of the drive with a perfect and with an eccentric wave generator."""
    eccentric = influences(flawed(**ECCENTRIC), phases=1)
    return {False: perfect_influences[1][0].at, True: eccentric[1][0].at}


def orders(at, shifts, torque=4.0):
    """Amplitudes of the output error per turn of the input, a position a pitch [rad].

    Args:
        at: Influences at the position within a pitch.
        shifts: Shifts of both members after whole pitches of the input.
        torque: T [N·m].
    """
    error = at.respond(at.gap_change(*shifts), torque).output_angle
    assert np.isfinite(error).all()
    size = 2.0 * np.abs(np.fft.rfft(error)) / error.size
    turns = error.size / 122
    return lambda order: size[round(order * turns)]


def orders_of(at, design):
    """The same over the cycle of a design's teeth."""
    pitches = np.arange(pitches_of(design))
    layout = design.drive.layout
    shifts = [shift_errors(tooth_errors(design, m), pitches, layout) for m in MEMBERS]
    return orders(at, shifts)


def test_two_four_and_the_beat_stand_out(perfect):
    """Pitch errors of both members and ovality: 2, 4 and 61/60 of them per turn."""
    design = flawed(
        circular_spline_cumulative_pitch_um=10.0,
        flexspline_cumulative_pitch_um=10.0,
        circular_spline_ovality_um=5.0,
    )
    found = orders_of(perfect[False], design)
    for order in (2.0, 4.0, 2.0 * 61 / 60, 4.0 * 61 / 60):
        assert found(order) > 10.0 * NOISE
        assert found(order) > 10.0 * max(found(order + 0.5), found(order - 0.5))


def test_odd_harmonics_of_the_pitch_cancel(perfect):
    """Harmonics 1 and 3 alone leave less than 5 % of what 2 and 4 of that size do."""
    angle = 2.0 * np.pi / 122 * np.arange(122)
    pitches, none = np.arange(122), np.zeros((122, 120, 2))
    found = {}
    for low, high in ((1, 3), (2, 4)):
        wave = 2e-6 * (np.cos(low * angle) + np.cos(high * angle + 1.0))
        errors = ToothErrors(tangential=wave, radial=np.zeros(122))
        shifts = shift_errors(errors, pitches, "circular_spline_fixed")
        seen = orders(perfect[False], (none, shifts))
        found[low] = max(seen(order) for order in range(1, 13))
    # a shift of all teeth turns the output by itself over the pitch radius
    assert found[2] == pytest.approx(2e-6 / 61e-3, rel=0.2)
    assert found[1] < 0.05 * found[2]


def test_once_per_turn_needs_eccentricity_and_pitch_errors(perfect):
    """An eccentric wave generator alone shows nothing, pitch errors alone not 1."""
    pitch = {"circular_spline_cumulative_pitch_um": 10.0}
    both = orders_of(perfect[True], flawed(**pitch, **ECCENTRIC))
    without = orders_of(perfect[False], flawed(**pitch))
    assert both(1) > 10.0 * NOISE and both(1) > 20.0 * without(1)
    nothing = np.zeros((122, len(perfect[True].sector)))
    alone = perfect[True].respond(nothing, 4.0).output_angle
    assert np.ptp(alone) < 1e-12

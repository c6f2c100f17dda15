"""Two-mass response of a joint: closed forms, amplitude, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.figures.frequency_response import Chirp, TwoMass, frequency_response

CHIRP = Chirp(low=8.0, high=100.0, period=4.0)


@pytest.fixture(scope="module")
def drive():
    return DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)


@pytest.mark.parametrize("link", [0.3, 1.0, 3.0])
def test_linear_joint_has_the_closed_form_frequencies(drive, link):
    """Resonance and anti-resonance of unequal masses within 1 %."""
    masses = TwoMass(rotor_inertia=1e-4, link_inertia=link)
    found = frequency_response(
        drive, masses, CHIRP, level="linear", amplitude=1.0, step=2e-4
    )
    stiffness = drive.mean_stiffness
    resonance = masses.resonance(stiffness, drive.ratio)
    assert found.resonance == pytest.approx(resonance, rel=0.01)
    assert found.antiresonance == pytest.approx(
        masses.antiresonance(stiffness), rel=0.01
    )


def test_response_is_that_of_the_equations(drive):
    """Both speeds over the whole band against the two-mass transfer functions."""
    masses, ratio = TwoMass(rotor_inertia=1e-4, link_inertia=0.5), drive.ratio
    found = frequency_response(
        drive, masses, CHIRP, level="linear", amplitude=1.0, step=1e-4
    )
    K, J_m, J_l = drive.mean_stiffness, masses.rotor_inertia, masses.link_inertia
    reduced = 1.0 / (1.0 / (ratio**2 * J_m) + 1.0 / J_l)
    C = 2.0 * drive.damping_ratio * np.sqrt(K * reduced)
    s = 2j * np.pi * found.frequency
    coupling = K + C * s
    rotor = J_m * s**2 + coupling / ratio**2
    link = J_l * s**2 + coupling
    determinant = rotor * link - (coupling / ratio) ** 2
    assert np.abs(found.link) == pytest.approx(
        np.abs(s * coupling / ratio / determinant), rel=2e-3
    )
    assert np.abs(found.rotor) == pytest.approx(
        np.abs(s * link / determinant), rel=2e-3, abs=1e-3 * np.abs(found.rotor).max()
    )


def test_resonance_rises_with_the_amplitude_of_a_hardening_drive(drive):
    """From the tangent without load at small torque to the stiffer segments."""
    masses = TwoMass(rotor_inertia=1e-4, link_inertia=1.0)
    weak, strong = (
        frequency_response(drive, masses, CHIRP, amplitude=amplitude, step=2e-4)
        for amplitude in (0.2, 20.0)
    )
    tangent = float(drive.stiffness(0.0, 0.0, 0.0))
    closed = masses.resonance(tangent, drive.ratio)
    assert weak.resonance == pytest.approx(closed, rel=0.01)
    assert strong.resonance > 1.1 * weak.resonance
    assert strong.largest_torque > drive.ratings.T2 > weak.largest_torque


def test_bias_stiffens_a_hardening_drive(drive):
    """Under a constant torque small motions see the tangent there."""
    masses = TwoMass(rotor_inertia=1e-4, link_inertia=1.0)
    torque = 1.5 * drive.ratings.T2
    found = frequency_response(
        drive, masses, CHIRP, amplitude=0.2, bias=torque, step=2e-4
    )
    tangent = float(drive.stiffness(drive.mean_torsion(torque), 0.0, 0.0))
    closed = masses.resonance(tangent, drive.ratio)
    assert found.resonance == pytest.approx(closed, rel=0.01)
    assert found.largest_torque == pytest.approx(torque, rel=0.1)


def test_what_cannot_be_measured_is_refused(drive):
    """A level without rotor, a chirp too fast for the step, a band without peak."""
    masses = TwoMass(rotor_inertia=1e-4, link_inertia=1.0)
    with pytest.raises(InputError, match=naming("'rigid'", "linear", "native", "full")):
        frequency_response(drive, masses, CHIRP, level="rigid", amplitude=1.0)
    with pytest.raises(InputError, match=naming("chirp", "100 Hz", "2 ms", "50 Hz")):
        frequency_response(drive, masses, CHIRP, amplitude=1.0, step=2e-3)
    with pytest.raises(
        InputError, match=naming("chirp", "9", "8 Hz", "16 s", "low < high")
    ):
        Chirp(low=9.0, high=8.0)
    low = Chirp(low=1.0, high=5.0, period=4.0)
    found = frequency_response(
        drive, masses, low, level="linear", amplitude=1.0, step=1e-3
    )
    with pytest.raises(
        ComputationError, match=naming("frequency response", "1", "5 Hz", "chirp")
    ):
        _ = found.resonance

"""The three layouts in space are one drive seen from three members."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from swgjoint.fe.solid.corotation import about_z
from swgjoint.gear.kinematics import ratio

pytestmark = pytest.mark.fe

TORQUE = 5.0
OTHERS = ["flexspline_fixed", "wave_generator_fixed"]
# in each of them the pattern repeats with the teeth of the flexspline
PITCH = 2 * pi / 40


@pytest.fixture(scope="module", params=OTHERS)
def follow(request, small_drive):
    """The small drive with another member fixed."""
    layout = request.param
    return replace(small_drive, layout=layout, ratio=ratio(layout, 40, 42))


@pytest.fixture(scope="module")
def driven(follow, loaded):
    """The loaded drive turned along until the other member stands, and solved there."""
    turn = loaded.rotation
    if follow.layout == "wave_generator_fixed":
        turn = loaded.wave_generator_angle
    back = about_z(np.array(-turn)).T
    start = replace(
        loaded,
        faces=loaded.faces @ back,
        inside=loaded.inside @ back,
        wave_generator_angle=loaded.wave_generator_angle - turn,
        rotation=loaded.rotation - turn,
        circular_spline_rotation=-turn,
    )
    return follow.load(start, -loaded.tooth_moment, follow.input_angle(start))


def test_same_state_from_another_member(follow, driven, loaded):
    """The circular-spline-fixed state, turned along, is an equilibrium here too."""
    assert driven.outcome.ok
    assert len(driven.history) < 4
    alpha = driven.wave_generator_angle - driven.circular_spline_rotation
    assert alpha == pytest.approx(loaded.wave_generator_angle, abs=1e-11)
    assert driven.energy == pytest.approx(loaded.energy, rel=1e-9)
    assert driven.tooth_force == pytest.approx(loaded.tooth_force, abs=1e-4)
    assert driven.wave_generator_torque == pytest.approx(
        loaded.wave_generator_torque, abs=1e-6 * TORQUE
    )
    assert driven.holding_torque == pytest.approx(-TORQUE, rel=1e-6)


def test_work_equals_energy(follow, driven):
    """T_in dtheta - T dpsi = dU by central differences at a smooth position."""
    theta, h = follow.input_angle(driven), 2e-3 * PITCH
    low, high = (follow.to_angle(driven, theta + s * h) for s in (-1, 1))
    gained = high.energy - low.energy
    gained += driven.torque * (follow.output_angle(high) - follow.output_angle(low))
    torque = follow.input_torque(driven)
    assert gained == pytest.approx(torque * 2 * h, rel=1e-4)


def test_tangent_compliance(follow, driven):
    """-d psi/dT of the converged system against a difference."""
    more = follow.to_torque(driven, 1.001 * driven.torque)
    slope = follow.output_angle(driven) - follow.output_angle(more)
    # the curvature of the contacts is not in the frozen tangent
    slope /= 0.001 * driven.torque
    assert driven.compliance == pytest.approx(slope, rel=0.01)


@pytest.mark.slow
def test_balance_and_mean_torque_over_a_pitch(follow, driven):
    """The teeth carry T, the input T/i in the mean; the error repeats."""
    torques, errors, state = [], [], follow.to_torque(driven, TORQUE)
    for k in range(7):
        state = follow.to_angle(state, (0.4 + k / 6) * PITCH)
        assert state.outcome.ok
        assert state.tooth_moment == pytest.approx(-TORQUE, rel=1e-7)
        outside = state.wave_generator_torque + state.holding_torque
        assert outside == pytest.approx(TORQUE, rel=1e-6)
        torques.append(follow.input_torque(state))
        errors.append(
            follow.output_angle(state) - follow.input_angle(state) / follow.ratio
        )
    assert np.mean(torques[:-1]) == pytest.approx(TORQUE / follow.ratio, rel=5e-3)
    assert abs(errors[-1] - errors[0]) < 1e-4 * np.ptp(errors)

"""The three layouts are one drive seen from three members."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from solved import coarse

from swgjoint.drives.build_map import build_map
from swgjoint.errors import Outcome
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.layouts import with_layout

TORQUE = 20.0
LAYOUTS = {
    "circular_spline_fixed": (-60.0, 122),
    "flexspline_fixed": (61.0, 120),
    "wave_generator_fixed": (122 / 120, 120),
}


@cache
def run(layout):
    """One pitch of the fixed (wave generator fixed: the input) member and one more."""
    design = coarse(**{"drive.layout": layout})
    teeth = LAYOUTS[layout][1]
    return simulate_meshing(
        design, torque=TORQUE, steps=13, turn=13 / 12 / teeth, half=True
    )


@cache
def follow(layout):
    design = Design.load("reference-2d")
    return Continuation(
        model=sector_model(design, half=True), ratio=LAYOUTS[layout][0], layout=layout
    )


@cache
def loaded(layout):
    f = follow(layout)
    return f.to_torque(f.engage(f.deflect()), TORQUE)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_balance_and_mean_torque(layout):
    """Moments balance at every step; the input does the output's work on average."""
    result = run(layout)
    teeth = result.series("tooth_moment")
    if layout == "circular_spline_fixed":
        balance = teeth + result.series("wave_generator_torque") - TORQUE
    else:
        balance = teeth + TORQUE  # the moment on the circular spline is T
    assert np.abs(balance).max() < 1e-6 * TORQUE
    mean = result.series("input_torque")[:12].mean()
    assert mean == pytest.approx(TORQUE / LAYOUTS[layout][0], rel=5e-3)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pattern_repeats(layout):
    """The error repeats after a pitch of the fixed member."""
    error = run(layout).series("output_error")
    assert abs(error[12] - error[0]) < 1e-3 * np.ptp(error)
    assert np.ptp(error) < 1e-5


@pytest.mark.parametrize("layout", LAYOUTS)
def test_work_equals_energy(layout):
    """T_in dtheta - T dpsi = dU by central differences at a smooth position."""
    f, start = follow(layout), loaded(layout)
    pitch = 2 * pi / LAYOUTS[layout][1]
    middle = f.to_angle(start, 0.3 * pitch)
    h = 0.004 * pitch
    low, high = (f.to_angle(middle, 0.3 * pitch + s * h) for s in (-1, 1))
    gained = high.energy - low.energy
    gained += TORQUE * (f.output_angle(high) - f.output_angle(low))
    assert gained == pytest.approx(f.input_torque(middle) * 2 * h, rel=1e-4)


@pytest.mark.parametrize("layout", ["flexspline_fixed", "wave_generator_fixed"])
def test_same_state_from_another_member(layout):
    """The circular-spline-fixed state, turned along, is an equilibrium here too."""
    one = follow("circular_spline_fixed").to_angle(
        loaded("circular_spline_fixed"), 0.01
    )
    f = follow(layout)
    beta = one.wave_generator_angle - one.rotation
    theta = beta if layout == "flexspline_fixed" else -beta
    other = f.to_torque(f.to_angle(loaded(layout), theta), -one.tooth_moment)
    assert other.energy == pytest.approx(one.energy, rel=1e-9)
    assert other.wave_generator_torque == pytest.approx(
        one.wave_generator_torque, rel=1e-6
    )
    alpha = other.wave_generator_angle - other.circular_spline_rotation
    assert alpha == pytest.approx(one.wave_generator_angle, abs=1e-11)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_tangent_compliance(layout):
    """-d psi/dT of the converged system against differences."""
    f = follow(layout)
    state = f.to_angle(loaded(layout), 0.3 * 2 * pi / LAYOUTS[layout][1])
    low, high = (f.to_torque(state, TORQUE + s * 0.01) for s in (-1, 1))
    slope = -(f.output_angle(high) - f.output_angle(low)) / 0.02
    # contact points that slide along their flanks are left out of the tangent
    assert state.compliance == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("failing", [False, True])
def test_torque_and_angle_may_change_at_once(layout, failing, monkeypatch):
    """The equilibrium does not depend on the order; a failing step is divided."""
    f, angle = follow(layout), 0.1 * pi / 122
    by_steps = f.to_angle(f.to_torque(loaded(layout), 0.5 * TORQUE), angle)
    solve, tried = Continuation.load, []

    def load(self, start, torque, at):
        tried.append(torque)
        state = solve(self, start, torque, at)
        outcome = Outcome.DIVERGED if failing and len(tried) == 1 else state.outcome
        return replace(state, outcome=outcome)

    monkeypatch.setattr(Continuation, "load", load)
    at_once = f.to_position(loaded(layout), 0.5 * TORQUE, angle)
    assert len(tried) == (3 if failing else 1) and at_once.outcome.ok
    assert f.input_angle(at_once) == pytest.approx(angle)
    apart = f.output_angle(at_once) - f.output_angle(by_steps)
    # step tolerance of the solver by the radius of the bore: 2e-12 m / 0.058 m
    assert abs(apart) < 4e-11
    assert f.input_torque(at_once) == pytest.approx(f.input_torque(by_steps), rel=1e-6)


def test_a_map_transforms_to_other_layouts():
    """Finite elements with the flexspline fixed agree with the transformed map."""
    small = {
        "drive.teeth_flexspline": 40,
        "drive.teeth_circular_spline": 42,
        "ratings.rated_torque_Nm": 10.0,
        "ratings.repeated_peak_Nm": 20.0,
    }
    held = coarse(**small)
    turned = held.with_changes({"drive.layout": "flexspline_fixed"})
    fixed, solved = (
        build_map(design, model="2d", angles=8, cache=False)
        for design in (held, turned)
    )
    moved = with_layout(fixed, "flexspline_fixed", ratings_of(turned))
    theta = 2.0 * pi * np.linspace(0.0, 2.0 / 40.0, 41)
    for torque in (-15.0, 3.0, 18.0):
        psi = [output_angle(drive, theta, torque) for drive in (moved, solved)]
        error = psi[1] - theta / solved.ratio
        assert np.abs(psi[0] - psi[1]).max() < 0.01 * np.ptp(error)
        force = [
            drive.law(theta, at).input_force
            for drive, at in zip((moved, solved), psi, strict=True)
        ]
        assert np.abs(force[0] - force[1]).max() < 0.001 * np.ptp(force[1])

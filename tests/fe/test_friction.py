"""Coulomb friction of the flanks: passive, balanced, the same in every layout."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from messages import naming
from solved import PITCH, coarse, kept

from swgjoint.errors import DesignError
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.linearise import linearise
from swgjoint.gear.design.design import Design


def rubbing(coefficient: float = 0.1, **changes) -> Design:
    return coarse(**{"friction.tooth_coefficient": coefficient, **changes})


@cache
def turned(torque: float, steps: int):
    """States over two pitches at constant torque."""
    return kept(f"rubbing {torque} {steps}", lambda: _turned(torque, steps))


def _turned(torque: float, steps: int):
    design = rubbing()
    follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
    states = [follow.to_torque(follow.engage(follow.deflect()), torque)]
    for k in range(1, 2 * steps + 1):
        states.append(follow.to_angle(states[-1], PITCH * k / steps))
    assert all(state.outcome.ok for state in states)
    return states


def series(states, name):
    return np.array([getattr(state, name) for state in states])


def test_slip_is_differentiated_right():
    """Change of s_f + s_c by the motion of either flank, against differences."""
    model = sector_model(rubbing(), half=True)
    follow = Continuation(model=model, ratio=-60.0)
    state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    ring, c = linearise(model, state, 20.0), state.contacts
    rng, step = np.random.default_rng(1), 1e-8

    def slip(flank, circular_spline_flank):
        search = replace(ring.search, circular_spline_flank=circular_spline_flank)
        found = search.search(flank, 2e-5, c)
        return found.slip[c.nearest_in(found)]

    here, there = ring.flank, ring.search.circular_spline_flank
    still = slip(here, there)
    # smooth along the flank: rigid motions of the teeth
    for own, shift in ((True, here), (False, there)):
        push = np.tile(rng.standard_normal((len(shift), 2)), shift.shape[1] // 2)
        moved = (here + step * push, there) if own else (here, there + step * push)
        rows = c.sliding if own else c.circular_spline_sliding
        at = c.sector if own else c.tooth
        expected = -np.einsum("kb,kb->k", rows, push[at])
        assert (slip(*moved) - still) / step == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("torque", [20.0, -20.0])
def test_work_of_friction_is_never_negative(torque):
    """It grows at every step, and no contact carries more than mu F."""
    states = turned(torque, 12)
    assert (np.diff(series(states, "friction_work")) > 0.0).all()
    for state in states:
        limit = 0.1 * state.tooth_force * (1.0 + 1e-9)
        assert (np.abs(state.friction_force) <= limit + 1e-12).all()


@pytest.mark.slow
def test_work_of_friction_closes_the_balance():
    """T_wg dtheta - T dpsi - dU over a pitch, ever better with smaller steps."""
    gaps = []
    for steps in (12, 48):
        states = turned(20.0, steps)[steps:]  # the second pitch: a steady cycle
        theta, psi = (series(states, k) for k in ("wave_generator_angle", "rotation"))
        torque, energy = (
            series(states, k) for k in ("wave_generator_torque", "energy")
        )
        work = float(np.trapezoid(torque, theta)) - 20.0 * (psi[-1] - psi[0])
        work -= energy[-1] - energy[0]
        friction = float(np.ptp(series(states, "friction_work")))
        gaps.append(abs(work - friction) / friction)
    assert gaps[1] < 0.5 * gaps[0]
    assert gaps[1] < 0.01


def test_driving_costs_torque_and_overhauling_gives_less():
    """Friction adds to the input torque T/i, whichever way the power flows."""
    for torque in (20.0, -20.0):
        states = turned(torque, 12)[12:]
        mean = float(np.mean(series(states, "wave_generator_torque")[1:]))
        drag = float(np.ptp(series(states, "friction_work"))) / PITCH
        assert drag > 0.0
        assert mean == pytest.approx(torque / -60.0 + drag, rel=2e-3)


@pytest.mark.slow
def test_loop_at_a_locked_input_encloses_the_work():
    """Torque up, down and up again: a closed loop whose area is the friction work."""
    # the ellipse holds the whole rim: its flanks hardly slide under torque
    design = coarse("reference-2d-simplified", **{"friction.tooth_coefficient": 0.1})
    follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
    state = follow.engage(follow.deflect())
    # contacts come and go within a step: 40 steps a leg leave 0.5 %, 160 leave 2e-5
    legs = [np.linspace(a, b, 161)[1:] for a, b in ((0, 20), (20, -20), (-20, 20))]
    loop = []
    for k, torque in enumerate(np.concatenate(legs)):
        state = follow.to_torque(state, float(torque))
        assert state.outcome.ok
        if k >= 159:
            loop.append(state)
    psi, torque = series(loop, "rotation"), series(loop, "torque")
    area = -float(np.trapezoid(torque, psi))
    assert psi[-1] == pytest.approx(psi[0], abs=1e-4 * np.ptp(psi))
    assert area == pytest.approx(np.ptp(series(loop, "friction_work")), rel=2e-3)


@pytest.mark.parametrize(
    ("layout", "twin"), [("flexspline_fixed", -20.0), ("wave_generator_fixed", 20.0)]
)
def test_layouts_rub_alike(layout, twin):
    """The same relative motion with the same flow of power dissipates the same work."""
    work = []
    for name, torque in (("circular_spline_fixed", twin), (layout, 20.0)):
        design = rubbing(**{"drive.layout": name})
        run = simulate_meshing(design, torque=torque, steps=4, turn=0.01, half=True)
        state = run.steps[-1].state
        relative = state.wave_generator_angle - state.circular_spline_rotation
        work.append(abs(state.friction_work / relative))
    # 2 %: positions that differ by a sixtieth, and the torques by 2/120
    assert work[1] == pytest.approx(work[0], rel=0.02)


def test_the_first_position_rubs_like_the_others():
    """Friction at the start is that of steady motion: a pitch later all repeats."""
    design = rubbing()
    pitches = 1 / design.drive.teeth_circular_spline
    # steps as long as those before the first position
    run = simulate_meshing(design, torque=20.0, steps=13, turn=13 / 12 * pitches)
    for key in ("input_torque", "output_error"):
        values = run.series(key)
        assert abs(values[12] - values[0]) < 0.01 * np.ptp(values)


def test_friction_does_not_depend_on_the_distance_of_positions():
    """Positions more than a pitch apart have the input torques of close ones."""
    pitch = 1 / 122
    torque = [
        simulate_meshing(rubbing(), torque=20.0, steps=4, turn=turn).series(
            "input_torque"
        )
        for turn in (pitch, 5 * pitch)  # the same phases
    ]
    # the far ones are approached in other steps: 2 % of a loss of 0.018 N·m
    assert np.abs(torque[1] - torque[0]).max() < 4e-4


def test_a_rigid_circular_spline_cannot_rub():
    """Its flank has no material points to follow: one clear line."""
    with pytest.raises(
        DesignError,
        match=naming("reference-2d", "friction.tooth_coefficient", "0.1", "0"),
    ):
        sector_model(rubbing(), elastic_circular_spline=False)

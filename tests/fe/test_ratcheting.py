"""The largest torque with the wave generator locked: laws of the path to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from swgjoint.errors import Outcome
from swgjoint.fe.plane.figures.floating import shift_generator, side_force
from swgjoint.fe.plane.figures.ratcheting import (
    RatchetingPath,
    path_follower,
    ratcheting_path,
)
from swgjoint.gear.design.design import Design

OVAL = {"circular_spline.outer_rim": "free", "mesh.refinement": 0.6}
"""A circular spline whose outside can become oval, as thick as stated below."""


def drive(size: int) -> Design:
    """Member of the family, similar in every length, its bearing included."""
    design = Design.preset(f"size-{size}-50")
    fitted = Design.preset("size-25-50").wave_generator.bearing
    assert fitted is not None
    lengths = ("ball_diameter_mm", "race_thickness_mm", "clearance_um", "race_width_mm")
    bearing = {
        f"wave_generator.bearing.{key}": getattr(fitted, key) * size / 25.0
        for key in lengths
    }
    bearing["wave_generator.bearing.balls"] = fitted.balls
    return design.with_changes(
        {**OVAL, **bearing, "circular_spline.rim_mm": 0.4 * size}
    )


@pytest.fixture(scope="module", params=[True, False], ids=["bearing", "rigid"])
def bearing(request) -> bool:
    """Whether the rim stands on the bearing of the wave generator."""
    return request.param


@pytest.fixture(scope="module")
def short(bearing):
    """The first steps of the path."""
    return ratcheting_path(drive(25), bearing=bearing, step=0.01, upto=0.12)


def test_the_work_of_the_torque_is_the_energy(short):
    """T is the derivative of the strain energy by the turned angle; no limit yet."""
    # without the first step, in which teeth come in one by one
    x = short.turned[1:]
    work = CubicSpline(x, short.torque[1:]).antiderivative()
    gain = short.energy[2:] - short.energy[1]
    # 2e-4 of the whole: a cubic through points between which teeth come in
    assert gain == pytest.approx(work(x[1:]) - work(x[0]), abs=2e-4 * gain[-1])
    assert not short.passed
    assert short.outcome is Outcome.CONVERGED
    assert (np.diff(short.torque) > 0.0).all()
    assert (np.diff(short.pairs) >= 0).all() and np.ptp(short.pairs) > 10


def test_race_and_balls_give_way(short, bearing):
    """On the bearing the teeth hold less at the same angle than on a rigid surface."""
    assert short.on_bearing is bearing
    other = ratcheting_path(drive(25), bearing=not bearing, step=0.02, upto=0.1)
    at = CubicSpline(short.turned, short.torque)(other.turned[-1])
    low, high = (at, other.torque[-1]) if bearing else (other.torque[-1], at)
    assert 0.0 < low < 0.95 * high


@pytest.fixture(scope="module")
def floating(bearing):
    """Steps with a wave generator that is free to move sideways."""
    return ratcheting_path(
        drive(25), bearing=bearing, floating=True, step=0.02, upto=0.1
    )


def test_a_floating_wave_generator_leaves_the_centre(short, floating):
    """The centre is a saddle of the energy: beside it, the teeth hold less."""
    away = np.hypot(*floating.offset.T)
    assert (away[-3:] > 10e-6).all() and (np.diff(away[-3:]) > 0.0).all()
    for key in ("energy", "torque"):
        centred = CubicSpline(short.turned, getattr(short, key))(floating.turned[-3:])
        assert (getattr(floating, key)[-3:] < centred).all()


def test_the_work_is_the_energy_beside_the_centre(floating):
    """The generator is free, so that no other force works."""
    x = floating.turned[1:]
    work = CubicSpline(x, floating.torque[1:]).integrate(x[0], x[-1])
    gain = floating.energy[-1] - floating.energy[1]
    assert gain == pytest.approx(work, rel=2e-3)


def test_the_side_force_is_the_slope_of_the_energy(bearing):
    """F = -dU/dx, anywhere, by central differences."""
    follow = path_follower(drive(25), bearing=bearing, whole=True)
    state = follow.engage(follow.deflect())
    first, pitch, height = follow.output_angle(state), 0.0628, follow.model.lobe_height
    for part in (0.03, 0.06, 0.09):
        turned = follow.rotate_output(state, first - part * pitch)
        state = follow.hold_output(turned)

    def held(offset):
        placed = replace(
            follow, model=shift_generator(follow.model, np.array(offset) * height)
        )
        found = placed.hold_output(state)
        assert found.outcome.ok
        return found

    at, h = np.array([0.005, -0.008]), 1e-3
    slope = [held(at + h * e).energy - held(at - h * e).energy for e in np.eye(2)]
    force = side_force(follow.model, held(at))
    # 2e-2: the contacts change within the difference
    miss = force + np.array(slope) / (2.0 * h * height)
    assert np.hypot(*miss) < 2e-2 * np.hypot(*force)


def test_torque_grows_with_the_size_cubed(short, bearing):
    """A drive of twice all lengths holds eight times the torque at the same angle."""
    twice = ratcheting_path(drive(50), bearing=bearing, step=0.01, upto=0.02)
    # 1e-5: profiles of the family are rounded to a nanometre
    assert twice.torque[1:3] == pytest.approx(8.0 * short.torque[1:3], rel=1e-5)


def test_the_limit_is_the_top_of_a_parabola(short):
    """Through the largest torque and its neighbours; without a fall a lower bound."""
    x = np.array([0.0, 1.0, 2.5, 3.0])
    made = RatchetingPath(
        turned=x,
        torque=10.0 - (x - 2.2) ** 2,
        energy=x,
        offset=np.zeros((4, 2)),
        pairs=np.arange(4),
        pitch=1.0,
        outcome=Outcome.CONVERGED,
    )
    assert made.passed
    assert made.limit == pytest.approx(10.0, rel=1e-12)
    ended = replace(made, torque=x, outcome=Outcome.ACTIVE_SET_CYCLES)
    assert not ended.passed
    assert ended.limit == 3.0


@pytest.mark.slow
def test_the_path_passes_a_limit(bearing):
    """The torque falls at last, and up to there its work is still the energy."""
    path = ratcheting_path(drive(25), bearing=bearing)
    assert path.passed
    assert path.limit == pytest.approx(path.torque.max(), rel=0.01)
    assert (np.diff(path.torque)[:-1] > 0.0).all()
    x = path.turned[1:]
    work = CubicSpline(x, path.torque[1:]).integrate(x[0], x[-1])
    # 2e-3: at the end the circular spline moves by a lobe height
    assert path.energy[-1] - path.energy[1] == pytest.approx(work, rel=2e-3)


def test_backlash_is_no_limit():
    """Within the play no tooth touches: round-off that falls does not end the path."""
    members = ("flexspline", "circular_spline")
    thin = {f"{member}.thickness_coefficient": 0.9 for member in members}
    design = Design.preset("reference-2d-simplified")
    design = design.with_changes({**thin, "mesh.refinement": 0.5})
    path = ratcheting_path(design, step=0.04, upto=0.12)
    assert path.pairs[1] == 0 < path.pairs[2]
    # round-off, and falling; thousands of N·m are to come
    assert path.torque[:2] == pytest.approx(0.0, abs=1e-4)
    assert path.torque[1] < path.torque[0]
    assert path.torque[3] > 1.0
    assert not path.passed
    loose = replace(path, torque=-np.arange(path.turned.size), pairs=0 * path.pairs)
    assert not loose.passed

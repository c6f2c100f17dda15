"""Maxwell-slip hysteresis: the law, its losses, and elements for a wanted loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import naming

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin, Sliders, play_hysteresis
from swgjoint.maps.sheet.loop import torque_loop

ELEMENTS = (
    Jenkin(stiffness=4e3, yield_torque=2.0),
    Jenkin(stiffness=9e3, yield_torque=0.7),
)


def return_mapping(element, torsion):
    """The law in increments: q = clip(q + k dx, ± f), from rest at zero torsion."""
    q, last, torque = 0.0, 0.0, []
    for x in torsion:
        q = np.clip(
            q + element.stiffness * (x - last),
            -element.yield_torque,
            element.yield_torque,
        )
        torque.append(q)
        last = x
    return np.array(torque)


def test_play_is_the_return_mapping():
    """The play of the rest positions is the same law as increments of the torque."""
    x = 1e-3 * np.random.default_rng(1).standard_normal(500)
    want = sum(return_mapping(e, x) for e in ELEMENTS)
    np.testing.assert_allclose(play_hysteresis(ELEMENTS, x), want, atol=1e-12)
    sliders = Sliders.relax(ELEMENTS)
    for k, value in enumerate(x):
        sliders = sliders.move_to(value)
        assert float(sliders.torque(value)) == pytest.approx(want[k], abs=1e-12)


def test_cycle_loses_four_f_times_the_slip():
    """Loop area of one element by quadrature: 4 f (X - f/k), zero below yield."""
    k, f = 4e3, 2.0
    turn = np.linspace(0.0, 4.0 * np.pi, 40_001)
    for amplitude, loss in ((2e-3, 4 * f * (2e-3 - f / k)), (0.9 * f / k, 0.0)):
        x = amplitude * np.sin(turn)
        q = play_hysteresis([Jenkin(stiffness=k, yield_torque=f)], x)
        last = slice(20_000, None)
        assert float(np.trapezoid(q[last], x[last])) == pytest.approx(loss, abs=1e-9)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    turns=st.lists(st.floats(-3e-3, 3e-3), min_size=1, max_size=12),
    values=st.lists(
        st.tuples(st.floats(1e2, 1e5), st.floats(1e-2, 1e2)), min_size=1, max_size=4
    ),
)
def test_work_is_stored_or_slipped(turns, values):
    """Over any path work = change of energy + sum of f |slip|, and no cycle gains."""
    elements = [Jenkin(stiffness=k, yield_torque=f) for k, f in values]
    force = np.array([e.yield_torque for e in elements])
    start = Sliders.relax(elements)
    sliders, here, work, slip = start, 0.0, 0.0, 0.0
    for end in [*turns, 0.0]:
        # exact by trapezoid: every element bends at most once on a leg
        bends = np.concatenate(
            [sliders.rest - sliders.reach, sliders.rest + sliders.reach]
        )
        low, high = min(here, end), max(here, end)
        points = np.unique([low, *bends[(bends > low) & (bends < high)], high])
        leg = float(np.trapezoid(sliders.torque(points), points))
        work += leg if end >= here else -leg
        after = sliders.move_to(end)
        slip += float(force @ np.abs(after.rest - sliders.rest))
        sliders, here = after, end
    stored = float(sliders.energy(here))
    scale = 1e-9 * (1.0 + abs(work) + slip)
    assert work == pytest.approx(stored + slip, abs=scale)
    # back at the start of the cycle nothing has been gained
    assert work >= -scale
    assert (work > scale) or slip <= scale


def test_tangent_is_the_slope_of_the_torque():
    """The stiffness of the sticking elements against differences."""
    sliders = Sliders.relax(ELEMENTS, 1e-4).move_to(8e-4).move_to(3e-4)
    x = np.linspace(-1.01e-3, 1e-3, 41)  # off the corners
    slope = (sliders.torque(x + 1e-9) - sliders.torque(x - 1e-9)) / 2e-9
    np.testing.assert_allclose(sliders.tangent(x), slope, atol=1e-2)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, True, "1"])
def test_values_that_cannot_be(value):
    """Stiffness and yield torque are finite and positive, whoever gives them."""
    with pytest.raises(
        InputError, match=naming("hysteresis", "stiffness", f"{value} N·m/rad", "> 0")
    ):
        Jenkin(stiffness=value, yield_torque=1.0)
    with pytest.raises(
        InputError, match=naming("hysteresis", "yield_torque", f"{value} N·m", "> 0")
    ):
        Jenkin(stiffness=1.0, yield_torque=value)


def test_width_of_one_element_in_closed_form():
    """In parallel with a spring K the loop is 2 f/K wide at zero torque."""
    K = 1e4
    for k, f in ((1e4, 2.0), (3e5, 7.0)):
        element = Jenkin(stiffness=k, yield_torque=f)
        loop = torque_loop(replace(DriveMap.linear(K), hysteresis=(element,)))
        assert loop.hysteresis_loss() == pytest.approx(2 * f / K, rel=1e-6)
        # closed: both branches meet at the tip, where element and spring carry T
        tip = (loop.torque.max() - f) / K
        assert loop.torsion.max() == pytest.approx(tip, rel=1e-9)
        assert loop.torsion.min() == pytest.approx(-tip, rel=1e-9)


def test_area_of_the_loop_is_the_slip_work(synthetic_map):
    """The area of the standard loop of a map equals 4 f (X - f/k) of its elements."""
    drive = replace(synthetic_map, hysteresis=ELEMENTS)
    loop = torque_loop(drive)
    T, x = loop.torque, loop.torsion
    area = float(np.trapezoid(T, x))
    # the harmonics shift the unloaded position; the amplitude is what counts
    X = 0.5 * np.ptp(x)
    want = sum(4 * e.yield_torque * (X - e.yield_torsion) for e in ELEMENTS)
    # chords of the legs between 80 torques cut the corners where elements slip
    assert area == pytest.approx(want, rel=5e-3)

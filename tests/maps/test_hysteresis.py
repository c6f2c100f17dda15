"""Maxwell-slip hysteresis: the law, its losses, and elements for a wanted loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from messages import naming
from played import play_hysteresis

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import (
    Jenkin,
    sticking_stiffness,
    stretches,
)
from swgjoint.maps.sheet.loop import torque_loop
from swgjoint.maps.sliders import Sliders

ELEMENTS = (
    Jenkin(stiffness=4e3, yield_torque=2.0),
    Jenkin(stiffness=9e3, yield_torque=0.7),
)


LOADED = (
    Jenkin(stiffness=4e3, yield_torque=2.0, yield_curve=((10.0, 1.0), (40.0, 5.0))),
    Jenkin(stiffness=9e3, yield_torque=0.0, yield_curve=((20.0, 3.0),)),
    Jenkin(stiffness=2e4, yield_torque=0.7),
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


def test_an_empty_curve_is_a_constant_bit_for_bit():
    """Without a yield curve the elastic torque changes no bit of the law."""
    rng = np.random.default_rng(4)
    x, elastic = 1e-3 * rng.standard_normal(300), 50.0 * rng.standard_normal(300)
    want = sum(
        e.stiffness * stretches(x, e.yield_torque / e.stiffness) for e in ELEMENTS
    )
    np.testing.assert_array_equal(play_hysteresis(ELEMENTS, x, elastic), want)
    flat = tuple(replace(e, yield_curve=((30.0, e.yield_torque),)) for e in ELEMENTS)
    np.testing.assert_array_equal(play_hysteresis(flat, x, elastic), want)
    sliders = Sliders.relax(ELEMENTS).move_to(1e-3, 40.0)
    np.testing.assert_array_equal(
        sliders.rest, Sliders.relax(ELEMENTS).move_to(1e-3).rest
    )


def test_one_element_under_a_load_ramp():
    """Beside a spring K, f = f0 + c|T|: loads and unloads on lines known in advance.

    From rest the element sticks with k until k x = f0 + c K x, then carries f. After
    the reversal at X it sticks until its torque is -f, then follows -f back to zero.
    """
    K, k, f0, c, X = 1e4, 4e4, 1.0, 0.25, 4e-3
    element = Jenkin(
        stiffness=k, yield_torque=f0, yield_curve=((2 * K * X, f0 + c * 2 * K * X),)
    )
    up = np.linspace(0.0, X, 401)
    x = np.concatenate([up, up[-2::-1]])
    q = play_hysteresis([element], x, K * x)
    on, yields = f0 / (k - c * K), f0 + c * K * x
    loaded = np.where(up < on, k * up, yields[:401])
    np.testing.assert_allclose(q[:401], loaded, rtol=0, atol=1e-12 * K * X)
    back = x[401:]
    stuck = f0 + c * K * X - k * (X - back)
    np.testing.assert_allclose(
        q[401:], np.maximum(stuck, -yields[401:]), rtol=0, atol=1e-9 * K * X
    )
    assert q[-1] == pytest.approx(-f0, rel=1e-9)


def test_a_shrinking_yield_slips_back():
    """Without torsion, an unloading drive takes the torque that an element may keep."""
    element = Jenkin(stiffness=1e4, yield_torque=1.0, yield_curve=((50.0, 6.0),))
    sliders = Sliders.relax([element]).move_to(5e-4, 50.0)
    assert float(sliders.torque(5e-4, 50.0)) == 5.0
    back = sliders.move_to(5e-4, 10.0)
    assert float(back.torque(5e-4, 10.0)) == pytest.approx(2.0)
    # what it lost does not come back with the load
    assert float(back.torque(5e-4, 50.0)) == pytest.approx(2.0)
    assert float(back.energy(5e-4, 50.0)) < float(sliders.energy(5e-4, 50.0))


def test_no_cycle_of_torsion_and_load_gains_work():
    """2000 random histories: stored energy >= 0, loss >= 0, and no cycle gains work.

    Torsion and elastic torque are independent here, as for angles that turn. A step
    adapts the yield torque, then moves the torsion, as the scheme of the joint does.
    """
    rng = np.random.default_rng(5)
    for _ in range(2000):
        count = int(rng.integers(1, 5))
        elements = [
            Jenkin(
                stiffness=float(10 ** rng.uniform(2, 5)),
                yield_torque=float(rng.uniform(0, 5)),
                yield_curve=tuple(
                    zip(
                        np.sort(rng.uniform(1, 80, 3)).tolist(),
                        rng.uniform(0, 10, 3).tolist(),
                        strict=True,
                    )
                ),
            )
            for _ in range(count)
        ]
        n = 40
        x = 2e-3 * rng.standard_normal(n) * rng.choice([0.1, 1.0])
        load = 60.0 * rng.standard_normal(n)
        x, load = np.tile(x, 3), np.tile(load, 3)  # a cycle, run three times
        k = np.array([e.stiffness for e in elements])
        rest, here, work, stored = np.zeros(count), 0.0, [], []
        reaches = np.column_stack([e.reach(load) for e in elements])
        for to, reach in zip(x, reaches, strict=True):
            begin = np.clip(here - rest, -reach, reach)
            before = 0.5 * k @ begin**2
            assert not stored or before <= stored[-1] * (1 + 1e-12)
            end = np.clip(begin + to - here, -reach, reach)
            sticks = end - begin
            step = k @ (0.5 * (begin + end) * sticks + end * (to - here - sticks))
            after = 0.5 * k @ end**2
            assert step - (after - before) >= -1e-12 * (after + before + abs(step))
            rest, here = to - end, to
            work.append(step)
            stored.append(after)
        total = np.cumsum(work)
        scale = 1e-9 * (np.abs(total).max() + max(stored))
        assert min(stored) >= 0.0 and total.min() >= -scale
        # the last round starts and ends in the same state
        assert total[-1] - total[2 * n - 1] >= stored[-1] - stored[2 * n - 1] - scale


def test_tangent_follows_the_yield_torque():
    """The derivative of the total torque with slipping, loaded elements."""
    K = 8e3
    sliders = Sliders.relax(LOADED).move_to(2e-3, K * 2e-3).move_to(1.2e-3, K * 1.2e-3)
    for x in (-2.1e-3, -7e-4, 4e-4, 1.7e-3, 2.6e-3):
        d = 1e-9
        high, low = (float(sliders.torque(y, K * y)) for y in (x + d, x - d))
        got = float(sliders.tangent(x, K * x, K))
        assert got == pytest.approx((high - low) / (2 * d), abs=1e-2)


def test_loop_widens_with_the_load(synthetic_map):
    """The standard loop of a map whose yield grows is wider under load, and closed."""
    element = Jenkin(stiffness=2e5, yield_torque=0.5, yield_curve=((60.0, 6.0),))
    drive = replace(DriveMap.linear(2e4), hysteresis=(element,))
    loop = torque_loop(drive)
    width = loop.branch([0.0, 60.0], rising=False) - loop.branch(
        [0.0, 60.0], rising=True
    )
    # T is spring plus element: at T = 0 the spring carries -+f
    c = 5.5 / 60.0
    low = 2 * (0.5 / (1 - c)) / 2e4  # falling: K x = f(K x), rising: the opposite
    assert width[0] == pytest.approx(low, rel=1e-3)
    rising, falling = (60.0 - 0.5) / (1 + c), (60.0 + 0.5) / (1 - c)
    # beyond 60 N·m the yield torque is constant
    falling = falling if falling < 60.0 else 66.0
    assert width[1] == pytest.approx((falling - rising) / 2e4, rel=1e-3)


def test_yields_that_change_too_fast_are_refused():
    """Slopes of 1 in all, or above k/K of one element, have no unique torque."""
    steep = Jenkin(stiffness=1e6, yield_torque=0.0, yield_curve=((10.0, 6.0),))
    with pytest.raises(InputError, match=naming("'linear'", "slopes", "1.2")):
        replace(DriveMap.linear(2e4), hysteresis=(steep, steep))
    soft = replace(steep, stiffness=1e4)
    with pytest.raises(InputError, match=naming("1e+04 N·m/rad", "0.6", "1.2e+04")):
        replace(DriveMap.linear(2e4), hysteresis=(soft,))


@pytest.mark.parametrize(
    "curve", [((0.0, 1.0),), ((2.0, 1.0), (1.0, 1.0)), ((1.0, -1.0),), ((1.0,),)]
)
def test_curves_that_cannot_be(curve):
    """Points are pairs of numbers >= 0 at increasing torques."""
    with pytest.raises(InputError, match=naming("yield_curve", "N·m", "accepted")):
        Jenkin(stiffness=1.0, yield_torque=1.0, yield_curve=curve)


def test_only_elements_that_can_carry_torque_stick():
    """Three elements around 0, 1 and 2 N·m: two neighbours stick, never all."""
    first = Jenkin(stiffness=5.0, yield_torque=1.0, yield_curve=((1.0, 0.0),))
    second = Jenkin(
        stiffness=7.0, yield_torque=0.0, yield_curve=((1.0, 1.0), (2.0, 0.0))
    )
    third = Jenkin(
        stiffness=2.0, yield_torque=0.0, yield_curve=((1.0, 0.0), (2.0, 1.0))
    )
    three = (first, second, third)
    assert sticking_stiffness(three) == 12.0
    found = [sticking_stiffness(three, t) for t in (0.0, 0.5, 1.0, -1.5, 9.0)]
    assert found == [5.0, 12.0, 7.0, 9.0, 2.0]
    assert sticking_stiffness((*three, Jenkin(stiffness=1.0, yield_torque=1.0))) == 13.0
    assert sticking_stiffness(()) == 0.0 == sticking_stiffness((), 1.0)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 10, 101, 1000])
def test_stretches_are_those_of_one_step_after_another(count):
    """Bit for bit, with a constant reach and with one that changes."""
    rng = np.random.default_rng(count)
    torsion = np.cumsum(rng.normal(size=count))
    for reach in (0.7, 0.0, rng.uniform(0.0, 5.0, count)):
        limits, rest, wanted = np.broadcast_to(reach, count), 0.0, np.empty(count)
        for k, (x, limit) in enumerate(zip(torsion, limits, strict=True)):
            rest = min(max(rest, x - limit), x + limit)
            wanted[k] = x - rest
        assert np.array_equal(stretches(torsion, reach), wanted)

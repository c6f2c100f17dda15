"""The friction law: passive over any history, stiction, closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swgjoint.maps.friction import Friction, continue_friction, play_bristle

LAW = Friction(
    stiffness=50.0,
    coulomb=0.04,
    static=0.07,
    stribeck_speed=3.0,
    viscous=6e-4,
    load=0.1,
    bending=0.005,
)
smooth = st.lists(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 6.28)),
    min_size=1,
    max_size=4,
)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(
    motion=smooth,
    load=smooth,
    size=st.floats(1e-4, 10.0),
    stiffness=st.floats(1.0, 1e3),
    damping=st.floats(0.0, 1.0),
)
def test_no_cycle_gains_energy_and_one_that_slips_loses(
    motion, load, size, stiffness, damping
):
    """Over any part of random motions under random loads: work >= energy stored.

    A cycle stores nothing, so none gains; one that slips loses at least the Coulomb
    torque times the way beyond the reach. Torque at the end of each way: for a bristle
    that backward rule never counts less than the work.
    """
    law = Friction(
        stiffness=stiffness,
        coulomb=0.04,
        static=0.07,
        stribeck_speed=3.0,
        load=0.3,
        damping=damping,
    )
    t = np.linspace(0.0, 3.0, 6_001)  # three periods

    def wave(parts):
        return sum(
            (a * np.sin(2 * np.pi * k * t + phase) + b * np.sin(2 * np.pi * k * t)) / k
            for k, (a, b, phase) in enumerate(parts, 1)
        )

    x, torque = size * wave(motion), wave(load)
    dx = np.diff(x, prepend=x[0])
    speed = dx / t[1]
    f = continue_friction(law, x, speed, torque)[0]
    reach = law.yield_torque(speed, torque) / stiffness
    z, _ = play_bristle(x, reach)
    work, stored = np.cumsum(f * dx), 0.5 * stiffness * z**2
    slack = 1e-12 * float(np.abs(f * dx).sum()) + 1e-15
    for first, last in ((0, 2000), (2000, 4000), (4000, 6000), (100, 5321)):
        gained = stored[last] - stored[first]
        assert work[last] - work[first] >= gained - slack
    swing = float(np.ptp(x))
    if swing > 4.0 * reach.max():
        lost = work[-1] - work[4000] - (stored[-1] - stored[4000])
        assert lost > 0.04 * (swing - 4.0 * reach.max())


def test_a_slow_cycle_loses_four_f_times_the_slip():
    """Closed form of one elasto-plastic element, and nothing below its yield."""
    law = Friction(stiffness=50.0, coulomb=0.05, static=0.05)
    turn = np.linspace(0.0, 4.0 * np.pi, 40_001)
    for amplitude, loss in ((0.01, 4 * 0.05 * (0.01 - 0.001)), (9e-4, 0.0)):
        x = amplitude * np.sin(turn)
        f = continue_friction(law, x, 0.0 * x, 0.0 * x)[0]
        last = slice(20_000, None)
        found = np.trapezoid(f[last], x[last])
        assert found == pytest.approx(loss, rel=1e-3, abs=1e-12)


def test_the_torque_of_steady_slip():
    """Bending, Coulomb, what is left of the static part, load and viscous parts add."""
    speed, load = 6.0, -0.5
    left = 0.03 * np.exp(-4.0)
    expected = 0.005 + 0.04 + left + 0.1 * 0.5 + 6e-4 * 6.0
    assert LAW.steady(speed, load) == pytest.approx(expected, rel=1e-12)
    assert LAW.steady(-speed, load) == pytest.approx(-expected, rel=1e-12)
    x = speed * np.linspace(0.0, 1.0, 1001)
    played, _ = continue_friction(LAW, x, np.full(1001, speed), np.full(1001, load))
    assert played[0] == pytest.approx(6e-4 * 6.0)  # relaxed
    assert played[-1] == pytest.approx(expected, rel=1e-12)
    assert LAW.torque(x[-1], speed, load) == pytest.approx(expected, rel=1e-12)
    # at rest it holds up to the static torque, as a spring
    assert LAW.torque(1e-3, 0.0, 0.0) == pytest.approx(0.05)
    assert LAW.torque(1.0, 0.0, 0.0) == pytest.approx(0.075)


def test_a_load_that_swings_below_yield_does_not_drift():
    """A thousand swings between 20 and 95 % of yield end where the first one ended."""
    law = Friction(stiffness=50.0, coulomb=0.05, static=0.05)
    z = np.concatenate([[0.0], np.tile([0.95e-3, 0.2e-3], 1000)])
    f = continue_friction(law, z, np.gradient(z), 0.0 * z)[0]
    np.testing.assert_allclose(f[1:], 50.0 * z[1:], rtol=1e-12)

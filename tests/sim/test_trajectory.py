"""Commanded motions: derivatives, ends, constant speed."""

import numpy as np
import pytest

from swgjoint.sim.motion.trajectory import constant_speed, sweep

START, END = np.array([0.3, -1.0, 0.5]), np.array([1.3, -1.4, 0.5])


def one_sweep(step: float = 1e-3):
    return sweep(
        start=START, end=END, duration=3.0, step=step, hold=0.3, ramp=0.7, settle=0.1
    )


def test_a_sweep_goes_from_start_to_end_at_rest():
    """First and last sample are the given poses, without speed."""
    path = one_sweep()
    np.testing.assert_allclose(path.position[[0, -1]], [START, END], atol=1e-12)
    assert not path.velocity[[0, -1]].any()
    assert not path.acceleration[[0, -1]].any()


def test_velocity_and_acceleration_are_derivatives():
    """Differences of position and velocity give velocity and acceleration."""
    path, h = one_sweep(), 1e-3
    slope = (path.position[2:] - path.position[:-2]) / (2 * h)
    bend = (path.velocity[2:] - path.velocity[:-2]) / (2 * h)
    # h²/6 times the second derivative: 60 v / ramp³ = 103 rad/s⁴ for the acceleration
    np.testing.assert_allclose(slope, path.velocity[1:-1], atol=1e-5)
    np.testing.assert_allclose(bend, path.acceleration[1:-1], atol=1.8e-5)


def test_acceleration_has_no_jump():
    """The position is twice continuously differentiable: steps of it shrink with h."""
    jumps = [
        np.abs(np.diff(one_sweep(h).acceleration, axis=0)).max() for h in (2e-3, 1e-3)
    ]
    assert jumps[1] == pytest.approx(jumps[0] / 2, rel=0.05)


def test_the_window_has_the_stated_speed():
    """In the steady part every joint has its constant speed, after settling."""
    path = one_sweep()
    window = path.velocity[path.steady]
    np.testing.assert_allclose(window, np.tile(path.steady_velocity, (len(window), 1)))
    assert path.time[path.steady][0] == pytest.approx(1.1)
    assert path.time[path.steady][-1] == pytest.approx(2.0)
    assert path.top_speed == pytest.approx(np.abs(path.steady_velocity))


def test_constant_speed_starts_at_speed():
    """The first sample moves already and the last has gone speed times duration."""
    speed = np.array([0.1, -0.2, 0.0])
    path = constant_speed(start=START, speed=speed, duration=2.0, step=1e-3)
    np.testing.assert_allclose(path.velocity[0], speed)
    np.testing.assert_allclose(path.position[-1], START + 2.0 * speed)
    assert path.time.size == 2001

"""Motions are smooth, begin at rest and stay within their limits; errors are sized."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.envs.references import (
    FREQUENCIES,
    HOLD,
    KINDS,
    PARTS,
    RAMP,
    Instants,
    draw_motion,
)
from swgjoint.envs.specimen import drive_of_environment
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import peak_to_peak
from swgjoint.units import arcmin

TIME = np.arange(2001) * 1e-3
STEP = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])


def simple_step(time, duration):
    """The smooth step and two derivatives, by numpy's polynomials."""
    x = np.clip(time / duration, 0.0, 1.0)
    return [STEP.deriv(k)(x) / duration**k if k else STEP(x) for k in range(3)]


def simple_oscillation(time, frequency, phase, weight):
    """A sum of sines with its ramp, all instants and sines in one array."""
    omega = 2.0 * np.pi * frequency
    angle = omega * time[:, None] + phase
    sin, cos = weight * np.sin(angle), weight * np.cos(angle)
    y = sin.sum(axis=1) - sin[0].sum()
    y_1, y_2 = (omega * cos).sum(axis=1), (-(omega**2) * sin).sum(axis=1)
    w, w_1, w_2 = simple_step(time, RAMP)
    return w * y, w_1 * y + w * y_1, w_2 * y + 2.0 * w_1 * y_1 + w * y_2


def simple_motion(time, rng, kind, limits):
    """What ``draw_motion`` draws, with no thought of speed. Shape (3, n)."""
    rng.integers(1)
    if kind == "point_to_point":
        first = rng.uniform(0.3, 0.6) * time[-1]
        there = simple_step(time - HOLD, first - 2.0 * HOLD)
        back = simple_step(time - first - HOLD, time[-1] - first - 2.0 * HOLD)
        motion = [x - 0.5 * y for x, y in zip(there, back, strict=True)]
    elif kind == "sinusoid":
        frequency = rng.uniform(*FREQUENCIES, 1)
        phase = rng.uniform(0, 2 * np.pi, 1)
        motion = simple_oscillation(time, frequency, phase, np.ones(1))
    else:
        frequency = np.exp(rng.uniform(*map(float, np.log(FREQUENCIES)), PARTS))
        phase = rng.uniform(0, 2 * np.pi, PARTS)
        motion = simple_oscillation(time, frequency, phase, 1.0 / frequency)
    tops = [float(np.abs(one).max()) for one in motion]
    size = min(limit / top for limit, top in zip(limits, tops, strict=True))
    size *= float(rng.uniform(0.4, 1.0) * rng.choice([-1.0, 1.0]))
    return size * np.array(motion)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", [1e-3, 7e-3])
def test_motions_are_those_of_the_simple_formulas(kind, step):
    """The same numbers, to the last bit; a part of a motion is part of the whole."""
    time = np.arange(round(1.9 / step)) * step
    instants = Instants(time)
    for seed in range(20):
        got, want = (np.random.default_rng(seed) for _ in range(2))
        drawn, whole = draw_motion(
            instants,
            got,
            kinds=(kind,),
            max_speed=0.6,
            max_angle=0.4,
            max_acceleration=50.0,
        )
        simple = simple_motion(time, want, kind, (0.4, 0.6, 50.0))
        np.testing.assert_array_equal(whole, simple)
        for part in (slice(0, 5), slice(40, 41), slice(90, 200), slice(30, time.size)):
            np.testing.assert_array_equal(drawn.sample(instants, part), simple[:, part])
        assert got.uniform() == want.uniform()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("top", [0.5, 50.0])
def test_motions_are_their_own_derivatives(kind, seed, top):
    """Speed and acceleration are those of the angle; limits hold; rest at the start."""
    _, (q, v, a) = draw_motion(
        Instants(TIME),
        np.random.default_rng(seed),
        kinds=(kind,),
        max_speed=0.6,
        max_angle=0.4,
        max_acceleration=top,
    )
    slope = np.gradient(q, TIME, edge_order=2)
    np.testing.assert_allclose(slope, v, atol=2e-4 * np.abs(v).max())
    bend = np.gradient(v, TIME, edge_order=2)
    np.testing.assert_allclose(bend, a, atol=2e-3 * np.abs(a).max())
    shares = np.abs([q, v, a]).max(axis=1) / [0.4, 0.6, top]
    assert 0.4 <= shares.max() <= 1.0 + 1e-12
    assert (shares.argmax() == 2) == (top < 2.0)
    np.testing.assert_allclose([q[0], v[0], a[0]], 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_fourth_derivative_is_continuous(kind):
    """Second differences of the acceleration change little from step to step."""
    rng = np.random.default_rng(0)
    time = np.arange(20001) * 1e-4
    _, (_, _, a) = draw_motion(
        Instants(time),
        rng,
        kinds=(kind,),
        max_speed=0.6,
        max_angle=0.4,
        max_acceleration=50.0,
    )
    snap = np.diff(a, 2) / 1e-8
    # a jump would stay as large at any step; a slope shrinks with the step
    assert np.abs(np.diff(snap)).max() < 0.02 * np.abs(snap).max()


def test_an_environment_has_the_error_that_it_asks_for():
    """That of the catalogue, one of its own, none; a map is taken as it is."""
    whole = DriveMap.from_catalogue("CSG-25-100")
    plain = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)
    for wanted, of, error in (
        (1.0, "CSG-25-100", None),
        (2.5, "CSG-25-100", 2.5),
        (0.0, "CSG-25-100", 0.0),
        (1.0, whole, None),
        (0.0, plain, None),
        (2.5, plain, 2.5),
    ):
        drive = drive_of_environment(of, error)
        assert peak_to_peak(drive) / arcmin == pytest.approx(wanted, rel=0.05)
    np.testing.assert_array_equal(
        drive_of_environment("CSG-25-100", None).kinematic_error, whole.kinematic_error
    )
    with pytest.raises(
        InputError, match=naming("kinematic_error_arcmin", "1", "'CSG-25-100'")
    ):
        drive_of_environment(whole, 1.0)

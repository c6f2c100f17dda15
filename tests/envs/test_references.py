"""Motions are smooth, begin at rest and stay within their limits; errors are sized."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.envs.references import KINDS, draw_motion
from swgjoint.envs.specimen import drive_of_environment
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import peak_to_peak
from swgjoint.units import arcmin

TIME = np.arange(2001) * 1e-3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("top", [0.5, 50.0])
def test_motions_are_their_own_derivatives(kind, seed, top):
    """Speed and acceleration are those of the angle; limits hold; rest at the start."""
    q, v, a = draw_motion(
        TIME,
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
    _, _, a = draw_motion(
        time, rng, kinds=(kind,), max_speed=0.6, max_angle=0.4, max_acceleration=50.0
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

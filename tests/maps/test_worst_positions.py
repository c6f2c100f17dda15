"""Positions at which a map is validated because it is likely to be least accurate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from known_samples import RATINGS, N, samples_of

from swgjoint.maps.fit.contact_corners import ContactCorners
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.fit.sample_curves import curves_at
from swgjoint.maps.fit.worst_positions import (
    EXTRA,
    LEAST,
    UNCERTAIN,
    worst_positions,
)
from swgjoint.maps.samples import FullSolves

ANGLES = 24
STEP = 2.0 * np.pi / N / ANGLES
UNSEEN = FullSolves(
    input_angle=np.full(5, 0.4 * STEP),
    torque=np.array([0.0, -33.0, -11.0, 11.0, 33.0]),
    output_error=np.zeros(5),
    input_torque=np.zeros(5),
)


def cornered(place: float, **keys):
    """Samples whose kinematic error has one corner, at a place in steps."""
    samples = samples_of(n_angles=ANGLES, **keys)
    corner = 1e-5 * np.abs(np.sin(0.5 * N * (samples.input_angle - place * STEP)))
    error = samples.output_error + corner
    return replace(samples, output_error=error, unseen=UNSEEN)


def from_corner(positions, place):
    """Distances of positions from the corner in steps."""
    apart = np.array([angle for _, angle in positions]) / STEP - place
    return np.abs((apart + 0.5 * ANGLES) % ANGLES - 0.5 * ANGLES)


@pytest.mark.parametrize("place", [6.5, 15.3, 0.2])
def test_positions_are_at_the_corner(place):
    """The output error is worst there; regular angles would seldom be near it."""
    samples = cornered(place)
    positions = worst_positions(fit_map(samples), samples)
    # the corner is between two samples; interpolation does not know where
    near = from_corner(positions, place) < 1.5
    # at every validation torque, and at other positions more often than by chance (1/8)
    found = {torque for (torque, _), at in zip(positions, near, strict=True) if at}
    assert set(UNSEEN.torque[UNSEEN.torque != 0.0]) <= found
    assert near.sum() > 12
    assert near.mean() > 0.15
    # without the corner other places are worst
    smooth = replace(samples_of(n_angles=ANGLES), unseen=UNSEEN)
    others = worst_positions(fit_map(smooth), smooth)
    assert np.mean(from_corner(others, place) < 1.5) < 0.5


def test_positions_lie_at_validation_torques_and_between_samples():
    """At each validation torque and at others of both signs that are apart."""
    samples = cornered(6.5)
    drive = fit_map(samples)
    torques = np.array([torque for torque, _ in worst_positions(drive, samples)])
    angles = np.array([angle for _, angle in worst_positions(drive, samples)])
    assert {-33.0, -11.0, 11.0, 33.0} <= set(torques)
    assert 0.0 not in torques
    other = ~np.isin(torques, UNSEEN.torque)
    for sign in (-1.0, 1.0):
        assert 0 < np.count_nonzero(torques[other] * sign > 0.0) <= 2 * EXTRA
    assert not np.isclose(angles / STEP, np.round(angles / STEP)).any()
    assert (np.abs(torques) < RATINGS.repeated_peak).all()


def test_only_sampled_signs_are_validated():
    """The mirrored torques of a symmetric drive need no solves."""
    samples = cornered(6.5)
    half = UNSEEN.torque >= 0.0
    one_sign = replace(
        UNSEEN,
        **{
            key: getattr(UNSEEN, key)[half]
            for key in ("input_angle", "torque", "output_error", "input_torque")
        },
    )
    samples = replace(samples, unseen=one_sign)
    assert all(torque > 0.0 for torque, _ in worst_positions(fit_map(samples), samples))


def test_positions_include_those_where_the_load_curves_are_least_certain():
    """Relative to the peak to peak at the torque, within the torques of the map."""
    samples = cornered(6.5)
    drive = fit_map(samples)
    torque = np.linspace(0.5, 1.05 * RATINGS.repeated_peak, 2 * UNCERTAIN)
    height = np.ptp(curves_at(samples, np.minimum(torque, drive.torque_range[1]))[0], 1)
    rank = np.random.default_rng(2).permutation(torque.size)
    angle = samples.input_angle[rank % ANGLES]
    places = np.column_stack([torque, angle, (1.0 + rank) * height])
    none = np.zeros(0)
    corners = ContactCorners(
        angle=samples.input_angle,
        period=ANGLES * STEP,
        start=none,
        step=none,
        torque=np.zeros((0, 2)),
        jump=none,
        uncertain=places,
    )
    without = replace(corners, uncertain=places[:0])
    found, others = (
        set(worst_positions(drive, samples, {1.0: one})) for one in (corners, without)
    )
    more = found - others
    inside = (torque > LEAST * RATINGS.repeated_peak) & (torque < RATINGS.repeated_peak)
    inside &= torque < drive.torque_range[1]
    assert inside.sum() > UNCERTAIN
    worst = np.flatnonzero(inside)[rank[inside].argsort()[-UNCERTAIN:]]
    expected = {(float(torque[k]), float(angle[k])) for k in worst}
    assert more == expected

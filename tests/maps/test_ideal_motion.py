"""The map about its ideal motion, against plain sums over harmonics and intervals."""

from __future__ import annotations

import numpy as np

from swgjoint.maps.ideal_motion import IdealMotion
from swgjoint.maps.sheet.turn import error_turn, measure_turns, period_of, ripple_turn


def test_polynomials_are_those_of_the_sums_in_all_intervals(synthetic_map):
    """Each position takes its interval from the table of all intervals."""
    theta = np.linspace(0.0, 40.0, 57)
    at = IdealMotion.from_map(synthetic_map, theta)
    table = synthetic_map.potential
    phases, n_psi = (
        synthetic_map.phases(theta, at.about),
        synthetic_map.angle_orders.T[1],
    )
    cos, sin = np.cos(phases), np.sin(phases)
    slope = [-n_psi * sin, n_psi * cos]
    factors = np.array([[cos, sin], slope, [-(n_psi**2) * cos, -(n_psi**2) * sin]])
    every = np.einsum("abtk,kb...->at...", factors, table)
    intervals = np.random.default_rng(3).integers(0, table.shape[2], (3, theta.size))
    # the last third stays in the intervals of the call before
    intervals[1:, 38:] = intervals[0, 38:]
    there = None
    for interval in intervals:
        there = at.polynomials(interval, there)
        wanted = every[:, np.arange(theta.size), interval]
        assert np.array_equal(there.interval, interval)
        error = np.abs(there.coefficients - wanted).max(axis=(0, 1))
        assert (error <= 1e-12 * np.abs(wanted).max(axis=(0, 1))).all()
    assert at.polynomials(intervals[-1], there) is there


def test_torque_and_stiffness_are_those_of_the_full_map(synthetic_map):
    """At psi_0 itself nothing is left out; the torque has the slope -stiffness."""
    theta = np.linspace(0.0, 400.0, 101)
    about = theta / synthetic_map.ratio + np.linspace(-0.004, 0.004, theta.size)
    at = IdealMotion.from_map(synthetic_map, theta, about)
    none, step = np.zeros(theta.size), 1e-9
    torque, stiffness, _ = at.torque(none)
    wanted = synthetic_map.forces(theta, about)[1]
    assert np.abs(torque - wanted).max() < 1e-12 * np.abs(wanted).max()
    change = at.torque(none - step)[0] - at.torque(none + step)[0]
    assert np.abs(0.5 * change / step / stiffness - 1.0).max() < 1e-5  # differences


def test_no_term_of_second_degree_is_missing(synthetic_map):
    """At twice the distance from psi_0, the torque misses about 8 times as much.

    A wrong term of second degree would make it 2 to 4 times. There, too, the torque has
    the slope -stiffness.
    """
    theta = np.linspace(0.0, 400.0, 101)
    about = theta / synthetic_map.ratio + np.linspace(-0.004, 0.004, theta.size)
    at = IdealMotion.from_map(synthetic_map, theta, about)
    highest = np.abs(synthetic_map.angle_orders[:, 1]).max()
    missed = []
    for part in (0.002, 0.004):
        shift = np.full(theta.size, part / highest)
        torque, stiffness, _ = at.torque(shift)
        wanted = synthetic_map.forces(theta, about + shift)[1]
        missed.append(np.abs(torque - wanted).max())
        step = 1e-9
        change = at.torque(shift - step)[0] - at.torque(shift + step)[0]
        assert np.abs(0.5 * change / step / stiffness - 1.0).max() < 1e-5
    assert missed[1] / missed[0] > 6.0


def test_signals_measured_at_once_are_those_measured_one_by_one(synthetic_map):
    """Bit for bit, with the number of finished positions reported."""
    seen = []
    turns = measure_turns(
        synthetic_map,
        error={"free": 0.0, "loaded": 50.0},
        ripple={"ripple": 50.0},
        progress=lambda stage, done, total: seen.append((done, total)),
    )
    alone = {
        "free": error_turn(synthetic_map),
        "loaded": error_turn(synthetic_map, 50.0),
        "ripple": ripple_turn(synthetic_map, 50.0),
    }
    assert set(turns) == set(alone)
    for key, turn in alone.items():
        assert np.array_equal(turns[key].signal, turn.signal)
        assert turns[key].period_turns == turn.period_turns
    done, total = zip(*seen, strict=True)
    assert done[0] == 0 and done[-1] == total[-1] and sorted(done) == list(done)


def test_transforms_over_the_period_equal_sums_at_single_angles(synthetic_map):
    """Angles under load and torques on the ideal motion, to round-off."""
    period, count = period_of(synthetic_map)
    whole = IdealMotion.over_period(synthetic_map, float(period), count)
    some = slice(0, None, max(1, count // 50))
    at = IdealMotion.from_map(synthetic_map, whole.theta[some])
    torque = synthetic_map.ratings.rated_torque
    for load in (-torque, 0.0, torque):
        np.testing.assert_allclose(
            whole.output_angle(load)[some] - at.about,
            at.output_angle(load) - at.about,
            rtol=0.0,
            atol=1e-14,
        )
    shift = np.full(count, -synthetic_map.mean_torsion(torque))
    for long, short in zip(
        whole.torque(shift)[:2], at.torque(shift[some]), strict=False
    ):
        np.testing.assert_allclose(long[some], short, rtol=1e-11, atol=1e-9)


def test_signals_are_those_of_the_full_map(synthetic_map):
    """Also under load, where the output is 5 mrad from theta/i."""
    load = synthetic_map.ratings.rated_torque
    turns = measure_turns(synthetic_map, {"error": load}, {"ripple": load})
    count = turns["error"].signal.size
    some = np.arange(0, count, max(1, count // 50))
    theta = 2.0 * np.pi * float(turns["error"].period_turns) * some / count
    ideal = theta / synthetic_map.ratio
    twist = synthetic_map.mean_torsion(load)
    wanted = synthetic_map.forces(theta, ideal - twist)[1]
    found = turns["ripple"].signal[some]
    assert np.abs(found - wanted).max() < 1e-9 * np.ptp(wanted)
    angle = ideal + turns["error"].signal[some]
    torque = synthetic_map.forces(theta, angle)[1]
    assert np.abs(torque - load).max() < 1e-6 * np.ptp(wanted)

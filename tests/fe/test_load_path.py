"""The load path between equilibria: jumps of the compliance against closed forms."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from messages import naming

from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.load_path import CHANCE, PLACES, LoadPath, least_certain

ERROR, ENERGY, COMPLIANCE = 1e-4, 1e-3, 6e-5


def drive(torque, jumps=(), slope=0.0):
    """Error, energy, compliance of C = C0 + slope T + jumps; shape (3, n).

    The energy is the integral of T C.
    """
    t = np.asarray(torque, float)
    error = ERROR - COMPLIANCE * t - 0.5 * slope * t**2
    energy = ENERGY + 0.5 * COMPLIANCE * t**2 + slope * t**3 / 3.0
    compliance = COMPLIANCE + slope * t
    for place, jump in jumps:
        beyond = t > place
        error = error - jump * np.maximum(t - place, 0.0)
        energy = energy + 0.5 * jump * np.where(beyond, t**2 - place**2, 0.0)
        compliance = compliance + jump * beyond
    return np.stack([error, energy, compliance])


def path(torque, jumps=(), slope=0.0):
    error, energy, compliance = drive(torque, jumps, slope)
    return LoadPath(
        torque=np.asarray(torque, float),
        output_error=error,
        energy=energy,
        compliance=compliance,
    )


TORQUES = np.array([0.0, 10.0, 22.0, 30.0, 47.0])
FINE = np.linspace(0.0, 47.0, 942) + 1e-3 * np.pi * np.r_[0.0, np.ones(940), 0.0]
EVENTS = ((3.0, -1e-5), (17.3, 2e-5), (29.0, -5e-6))
ROUND_OFF = np.array([1e-12, 1e-11, 1e-12])
"""Of error, energy and compliance, next to 1e-3 rad, 1e-1 J and 1e-4 rad/(N·m)."""


def test_one_event_in_each_interval_is_exact():
    """Error, energy and compliance between the samples, to round-off."""
    apart = np.abs(path(TORQUES, EVENTS).evaluate_at(FINE) - drive(FINE, EVENTS)).max(
        axis=1
    )
    assert (apart < ROUND_OFF).all()


def test_events_are_found_where_they_are():
    """One place and size in each interval that has an event, none in the others."""
    torque, size = path(TORQUES, EVENTS).jumps
    assert torque == pytest.approx([place for place, _ in EVENTS], abs=1e-6)
    assert size == pytest.approx([abs(jump) for _, jump in EVENTS], rel=1e-6)


def test_what_one_event_explains_leaves_only_the_chance_in_doubt():
    """A hundredth of the length times the change of the compliance."""
    curve = path(TORQUES, EVENTS)
    error, potential = curve.doubt
    chance = CHANCE * np.diff(TORQUES) * np.abs(np.diff(curve.compliance))
    assert error == pytest.approx(chance, abs=1e-11)
    assert np.abs(potential).max() < 1e-9 * ENERGY


def test_one_event_on_a_slope_is_exact():
    """Compliance that grows steadily and jumps once."""
    given = (((4.0, -8e-6),), 2e-7)
    one = path([0.0, 10.0], *given)
    explained = one._explained[0]
    assert explained.power[0, 1] / 10.0 == pytest.approx(2e-7, rel=1e-6)
    assert explained.place[0, 0] == pytest.approx(0.4, rel=1e-6)
    # two equal jumps explain it as well: the curve lies between, the doubt says so
    x = np.linspace(0.0, 10.0, 101)
    apart = np.abs(one.evaluate_at(x) - drive(x, *given))[0].max()
    assert apart <= one.doubt[0][0]


def test_two_equal_events_are_among_the_explanations():
    """Their places come out, and the doubt covers what one event would say."""
    events = ((2.0, -6e-6), (7.0, -6e-6))
    one = path([0.0, 10.0], events)
    places = np.sort(one._explained[1].place[0]) * 10.0
    assert places == pytest.approx([2.0, 7.0], rel=1e-6)
    x = np.linspace(0.0, 10.0, 101)
    assert np.abs(one.evaluate_at(x) - drive(x, events))[0].max() <= one.doubt[0][0]


def test_a_smooth_path_is_that_of_its_compliance():
    """Compliance in proportion to the torque, no jump: exact, and no events."""
    given = ((), 5e-7)
    curve = path(TORQUES, *given)
    error, energy, _ = np.abs(curve.evaluate_at(FINE) - drive(FINE, *given)).max(axis=1)
    # both explanations count, a slope and two jumps a fifth from the ends
    assert error <= curve.doubt[0].max()
    assert error < 0.02 * (5e-7 * 17.0) * 17.0
    assert energy < 47.0 * error


def test_the_potential_balances_between_the_samples():
    """dG/dT = e and de/dT = -C along the curve, three events in one interval too."""
    events = ((3.0, -1e-5), (12.0, 2e-5), (14.0, -7e-6), (19.0, 3e-6))
    curve = path(TORQUES, events)
    places = np.concatenate(
        [np.linspace(a + 0.1, b - 0.1, 200) for a, b in pairwise(TORQUES)]
    )
    step = 1e-4
    error, _, compliance = curve.evaluate_at(places)
    up, down = curve.evaluate_at(places + step), curve.evaluate_at(places - step)
    potential = [
        v[1] + t * v[0] for v, t in ((up, places + step), (down, places - step))
    ]
    assert (potential[0] - potential[1]) / (2 * step) == pytest.approx(error, abs=1e-9)
    smooth = np.abs(up[2] - down[2]) < 1e-8
    slope = (down[0] - up[0])[smooth] / (2 * step)
    assert smooth.sum() > 700
    assert slope == pytest.approx(compliance[smooth], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_equilibria_come_back_bit_for_bit(seed):
    """Whatever the samples, the curve passes through them."""
    rng = np.random.default_rng(seed)
    given = path(np.cumsum(rng.uniform(0.5, 9.0, 7)), EVENTS)
    own = np.stack([given.output_error, given.energy, given.compliance])
    assert np.array_equal(given.evaluate_at(given.torque), own)


def test_the_doubt_tells_how_far_off_the_curve_is():
    """Random events: the worst interval is foretold within a factor of three."""
    rng = np.random.default_rng(5)
    told, true = [], []
    for _ in range(40):
        events = [(p, 1e-5 * rng.normal()) for p in rng.uniform(0.0, 47.0, 12)]
        curve, x = path(TORQUES, events), np.linspace(0.0, 47.0, 800)
        apart = np.abs(curve.evaluate_at(x)[0] - drive(x, events)[0])
        told.append(curve.doubt[0].max())
        true.append(apart.max())
    ratio = np.array(true) / np.array(told)
    assert np.median(ratio) < 1.0
    assert np.quantile(ratio, 0.9) < 3.0
    assert np.quantile(ratio, 0.1) > 0.1


def test_dividing_where_it_says_makes_the_curve_exact():
    """Halved interval by interval, three events end in intervals of their own."""
    events = ((3.0, -1e-5), (12.0, 2e-5), (14.0, -7e-6))
    torque = np.array([0.0, 47.0])
    x = np.linspace(0.0, 47.0, 800)
    for _ in range(40):
        curve = path(torque, events)
        part = curve.doubt[0]
        torque = np.sort(np.append(torque, curve.division[part.argmax()]))
    apart = path(torque, events).evaluate_at(x) - drive(x, events)
    assert np.abs(apart[0]).max() < 1e-9


MANY = tuple(
    (float(p), 1e-5 * float(j))
    for p, j in np.random.default_rng(3).uniform((0.5, -1.0), (46.5, 1.0), (12, 2))
)
"""Events, several in every interval."""


def predicted(torque, jumps, bend=0.0):
    """What each equilibrium predicts.

    Its events are off by ``bend`` [1/(N·m)] times the square of their distance.
    """
    found = []
    for own in np.asarray(torque, float):
        events = sorted(
            (p + bend * (p - own) ** 2, k) for k, (p, _) in enumerate(jumps)
        )
        places, numbers = (np.array(v) for v in zip(*events, strict=True))
        steps = np.array([jumps[k][1] for k in numbers])
        found.append(
            ContactChanges(
                torque=places,
                contact=numbers,
                compliance=COMPLIANCE + np.cumsum([0.0, *steps]),
            )
        )
    return tuple(found)


def test_predicted_events_make_the_curve_exact():
    """Twelve events in four intervals, their places and steps known, on a slope."""
    given = MANY, 2e-8
    plain = path(TORQUES, *given)
    curve = replace(plain, changes=predicted(TORQUES, MANY))
    apart = np.abs(curve.evaluate_at(FINE) - drive(FINE, *given)).max(axis=1)
    assert (apart < ROUND_OFF).all()
    assert np.abs(plain.evaluate_at(FINE)[0] - drive(FINE, *given)[0]).max() > 1e-6
    assert curve.doubt[0].max() < 1e-3 * plain.doubt[0].max()
    own = np.stack([curve.output_error, curve.energy, curve.compliance])
    assert np.array_equal(curve.evaluate_at(TORQUES), own)


def test_the_doubt_of_predictions_tells_how_far_off_they_are():
    """Events displaced by the square of the distance from the end that predicts."""
    plain = path(TORQUES, MANY)
    curve = replace(plain, changes=predicted(TORQUES, MANY, bend=2e-3))
    apart = np.abs(curve.evaluate_at(FINE)[0] - drive(FINE, MANY)[0]).max()
    assert 0.2 < apart / curve.doubt[0].max() < 2.0
    assert apart < 0.3 * np.abs(plain.evaluate_at(FINE)[0] - drive(FINE, MANY)[0]).max()


def test_without_a_prediction_of_both_ends_the_equilibria_alone_count():
    """An interval whose one end predicts nothing is as without predictions."""
    plain = path(TORQUES, MANY)
    given = list(predicted(TORQUES, MANY))
    given[1] = None
    curve = replace(plain, changes=tuple(given))
    inside = FINE < TORQUES[2]
    same = (one.evaluate_at(FINE[inside]) for one in (curve, plain))
    assert np.array_equal(*same)
    assert not np.array_equal(curve.evaluate_at(FINE), plain.evaluate_at(FINE))


def test_torques_outside_are_refused():
    """No extrapolation; the range is named."""
    curve = path(TORQUES, EVENTS)
    with pytest.raises(ValueError, match=naming("47.1", "47 N·m")):
        curve.evaluate_at([47.1])
    with pytest.raises(ValueError, match=naming("torque", "increase")):
        path([1.0, 1.0])


def test_places_where_curves_are_least_certain():
    """In each interval the angles with the largest doubts, no neighbours among them."""
    rng = np.random.default_rng(7)
    count = 24
    paths = [
        path(TORQUES, [(t, j * (1.0 + rng.random())) for t, j in EVENTS])
        for _ in range(count)
    ]
    found = least_certain(paths)
    intervals = len(TORQUES) - 1
    assert found.shape == (PLACES * intervals, 3)
    doubts = np.array([one.doubt[0] for one in paths])
    for j in range(intervals):
        number, torque, error = found[j::intervals].T
        number = number.astype(int)
        assert error[0] == doubts[:, j].max() and number[0] == doubts[:, j].argmax()
        assert error == pytest.approx(doubts[number, j])
        assert torque == pytest.approx([paths[k].division[j] for k in number])
        apart = np.abs((np.subtract.outer(number, number) + 12) % count - 12)
        assert apart[np.triu_indices(PLACES, 1)].min() > count / (2 * PLACES)

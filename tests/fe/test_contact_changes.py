"""Changes of contact that two ends of an interval predict, brought together."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming

from swgjoint.fe.common.contact_changes import ContactChanges, Steps

LOW, HIGH = 10.0, 30.0


def changes(*events, begin=2e-5):
    """Of (torque, contact, step of the compliance)."""
    torque, contact, jump = zip(*events, strict=True)
    return ContactChanges(
        torque=np.array(torque),
        contact=np.array(contact),
        compliance=begin + np.cumsum([0.0, *jump]),
    )


FIRST = changes((12.0, 7, 4e-6), (20.0, 3, -2e-6), (28.0, 5, 1e-6), (35.0, 1, 9e-6))
LAST = changes((12.8, 7, 5e-6), (21.0, 3, -2e-6), (29.0, 8, 3e-6))


def test_an_interval_has_the_changes_inside_it():
    """Places in parts of its length, steps of the compliance there."""
    steps = FIRST.steps_between(LOW, HIGH)
    assert steps.place == pytest.approx([0.1, 0.5, 0.9])
    assert steps.jump == pytest.approx([4e-6, -2e-6, 1e-6])
    assert steps.contact.tolist() == [7, 3, 5]


def test_what_both_ends_predict_is_one_step_next_to_the_nearer_prediction():
    """Errors grow with the square of the distance from the end."""
    first, last = FIRST.steps_between(LOW, HIGH), LAST.steps_between(LOW, HIGH)
    both = Steps.merge(first, last)
    place = dict(zip(both.contact.tolist(), both.place, strict=True))
    jump = dict(zip(both.contact.tolist(), both.jump, strict=True))
    assert set(place) == {7, 3, 5, 8}
    # in the middle the mean, near the first end its own place
    assert place[3] == pytest.approx(0.525, abs=5e-3)
    assert 0.1 < place[7] < 0.1 + 0.05 * (0.14 - 0.1)
    assert 4e-6 < jump[7] < 4.05e-6
    # alone: almost nothing far from the end that says so, almost all next to it
    assert jump[5] < 0.02 * 1e-6
    assert jump[8] > 0.98 * 3e-6


def test_small_changes_of_a_contact_do_not_displace_a_large_one():
    """A contact that changes by little first, according to one end only.

    Paired in order of occurrence, the small change of one end would be merged with the
    large one of the other, half-way between, and the large one of the first end halved.
    """
    first = changes((14.0, 3, 2e-9), (20.0, 3, 4e-6)).steps_between(LOW, HIGH)
    last = changes((20.4, 3, 4.4e-6)).steps_between(LOW, HIGH)
    both = Steps.merge(first, last)
    large = both.jump > 1e-6
    assert both.place[large] == pytest.approx([0.51], abs=5e-3)
    assert both.jump[large] == pytest.approx([4.2e-6], abs=1e-7)
    assert both.jump[~large].max() < 2e-9


def test_predictions_seen_in_a_mirror_are_those_of_opposite_torques():
    """The same steps the other way round; twice gives the first ones."""
    seen = FIRST.mirror()
    assert seen.torque == pytest.approx([-35.0, -28.0, -20.0, -12.0])
    assert seen.compliance == pytest.approx(FIRST.compliance[::-1])
    assert seen.contact.tolist() == [1, 5, 3, 7]
    again = seen.mirror()
    assert np.array_equal(again.torque, FIRST.torque)


def test_mean_and_moment_of_the_compliance_place_two_steps():
    """Two steps predicted beside their places come back, to the end of the fit."""
    true, size = np.array([0.31, 0.74]), np.array([5e-6, -3e-6])
    after = 1.0 - true
    mean = size @ after - 0.5 * size.sum()
    moment = 0.5 * size @ after**2 - size.sum() / 6.0
    steps = Steps(
        place=true + np.array([0.04, -0.03]),
        jump=size,
        contact=np.array([1, 2]),
        doubt=np.array([0.1, 0.1]),
    )
    found = steps.fit_moments(mean, moment, 1e-12)
    assert found.place == pytest.approx(true, abs=1e-4)
    # what a cubic takes is no reason to move a step
    assert steps.fit_moments(mean, moment, 1e-2).place == pytest.approx(
        steps.place, abs=1e-4
    )


def test_shapes_that_do_not_belong_together_are_refused():
    """One more compliance than changes."""
    with pytest.raises(ValueError, match=naming("compliance", "(3,)")):
        ContactChanges(
            torque=np.array([1.0, 2.0]),
            contact=np.array([0, 1]),
            compliance=np.array([1e-5, 2e-5]),
        )

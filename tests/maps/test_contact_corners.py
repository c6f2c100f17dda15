"""Corners between sampled angles, against a drive in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from swgjoint.maps.fit.contact_corners import ContactCorners

COUNT, PERIOD = 24, 0.05
ANGLE = PERIOD * np.arange(COUNT) / COUNT
FINE = PERIOD * (np.arange(COUNT * 8) + 0.5) / (COUNT * 8)
RATIO = -50.0
CONTACTS = {7: (20.0, 4.0, 3e-7), -3: (25.0, -6.0, -2e-7), 8: (20.4, -4.0, 2e-7)}
"""Mean torque and swing of the change of each contact [N·m], jump of the compliance
[rad/(N·m)]. Contacts 7 and 8 change within one step of the angle."""


def changes_at(theta, sign=1.0):
    """Torque [N·m], jump [rad/(N·m)] and number of all changes at one angle."""
    rows = [
        (mean + swing * np.sin(2.0 * np.pi * theta / PERIOD), sign * jump, number)
        for number, (mean, swing, jump) in CONTACTS.items()
    ]
    torque, jump, number = np.array(sorted(rows)).T
    return torque, jump, number.astype(int)


def drive(torque, theta):
    """Output error [rad], complementary potential [J] and its slope [N·m]."""
    error, potential, slope = np.zeros((3, theta.size))
    phase = 2.0 * np.pi * theta / PERIOD
    for mean, swing, jump in CONTACTS.values():
        above = np.maximum(torque - mean - swing * np.sin(phase), 0.0)
        error -= jump * above
        potential -= 0.5 * jump * above**2
        slope += jump * above * swing * np.cos(phase) * 2.0 * np.pi / PERIOD
    return error, potential, slope


def periodic(values):
    """Cubic spline through samples of one period."""
    ends = np.append(ANGLE, PERIOD), np.append(values, values[0])
    return CubicSpline(*ends, bc_type="periodic")


@pytest.mark.parametrize("torque", [18.3, 21.0, 23.1, 24.6])
def test_splines_miss_what_the_corners_predict(torque):
    """With sign and place, at all angles but in the last step of the period."""
    corners = ContactCorners.from_changes(ANGLE, PERIOD, [changes_at(t) for t in ANGLE])
    error, potential, _ = drive(torque, ANGLE)
    exact, _, slope = drive(torque, FINE)
    missed = periodic(error)(FINE) - exact, periodic(potential)(FINE, 1) - slope
    inside = FINE < ANGLE[-2]
    for known, predicted in zip(
        missed, corners.spline_errors(torque, FINE), strict=True
    ):
        # the torques of the changes are curved over the steps
        likeness = np.corrcoef(known[inside], predicted[inside])[0, 1]
        assert likeness > 0.95
        largest = np.abs(predicted[inside]).max()
        assert largest == pytest.approx(np.abs(known[inside]).max(), rel=0.2)


def test_no_change_no_corner():
    """Above all changes, and of a drive without any prediction."""
    corners = ContactCorners.from_changes(ANGLE, PERIOD, [changes_at(t) for t in ANGLE])
    none = [(np.zeros(0), np.zeros(0), np.zeros(0, int))] * COUNT
    for one, torque in (
        (corners, 40.0),
        (ContactCorners.from_changes(ANGLE, PERIOD, none), 20),
    ):
        assert all(not values.any() for values in one.spline_errors(torque, FINE))


def test_other_changes_of_a_contact_are_not_paired():
    """A contact that changes again far away, or in the other direction, has no pair."""
    one = np.array([20.0]), np.array([1e-7]), np.array([4])
    for torque, jump, number in (
        (21.0, 3e-7, 4),
        (21.0, -1e-7, 4),
        (21.0, 1e-7, 5),
    ):
        two = np.array([torque]), np.array([jump]), np.array([number])
        assert ContactCorners.from_changes(ANGLE[:2], PERIOD, [one, two]).jump.size == 0
    # nearest first: the one far away has no pair, although its jump is equal
    two = np.array([20.5, 50.0]), np.array([3e-7, 1e-7]), np.array([4, 4])
    assert ContactCorners.from_changes(ANGLE[:2], PERIOD, [one, two]).jump.size == 0

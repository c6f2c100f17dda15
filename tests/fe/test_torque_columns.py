"""Columns of equilibria over the torque: a drive in closed form instead of elements."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import pi

import numpy as np
import pytest

from swgjoint.errors import Outcome
from swgjoint.fe.common.columns import torque_choice
from swgjoint.fe.common.columns.torque_columns import ColumnGrid
from swgjoint.fe.common.contact_changes import ContactChanges
from swgjoint.fe.common.following import Unloaded

PEAK, STIFF = 10.0, 1e-3


@dataclass(frozen=True)
class Known:
    """An equilibrium of the drive below."""

    torque: float
    theta: float
    error: float = 0.0
    energy: float = 0.0
    compliance: float = 0.0
    moment: float = 0.0
    outcome: Outcome = Outcome.CONVERGED


@dataclass
class KnownDrive:
    """Compliance that drops by ``drop`` at torques that move with the angle."""

    drops: tuple[tuple[float, float], ...]
    """Mean torque of an event and its drop of the compliance."""
    ratio: float = -50.0
    swing: float = 0.4
    ways: list[tuple[str, float, float]] = field(default_factory=list)
    """Angle or torque that was changed, its value before and after."""

    def at(self, torque: float, theta: float) -> Known:
        """The equilibrium in closed form."""
        error, potential, moment = -STIFF * torque, -0.5 * STIFF * torque**2, 0.0
        compliance = STIFF
        for place, drop in self.drops:
            over = max(0.0, torque - place - self.swing * np.sin(theta))
            error += drop * over
            potential += 0.5 * drop * over**2
            moment -= drop * over * self.swing * np.cos(theta)
            compliance -= drop * (over > 0.0)
        return Known(
            torque=torque,
            theta=theta,
            error=error,
            energy=potential - torque * error,
            compliance=compliance,
            moment=moment + torque / self.ratio,
        )

    def deflect(self) -> Known:
        """As of a follower."""
        return self.at(0.0, 0.0)

    def engage(self, state: Known) -> Known:
        """As of a follower."""
        return state

    def unload(self, state: Known, small: float) -> Unloaded[Known]:
        """As of a follower."""
        return Unloaded(state=self.at(0.0, state.theta), small=small)

    def turn_unloaded(self, rest: Unloaded[Known], theta: float) -> Unloaded[Known]:
        """As of a follower."""
        return Unloaded(state=self.at(0.0, theta), small=rest.small)

    def to_torque(self, state: Known, torque: float) -> Known:
        """As of a follower, noted."""
        self.ways.append(("torque", state.torque, torque))
        return self.at(torque, state.theta)

    def to_angle(self, state: Known, theta: float) -> Known:
        """As of a follower, noted."""
        self.ways.append(("angle", state.theta, theta))
        return self.at(state.torque, theta)

    def near(self, state: Known) -> KnownDrive:
        """As of a follower, noted."""
        self.ways.append(("near", state.theta, state.torque))
        return self

    def extrapolate(self, state: Known, earlier: Known, theta: float) -> Known:
        """As of a follower, noted."""
        assert earlier.torque == state.torque
        self.ways.append(("trend", earlier.theta, state.theta))
        return state

    def predicted_changes(
        self, state: Known, low: float, high: float
    ) -> ContactChanges | None:
        """As of a follower that predicts none."""
        return None

    def output_angle(self, state: Known) -> float:
        """Psi [rad]."""
        return state.error + state.theta / self.ratio

    def input_torque(self, state: Known) -> float:
        """On the input [N·m]."""
        return state.moment


class FailingDrive(KnownDrive):
    """It has no equilibrium at one angle between two torques."""

    def to_torque(self, state: Known, torque: float) -> Known:
        """As of a follower."""
        return self._failing(super().to_torque(state, torque))

    def to_angle(self, state: Known, theta: float) -> Known:
        """As of a follower."""
        return self._failing(super().to_angle(state, theta))

    def _failing(self, found: Known) -> Known:
        if 2.0 < found.torque < PEAK and abs(found.theta - pi) < 0.1:
            return replace(found, outcome=Outcome.DIVERGED)
        return found


class ForeseeingDrive(KnownDrive):
    """Its equilibria predict all events of their angle."""

    def predicted_changes(
        self, state: Known, low: float, high: float
    ) -> ContactChanges | None:
        """As of a follower."""
        moved = self.swing * np.sin(state.theta)
        steps = [-drop for _, drop in self.drops]
        return ContactChanges(
            torque=np.array([place + moved for place, _ in self.drops]),
            contact=np.arange(len(self.drops)),
            compliance=STIFF + np.cumsum([0.0, *steps]),
        )


def grid(drive: KnownDrive, count: int = 6, levels=(2.0, PEAK)) -> ColumnGrid:
    found = ColumnGrid(
        follow=drive,
        period=2.0 * pi,
        finest=count,
        levels=list(levels),
        small=0.01,
        tick=lambda: None,
        keep=None,
    )
    found.solve_columns(count)
    return found


def test_a_torque_of_the_column_after_is_reached_by_turning_back():
    """Half the iterations of a change of the torque, from whichever side it is."""
    drive = KnownDrive(drops=((5.0, 2e-4),))
    columns = grid(drive)
    last = columns.columns[3]
    columns._more(last, [4.0])
    assert drive.ways[-1] == ("torque", 2.0, 4.0)
    middle = columns.columns[2]
    columns._more(middle, [4.0], [columns.columns[1], last])
    assert drive.ways[-1] == ("angle", last.theta, middle.theta)
    assert middle.states[4.0] == drive.at(4.0, middle.theta)
    columns._more(columns.columns[1], [6.0], [columns.columns[0], middle])
    assert drive.ways[-1][0] == "torque"


def test_columns_start_from_a_trend_and_share_a_tangent():
    """At each torque a tangent for four columns, and the trend of the last two."""
    drive = KnownDrive(drops=())
    columns = grid(drive)
    theta = [one.theta for _, one in columns.chosen(6)]
    near = [(a, b) for kind, a, b in drive.ways if kind == "near"]
    assert sorted(near) == sorted((a, t) for a in theta[:5:4] for t in (0.0, 2.0, PEAK))
    trend = [(a, b) for kind, a, b in drive.ways if kind == "trend"]
    pairs = list(pairwise(theta[:5]))
    assert sorted(trend) == [pair for pair in pairs for _ in range(3)]
    # the same for a torque that is added later, from the first column onwards
    begin = len(drive.ways)
    columns._add_torque(6, 5.0)
    near = [(a, b) for kind, a, b in drive.ways[begin:] if kind == "near"]
    assert near == [(a, 5.0) for a in theta[:5:4]]


def test_all_angles_get_the_same_torques():
    """Until the doubt meets the goal; no column turns the input by a pitch for it."""
    drive = KnownDrive(drops=((3.0, 2e-4), (5.0, 3e-4), (7.0, 1e-4)))
    columns = grid(drive)
    begin = len(drive.ways)
    assert columns.divide(6, 300, 0.02) <= 0.02
    assert len(columns.levels) > 4
    for _, column in columns.chosen(6):
        assert sorted(column.states) == columns.levels
    turned = [abs(b - a) for kind, a, b in drive.ways[begin:] if kind == "angle"]
    assert len(turned) == 5 * (len(columns.levels) - 2)
    assert max(turned) == pytest.approx(2.0 * pi / 6)


def test_division_ends_with_the_budget():
    """A torque for every angle, or none; what is left in doubt is told."""
    drops = tuple((1.0 + 0.53 * k, 4e-5 * (1 + k % 3)) for k in range(16))
    columns = grid(KnownDrive(drops=drops), count=8)
    before = columns.solves
    left = columns.divide(8, before + 8 * 5 + 7, 0.001)
    assert columns.solves == before + 8 * 5
    assert left > 0.001
    assert left == max(part for part, _ in columns._doubts(8))


def test_a_torque_that_fails_at_one_angle_is_no_common_one():
    """Its interval is left as it is, and the division of the others goes on."""
    drive = FailingDrive(drops=((1.5, 2e-4), (5.0, 6e-4), (8.0, 1e-4)))
    columns = grid(drive)
    columns.divide(6, 400, 0.02)
    (failed,) = columns.failed
    assert 2.0 < failed < PEAK
    inside = [t for t in columns.levels if 2.0 < t < PEAK]
    assert failed not in columns.levels and not inside
    assert len(columns.levels) > 2


def test_errors_are_compared_with_a_larger_ripple():
    """A thousand times the own one leaves nothing to divide and misses less."""
    columns = grid(KnownDrive(drops=((3.0, 2e-4), (5.0, 3e-4), (7.0, 1e-4))))
    others = [columns.unseen_column(0.5)]
    missed = columns.largest_miss(6, others, columns.levels)
    _, *heights = columns.peaks(6, 1.0)
    ripple = [1e3 * height.max() for height in heights]
    columns.ripple = lambda torque: np.multiply.outer(ripple, np.ones_like(torque))
    assert columns.divide(6, 300, 0.02) <= 0.02
    assert columns.levels == [2.0, PEAK]
    assert columns.largest_miss(6, others, columns.levels) < 0.01 * missed


def test_predicted_events_need_no_torques_next_to_them():
    """Where every equilibrium knows the events of its angle the first torques do."""
    drops = ((3.0, 2e-4), (5.0, 3e-4), (7.0, 1e-4))
    columns = grid(ForeseeingDrive(drops=drops))
    assert columns.divide(6, 300, 0.02) < 1e-6
    assert columns.levels == [2.0, PEAK]
    plain = grid(KnownDrive(drops=drops))
    assert plain.divide(6, plain.solves, 0.02) > 0.02


def test_other_angles_are_missed_by_what_the_samples_cannot_know():
    """Smooth over the angle the error falls with their number."""
    # at 2 N·m the event comes at some angles only
    drive = KnownDrive(drops=((2.1, 2e-4),), swing=0.4)
    columns = grid(drive, count=48)
    others = [columns.unseen_column(k + 0.38) for k in range(0, 48, 5)]
    missed = [
        columns.largest_miss(count, others, [2.0, PEAK]) for count in (6, 12, 24, 48)
    ]
    assert missed[0] > 0.1
    assert missed[3] < 0.03
    assert (np.diff(missed) < 0.0).all()
    # at the peak, where it always has come, a sine is all there is
    assert columns.largest_miss(6, others, [PEAK]) < 1e-9


def test_angles_are_added_where_a_contact_changes():
    """Next to the two angles at which the event comes and goes, and not elsewhere."""
    # at 2 N·m the event comes at sin(theta) = -0.5 and goes at the other one
    drive = KnownDrive(drops=((2.2, 2e-4),), swing=0.4)
    columns = grid(drive, count=48)
    others = [columns.unseen_column(2 * k + 0.76) for k in range(24)]
    before = columns.largest_miss(24, others, [2.0])
    spent = columns.solves
    assert not columns.divide_angles(24, spent, 0.005)
    assert columns.divide_angles(24, spent + 200, 0.005)
    cost = 1 + len(columns.levels)
    assert columns.solves == spent + cost * len(columns.between)
    assert 2 <= len(columns.between) <= 10
    apart = np.sin(2.0 * pi * np.array(columns.between) / 48) + 0.5
    assert np.abs(apart).max() < 0.4
    assert columns.largest_miss(24, others, [2.0]) < 0.7 * before
    tables, _ = columns.tables(24, 20)
    assert all(table.shape == (4, 48) for table in tables.values())
    # the additional angles enter unchanged
    for place in columns.between:
        known = drive.at(2.0, float(columns.columns[place].theta))
        assert tables[2.0][0, int(place)] == pytest.approx(known.error, abs=1e-15)


def test_the_torque_beyond_the_peak_turns_the_stiffest_angle_as_far_as_the_softest():
    """All torsions at the peak are below the least one at the torque beyond it."""
    drive = KnownDrive(drops=((4.0, 5e-4),), swing=0.6)
    columns = grid(drive)
    columns.go_beyond(6)
    (beyond,) = columns.beyond
    theta = columns.angles(6)
    softest = max(-drive.at(PEAK, t).error for t in theta)
    stiffest = min(-drive.at(PEAK, t).error for t in theta)
    assert softest > 1.07 * stiffest
    assert min(-drive.at(beyond, t).error for t in theta) > softest
    # what an ordinary drive needs, and no more
    assert beyond <= (1.0 + torque_choice.BEYOND[1]) * PEAK
    tables, solved = columns.tables(6, 20)
    assert max(tables) == beyond and beyond in solved

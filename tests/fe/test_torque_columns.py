"""Columns of equilibria over the torque: a drive in closed form instead of elements."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

import numpy as np
import pytest

from swgjoint.errors import Outcome
from swgjoint.fe import torque_columns
from swgjoint.fe.following import Unloaded
from swgjoint.fe.torque_columns import ColumnGrid

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

    def deflected(self) -> Known:
        """As of a follower."""
        return self.at(0.0, 0.0)

    def meshed(self, state: Known) -> Known:
        """As of a follower."""
        return state

    def unloaded(self, state: Known, small: float) -> Unloaded[Known]:
        """As of a follower."""
        return Unloaded(state=self.at(0.0, state.theta), small=small)

    def unloaded_to(self, rest: Unloaded[Known], theta: float) -> Unloaded[Known]:
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

    def output_angle(self, state: Known) -> float:
        """Psi [rad]."""
        return state.error + state.theta / self.ratio

    def input_torque(self, state: Known) -> float:
        """On the input [N·m]."""
        return state.moment


def grid(drive: KnownDrive, count: int = 6, levels=(2.0, PEAK)) -> ColumnGrid:
    found = ColumnGrid(
        follow=drive,
        period=2.0 * pi,
        finest=count,
        levels=list(levels),
        small=0.01,
        tick=lambda: None,
        keep=None,
        restored=lambda solves: None,
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


def test_division_never_turns_the_input_by_a_pitch():
    """The first and the last column are neighbours in the pattern, not in the angle."""
    drive = KnownDrive(drops=((3.0, 2e-4), (5.0, 3e-4), (7.0, 1e-4)))
    columns = grid(drive)
    begin = len(drive.ways)
    columns.divide(6, 90, 0.002)
    turned = [abs(b - a) for kind, a, b in drive.ways[begin:] if kind == "angle"]
    assert turned
    assert max(turned) == pytest.approx(2.0 * pi / 6)


def test_the_last_solves_go_to_the_worst_intervals(monkeypatch):
    """With a budget that ends early, less is left in doubt than without that share."""
    drops = tuple((1.0 + 0.53 * k, 4e-5 * (1 + k % 3)) for k in range(16))
    left = {}
    for share in (0.0, torque_columns.LAST):
        monkeypatch.setattr(torque_columns, "LAST", share)
        columns = grid(KnownDrive(drops=drops), count=8)
        left[share] = columns.divide(8, 120, 0.001)
        assert columns.solves <= 120
    assert 0.001 < left[torque_columns.LAST] < left[0.0]


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
    assert beyond <= (1.0 + torque_columns.BEYOND[1]) * PEAK
    tables, solved = columns.tables(6, 20)
    assert max(tables) == beyond and beyond in solved

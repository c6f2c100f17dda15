"""Drives of a lot by superposition on thin rings, against full solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solved import hundred_elements

from swgjoint.errors import ComputationError, DesignError, Outcome
from swgjoint.explore import bearing_lot
from swgjoint.explore.bearing_lot import FIGURES, draw_on_bearing, run_bearing_lot
from swgjoint.fe.rings.accuracy import transmission_error
from swgjoint.fe.rings.equilibrium import ThinRingSolver
from swgjoint.fe.rings.lot import (
    perfect_rings,
    sample_turn,
    turn_superposition_error,
)
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.mounting import series_compliance

DESIGN = Design.preset("size-25-50").with_changes(
    {
        "tolerances.flexspline_cumulative_pitch_um": 6.0,
        "tolerances.circular_spline_cumulative_pitch_um": 6.0,
        "tolerances.random_pitch_um": 1.0,
        "tolerances.wave_generator_ovality_um": 3.0,
        "tolerances.seed": 3,
    }
)
RATINGS = ratings_of(DESIGN)
LOST = 0.04 * RATINGS.rated_torque


@pytest.fixture(scope="module", autouse=True)
def few_elements():
    """The laws hold for rings of any number of elements."""
    with hundred_elements():
        yield


@pytest.fixture(scope="module")
def turn():
    """Forty positions of one drive."""
    return sample_turn(DESIGN, (LOST, RATINGS.T1), positions=40)


@pytest.fixture(scope="module")
def perfect():
    """Equilibria of the drive without errors."""
    return perfect_rings(DESIGN, (LOST, RATINGS.T1))


def test_start_without_errors_reaches_the_same_equilibria(turn, perfect, monkeypatch):
    """Also with another clearance, with which one search starts anew."""
    starts = []
    solve = ThinRingSolver.__call__

    def noted(self, model, start, **options):
        starts.append(start.loaded_teeth)
        return solve(self, model, start, **options)

    wide = DESIGN.with_changes({"wave_generator.bearing.clearance_um": 20.0})
    alone = sample_turn(wide, (LOST, RATINGS.T1), positions=40)
    monkeypatch.setattr(ThinRingSolver, "__call__", noted)
    for design, expected in ((DESIGN, turn), (wide, alone)):
        starts.clear()
        found = sample_turn(design, (LOST, RATINGS.T1), perfect, positions=40)
        assert starts[0] > 0
        # the tolerance of the solver on the rings, 3e-12 of the radius
        assert found.output_error == pytest.approx(
            expected.output_error, rel=0.0, abs=1e-11
        )
        assert np.ptp(expected.kinematic_error) > 1e-5
        if design is DESIGN:  # three torques of both signs, none from unloaded rings
            assert len(starts) == 6 and min(starts) > 0


def test_drive_that_the_start_does_not_lead_to_is_solved_alone(
    turn, perfect, monkeypatch
):
    """If all searches that start from the drive without errors fail."""
    solve, failed = ThinRingSolver.__call__, []

    def failing(self, model, start, **options):
        found = solve(self, model, start, **options)
        if any(start.ball_feet is one.ball_feet for one in known):
            failed.append(options["torque"])
            return replace(found, outcome=Outcome.DIVERGED)
        return found

    known = [one for by_torque in perfect.loaded.values() for one in by_torque.values()]
    monkeypatch.setattr(ThinRingSolver, "__call__", failing)
    found = sample_turn(DESIGN, (LOST, RATINGS.T1), perfect, positions=40)
    assert len(failed) == 6
    assert np.array_equal(found.output_error, turn.output_error)


@pytest.mark.slow
def test_drives_do_not_depend_on_the_number_of_processes(monkeypatch):
    """Nor on the other drives of the lot."""
    monkeypatch.setenv("SWGJOINT_CACHE", "")
    options = {"seed": 5, "clearance_um": (6.0, 23.0)}
    figures = [
        [[row[key] for key in FIGURES] for row in lot["rows"]]
        for lot in (
            run_bearing_lot(DESIGN, count=3, jobs=2, **options),
            run_bearing_lot(DESIGN, count=2, jobs=1, **options),
        )
    ]
    assert figures[0][:2] == figures[1] and figures[0][0] != figures[0][1]


@pytest.mark.slow
def test_torsion_is_that_of_the_rings(turn):
    """Full solves at two positions: kinematic error and torsion at both torques."""
    assert turn.torque.tolist() == sorted((-turn.torque).tolist())
    off = turn_superposition_error(DESIGN, turn)
    assert off is not None and 0.0 < off < 0.05
    series = series_compliance(DESIGN, cup=True)
    for k in (0, 17):
        angle = turn.input_angle[k : k + 1]
        for torque in (LOST, RATINGS.T1):
            ends = [
                transmission_error(DESIGN, angle, torque=t) for t in (torque, -torque)
            ]
            full = 0.5 * float(ends[1][0] - ends[0][0]) + series * torque
            assert turn.torsion(torque)[k] == pytest.approx(full, rel=0.05)


def test_larger_clearance_gives_more_lost_motion(turn):
    """By the mechanism of the bearing, all else equal; K1 falls."""
    key = "wave_generator.bearing.clearance_um"
    wide = DESIGN.with_changes({key: 1.5 * 14.5})
    more = sample_turn(wide, (LOST, RATINGS.T1), positions=40)
    assert more.torsion(LOST).mean() > 1.1 * turn.torsion(LOST).mean()
    assert more.torsion(RATINGS.T1).mean() > turn.torsion(RATINGS.T1).mean()


def test_a_lot_counts_and_keeps_its_drives(monkeypatch, tmp_path):
    """Figures by definition, random clearances, the failed drive, a longer lot."""
    monkeypatch.setenv("SWGJOINT_CACHE", str(tmp_path))
    seen = []

    class Straight:
        """A drive of known stiffness with an error of two waves per input turn."""

        def __init__(self, design):
            self.input_angle = np.linspace(0.0, 100.0 * np.pi, 97)[:-1] + 0.1
            self.kinematic_error = 1e-4 * np.cos(2.0 * self.input_angle)
            self.output_error = self.kinematic_error[None]

        def torsion(self, torque):
            return np.full(96, torque / 2.5e4)

    def instant(design, torques, perfect):
        seen.append(design.tolerances.seed)
        if design.tolerances.seed == 2:
            raise ComputationError("no equilibrium")
        return Straight(design)

    monkeypatch.setattr(bearing_lot, "sample_turn", instant)
    monkeypatch.setattr(bearing_lot, "turn_superposition_error", lambda *_: 0.01)
    spec = {"lost_motion_arcmin": 1.0, "K1_Nm_rad": 2.6e4}
    options = {"clearance_um": (6.0, 23.0), "spec": spec}
    found = run_bearing_lot(DESIGN, count=3, **options)
    assert seen == [1, 2, 3] and found["failed"] == 1
    one, lost, other = found["rows"]
    assert one["K1_Nm_rad"] == pytest.approx(2.5e4)
    arcmin = np.pi / 180.0 / 60.0
    assert one["lost_motion_arcmin"] == pytest.approx(2 * LOST / 2.5e4 / arcmin)
    assert one["transmission_accuracy_arcmin"] == pytest.approx(2e-4 / arcmin, rel=0.01)
    assert [lost[key] for key in FIGURES] == [None] * 3
    assert one["clearance_um"] != other["clearance_um"]
    by_limit = found["yield"]["by_limit"]
    assert by_limit["lost_motion_arcmin"]["part"] == pytest.approx(2.0 / 3.0)
    assert by_limit["K1_Nm_rad"]["part"] == found["yield"]["part"] == 0.0
    assert found["validity"]["superposition_error"] == 0.01
    longer = run_bearing_lot(DESIGN, count=4, **options)
    assert seen == [1, 2, 3, 4] and longer["rows"][:3] == found["rows"]


def test_clearances_are_uniform_within_their_limits():
    """Mean of 200 seeds, and the clearance of the design without limits."""
    drawn = [draw_on_bearing(DESIGN, seed, "limit", (6.0, 23.0)) for seed in range(200)]
    values = np.array([one.wave_generator.bearing.clearance_um for one in drawn])
    assert values.min() > 6.0 and values.max() < 23.0
    # four standard deviations of the mean
    assert values.mean() == pytest.approx(14.5, abs=4.0 * 17.0 / 12**0.5 / 200**0.5)
    kept = draw_on_bearing(DESIGN, 1, "limit", None)
    assert kept.wave_generator.bearing == DESIGN.wave_generator.bearing


def test_designs_without_errors_or_bearing_are_refused():
    """One line each."""
    with pytest.raises(DesignError, match="tolerances"):
        run_bearing_lot(Design.preset("size-25-50"), count=1)
    with pytest.raises(DesignError, match="bearing"):
        run_bearing_lot(Design.preset("reference-2d-tolerances"), count=1)

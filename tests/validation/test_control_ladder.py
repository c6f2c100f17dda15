"""The ladder of controllers: specimens, the command, and what each rung is for."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from swgjoint.cli.main import main
from swgjoint.control.kinematic_error import (
    KinematicErrorTable,
    identify_kinematic_error,
)
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import AMPLITUDES, SHARE, peak_to_peak
from swgjoint.units import arcmin
from swgjoint.validation.control import ladder as study
from swgjoint.validation.control.bench import (
    DELAY,
    MOTIONS,
    UNITS,
    figures_of,
    record_turn,
    run_motion,
)
from swgjoint.validation.control.ladder import RUNGS, Ladder, climb, ladder_claims
from swgjoint.validation.control.specimens import nominal, specimen

CSG = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0)


def harmonics(drive):
    return {tuple(pq): pair for pq, pair in zip(drive.orders.tolist(),
            drive.kinematic_error, strict=True)}  # fmt: skip


def test_a_specimen_has_the_stated_accuracy():
    """1 arcmin over one output turn, friction within a fifth, one seed one drive."""
    one, two = specimen(CSG, 1), specimen(CSG, 2)
    for drive in (one, two):
        assert peak_to_peak(drive) == pytest.approx(1.0 * arcmin, rel=1e-9)
        share = drive.friction.coulomb / CSG.friction.coulomb
        assert abs(share - 1.0) <= 0.2 and share != 1.0
    np.testing.assert_array_equal(specimen(CSG, 1).kinematic_error, one.kinematic_error)
    assert np.abs(one.kinematic_error - two.kinematic_error).max() > 0.1 * arcmin


def test_specimens_have_the_spectrum_of_finite_elements():
    """Amplitudes over that of 2 alpha; the share of a catalogue drive lies about it."""
    found = harmonics(specimen(CSG, 1))
    first = np.hypot(*found[(2, 0)])
    assert first > 0.05 * arcmin
    for pq, share in AMPLITUDES.items():
        assert np.hypot(*found[pq]) / first == pytest.approx(share, rel=1e-9)
    low, high = SHARE
    assert low < AMPLITUDES[(4, 0)] < high and low < AMPLITUDES[(0, 4)] < high


def test_the_random_part_has_a_seed_of_its_own():
    """Another one leaves phases and ratios of the systematic part as they are."""
    one, other = (harmonics(specimen(CSG, 1, random_seed=k)) for k in (0, 1))
    scale = np.hypot(*other[(2, 0)]) / np.hypot(*one[(2, 0)])
    assert scale == pytest.approx(1.0, abs=0.1)  # both fill the stated accuracy
    for pq in AMPLITUDES:
        np.testing.assert_allclose(other[pq], scale * one[pq], rtol=1e-9)
    assert not np.allclose(other[(7, 0)], scale * one[(7, 0)], rtol=0.1)


def test_a_map_with_errors_keeps_their_size(synthetic_map):
    """Phases are drawn, amplitudes of error and potential stay."""
    drive = specimen(synthetic_map, 3)
    for key in ("kinematic_error", "potential"):
        sizes = [np.hypot(getattr(d, key)[:, 0], getattr(d, key)[:, 1])
                 for d in (drive, synthetic_map)]  # fmt: skip
        np.testing.assert_allclose(*sizes, rtol=1e-12, atol=1e-15)
    assert not np.allclose(drive.kinematic_error, synthetic_map.kinematic_error)
    np.testing.assert_array_equal(drive.potential[0], synthetic_map.potential[0])


def test_what_is_known_has_no_angles(synthetic_map):
    """The mean curve alone: no error, no harmonic of the torque."""
    known = nominal(specimen(synthetic_map, 3))
    assert len(known.orders) == 1 and not known.kinematic_error.any()
    np.testing.assert_array_equal(known.potential[0], synthetic_map.potential[0])


def test_each_rung_but_the_first_says_what_it_is_made_for():
    """A figure of the table, over a rung that stands below it."""
    names = [rung.name for rung in RUNGS]
    assert RUNGS[0].made_for is None
    for k, rung in enumerate(RUNGS[1:], start=1):
        assert rung.made_for in UNITS and rung.over in names[:k]


def test_the_ranking_of_the_move_survives_old_readings():
    """Of one period: each rung leaves what it leaves with readings of now."""
    plant = specimen(CSG, 0)
    table = KinematicErrorTable(orders=plant.orders, amplitudes=plant.kinematic_error)
    rms = {}
    for delay in (0.0, DELAY):
        for rung in RUNGS:
            if rung.name not in ("PD", "+ feed-forward", "+ flexible joint", "MPC"):
                continue
            run = run_motion(CSG, plant, rung.build(table), "move", 0, delay=delay)
            off = (run.position - run.reference)[300:]
            rms.setdefault(rung.name, []).append(float(np.sqrt(np.mean(off**2))))
    now, late = np.array(list(rms.values())).T
    np.testing.assert_allclose(late, now, rtol=0.2)
    assert (late[1:] < 0.4 * late[:-1]).all()


@pytest.fixture
def short(monkeypatch):
    """Two specimens and motions that are too short to tell much."""
    fast = {
        "kind": "constant_speed",
        "speed_deg_s": {"joint": 80.0},
        "settle_s": 0.5,
    }
    monkeypatch.setitem(MOTIONS, "slow", {
        "trajectory": fast, "simulation": {"duration_s": 5.2}})  # fmt: skip
    monkeypatch.setitem(MOTIONS, "even", {
        "trajectory": fast, "simulation": {"duration_s": 1.0}})  # fmt: skip
    monkeypatch.setattr(study, "climb", lambda drive, **keys: climb(
        drive, rungs=("PD", "+ feed-forward"), **keys))  # fmt: skip


def test_command_writes_table_picture_and_values(short, tmp_path, capsys):
    """Rows for every rung and figure, values by seed, one line for each claim."""
    arguments = ["--json", "--jobs", "1", "--seeds", "2"]
    arguments += ["--out", str(tmp_path / "new")]
    assert main(["study", "control", *arguments]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert len(found["rows"]) == 2 * len(UNITS)
    made = [r for r in found["rows"] if r["reason"]]
    assert [r["case"] for r in made] == ["CSG-25-100, + feed-forward"]
    values = found["values"]["CSG-25-100"]["PD"]["tracking_rms"]
    row = found["rows"][0]
    assert row["ours"] == pytest.approx(np.mean(values))
    assert row["spread"] == pytest.approx(np.std(values, ddof=1))
    assert "better on 2 of 2" in found["summary"][-1]
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == [
        "control-CSG-25-100.png",
        "control.csv",
        "control.json",
    ]
    assert "specimens" in err


def test_ladder_of_a_drive_without_friction_or_errors(short):
    """A linear map is drawn errors of the default accuracy; the rungs still run."""
    linear = replace(CSG, friction=None)
    found = study.climb(linear, seeds=2)
    assert found.improvement(RUNGS[1])[1] == 2
    assert len(ladder_claims(found)) == 1


MOTION_OF = {
    "tracking_rms": "move",
    "tracking_peak": "move",
    "positioning_pp": "slow",
    "ripple_rms": "even",
    "two_per_turn": "even",
}
"""The motion that gives each figure that a rung is made for."""


@pytest.mark.slow
def test_each_rung_improves_what_it_is_made_for():
    """On one specimen, in the motions of those figures; thirty percent and ten times.

    ``swgjoint study control`` does it on ten, and runs every motion of every rung.
    """
    plant, figures = specimen(CSG, 0), {}
    table = identify_kinematic_error(record_turn(CSG, 0), nominal(CSG))
    for rung in RUNGS:
        compared = [r.made_for for r in RUNGS[1:] if rung.name in (r.name, r.over)]
        runs = {
            motion: run_motion(CSG, plant, rung.build(table), motion, 0)
            for motion in {MOTION_OF[key] for key in compared}
        }
        found = figures_of(runs)
        assert set(compared) <= set(found)
        figures[rung.name] = {key: np.array([found[key]]) for key in compared}
    ladder = Ladder(drive=CSG, figures=figures, shown={})
    shares = {}
    for rung in RUNGS[1:]:
        shares[rung.name], better = ladder.improvement(rung)
        assert better == 1, (rung.name, shares)
    assert shares["+ kinematic error"] < 0.7
    assert shares["flexible joint, learning"] < 0.1

"""Many drives of one design by superposed errors, against drives solved one by one."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
from messages import naming
from solved import coarse

from swgjoint.errors import DesignError
from swgjoint.explore.lot import run_lot
from swgjoint.fe.plane.drive2d import unmodelled_parts
from swgjoint.fe.tolerances.cycle import gap_changes, gap_errors, pitch_of
from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.lot import (
    outline_change,
    perfect_positions,
    sample_lot,
    superposition_error,
)
from swgjoint.fe.tolerances.rest import influences
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors

pytestmark = pytest.mark.fe

DESIGN = coarse("reference-2d-tolerances")


@pytest.fixture(scope="module")
def flawed():
    """The drive on its wave generator with errors, linearised there."""
    return influences(DESIGN, phases=1)


@pytest.fixture(scope="module")
def rests():
    """The same without any error."""
    return perfect_positions(DESIGN, phases=1)


@pytest.fixture(scope="module")
def perfect(rests):
    """Linearised."""
    return rests[0].at


def test_a_wave_generator_without_errors_moves_nothing(perfect):
    """No gap changes."""
    assert not outline_change(perfect, without_errors(DESIGN)).any()


@pytest.mark.parametrize("torque", [0.0, 20.0])
def test_errors_of_the_wave_generator_are_superposed(flawed, perfect, torque):
    """The output is that of the drive linearised on the wave generator with errors."""
    errors = gap_errors(DESIGN, np.arange(0, 7320, 180))
    there = flawed[1][0].at
    exact = there.respond(there.gap_change(*errors), torque).output_angle
    teeth = perfect.gap_change(*errors)
    outline = np.tile(outline_change(perfect, DESIGN), (len(teeth), 1))
    both = np.concatenate([teeth, outline], axis=1)
    found = perfect.with_supports.respond(both, torque).output_angle
    left_out = perfect.respond(teeth, torque).output_angle
    # second order in micrometres, other contacts at the flanks
    assert np.abs(found - exact).max() < 0.03 * np.abs(left_out - exact).max()


def test_gap_changes_over_the_cycle_are_those_of_its_errors(perfect):
    """Added up from those of the teeth of either member, and of a turning axis."""
    pitches = np.array([0, 1, 59, 60, 61, 3000, 7319])
    slopes = np.random.default_rng(1).normal(size=perfect.by_tilt.shape) * 1e-3
    at, seen = replace(perfect, by_tilt=slopes), []
    for changes in (
        {},
        {"tolerances.misalignment_arcmin": 2.0},
        {"drive.layout": "wave_generator_fixed"},
    ):
        design = DESIGN.with_changes(changes)
        wanted = at.gap_change(*gap_errors(design, pitches))
        found = gap_changes(at, design, pitches)
        assert np.abs(found - wanted).max() < 1e-14 * np.abs(wanted).max()
        seen.append(found[1:])
    for other in seen[1:]:
        assert np.abs(other - seen[0]).max() > 0.1 * np.abs(seen[0]).max()


def test_an_influence_is_sent_without_what_it_determines(perfect):
    """Compiled problems cannot be sent; a copy solves its own with the same result."""
    teeth = perfect.gap_change(*gap_errors(DESIGN, np.arange(0, 7320, 1800)))
    both = np.pad(teeth, ((0, 0), (0, len(perfect.matrix) - teeth.shape[1])))
    ours = perfect.with_supports.respond(both, 5.0)
    copy = pickle.loads(pickle.dumps(perfect))
    assert set(vars(copy)) == {item.name for item in fields(perfect)}
    theirs = copy.with_supports.respond(both, 5.0)
    assert np.array_equal(ours.output_angle, theirs.output_angle)


def test_energy_follows_the_outline(perfect):
    """Its slope in the angle's conjugate, T, holds with a moved outline, too."""
    errors = gap_errors(DESIGN, np.arange(0, 7320, 1800))
    teeth = perfect.gap_change(*errors)
    outline = np.tile(outline_change(perfect, DESIGN), (len(teeth), 1))
    both = np.concatenate([teeth, outline], axis=1)
    at, step = perfect.with_supports, 1e-4
    low, middle, high = (at.respond(both, 10.0 + d) for d in (-step, 0.0, step))
    slope = (high.potential - low.potential) / (2.0 * step)
    np.testing.assert_allclose(slope, middle.output_angle, rtol=1e-6)


def test_lot_holds_drives_that_are_solved_one_by_one(flawed, rests):
    """Full solves with all errors, at positions of the lot; others differ."""
    follow, itself = flawed
    other = DESIGN.with_changes({"tolerances.seed": 2})
    lot = sample_lot([DESIGN, other], rests, positions=6)
    pitch = np.round(lot.input_angle / pitch_of(DESIGN)).astype(np.int64)
    solved = full_solves(DESIGN, follow, itself, pitch, (0.0, 20.0))
    rated = solved.torque > 0.0
    for ours, theirs, limit in (
        (lot.unloaded[0], solved.output_error[~rated], 0.006),
        # the drive is linearised without load; the mean wind-up is 0.3 % off
        (lot.loaded[0], solved.output_error[rated], 0.016),
    ):
        difference = (ours - theirs) - np.mean(ours - theirs)
        assert np.abs(difference).max() < limit * np.ptp(theirs)
        assert abs(np.mean(ours - theirs)) < limit * np.ptp(theirs)
    assert np.abs(lot.unloaded[1] - lot.unloaded[0]).max() > 0.2 * np.ptp(lot.unloaded)


def test_error_of_the_superposition_is_told(rests):
    """Small for micrometres, large for random errors that break the linear range."""
    assert superposition_error(DESIGN, rests, positions=2) < 0.01
    rough = DESIGN.with_changes({"tolerances.random_pitch_um": 25.0})
    told = superposition_error(rough, rests, positions=2)
    assert told is None or told > 0.02


def test_an_axis_that_leans_counts_for_nothing_and_is_named(rests):
    """A plane has none: the same figures, and the label names what is left out."""
    leaning = DESIGN.with_changes({"tolerances.misalignment_arcmin": 5.0})
    assert superposition_error(leaning, rests, positions=2) == superposition_error(
        DESIGN, rests, positions=2
    )
    assert "tolerances.misalignment_arcmin" in unmodelled_parts(leaning)
    assert unmodelled_parts(leaning, "3d") == unmodelled_parts(DESIGN, "3d")
    alone = Design.load("reference-2d").with_changes(
        {"tolerances.misalignment_arcmin": 5.0}
    )
    with pytest.raises(
        DesignError, match=naming("reference-2d", "misalignment_arcmin")
    ):
        run_lot(alone, count=1)


def test_cup_adds_its_torsion_alone(rests):
    """Compliance and wind-up grow by those of the closed form; the error stays."""
    from swgjoint.gear.mounting import series_compliance

    cup = {"kind": "cup", "length_mm": 40.0, "thickness_coefficient": 0.8}
    cup |= {"fillet_mm": 2.0, "bore_radius_mm": 20.0}
    long = DESIGN.with_changes({"cup": cup})
    series = series_compliance(long, cup=True)
    one, two = (sample_lot([d], rests, positions=3) for d in (DESIGN, long))
    assert series > 0.0
    np.testing.assert_allclose(two.compliance - one.compliance, series, rtol=1e-6)
    np.testing.assert_allclose(two.unloaded, one.unloaded, atol=1e-15)

"""Errors of the teeth superposed on the linearised drive, against full solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming
from solved import coarse

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.tolerances.cycle import MEMBERS, pitch_of, pitches_of, shift_errors
from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.rest import Rest, influences
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import tooth_errors

pytestmark = pytest.mark.fe

ERRORS = {
    "flexspline_cumulative_pitch_um": 10.0,
    "circular_spline_cumulative_pitch_um": 10.0,
    "random_pitch_um": 2.0,
    "circular_spline_ovality_um": 5.0,
    "circular_spline_eccentricity_um": 5.0,
}


def flawed(name="reference-2d", **values) -> Design:
    changes = {f"tolerances.{key}": value for key, value in values.items()}
    return coarse(name, **changes)


def gaps_at(design, at, pitches):
    """Gap changes of all contacts at whole pitches (n, n_contacts)."""
    layout = design.drive.layout
    shifts = [shift_errors(tooth_errors(design, m), pitches, layout) for m in MEMBERS]
    return at.gap_change(*shifts)


@pytest.fixture(scope="module")
def reference(perfect_influences):
    """The perfect drive without load at one position, and its influences."""
    follow, found = perfect_influences
    return follow, found[0].state, found[0].at


def test_without_errors_the_perfect_drive_comes_back(reference):
    """Angle, compliance and energy over torque are those of full solves."""
    follow, state, at = reference
    none = none_of(at)
    rest = at.respond(none, 0.0)
    assert rest.output_angle[0] == pytest.approx(state.rotation, abs=1e-15)
    assert rest.compliance[0] == pytest.approx(state.compliance, rel=1e-9)
    assert abs(rest.potential[0]) < 1e-15 * state.energy and not rest.active.any()
    check_linear(without_strips(follow), 3e-3)
    check_linear(follow, 3e-3)


def check_linear(follow, part):
    """Linearised without load the drive under rated torque is right to a part."""
    begin = follow.engage(follow.deflect())
    loaded, linear = follow.to_torque(begin, 20.0), follow.influence(begin)
    found = linear.respond(none_of(linear), 20.0)
    assert found.output_angle[0] == pytest.approx(loaded.rotation, rel=part)
    assert found.compliance[0] == pytest.approx(loaded.compliance, rel=part)
    gain = loaded.energy + 20.0 * loaded.rotation - begin.energy
    assert found.potential[0] == pytest.approx(gain, rel=part)


def none_of(linear):
    """No errors: gap changes of all its contacts (1, n_contacts)."""
    return np.zeros((1, len(linear.sector)))


def without_strips(follow):
    """The drive whose flanks have the patch of a contact alone."""
    return replace(follow, model=replace(follow.model, indentation=None))


def test_potential_is_the_integral_of_the_angle(reference):
    """Pi has psi as its slope in T, where errors have changed the contacts, too."""
    _, _, at = reference
    design = flawed(**ERRORS)
    gaps = gaps_at(design, at, np.arange(0, 7320, 600))
    # approaches of the strips are exact to 1e-14 m, the potential to 1e-14 J
    step = 1e-3
    torques = (15.0 - step, 15.0, 15.0 + step)
    low, middle, high = (at.respond(gaps, t) for t in torques)
    assert (middle.active.sum(axis=1) > 10).all()
    slope = (high.potential - low.potential) / (2.0 * step)
    assert slope == pytest.approx(middle.output_angle, rel=1e-6, abs=1e-12)
    bend = -(high.output_angle - low.output_angle) / (2.0 * step)
    assert bend == pytest.approx(middle.compliance, rel=1e-4)


@pytest.mark.parametrize(
    ("seed", "within"),
    [
        (1, (0.005, 0.005)),
        # one tooth carries 1600 N, ten times the largest force of the linearised drive:
        # 2.14 % (1.99 % if forces turn with their sectors)
        pytest.param(2, (0.025, 0.005), marks=pytest.mark.slow),
    ],
    ids=["1", "2"],
)
def test_superposition_is_close_to_full_solves(reference, seed, within):
    """Output error at no load and at rated torque, in its peak to peak."""
    follow, state, at = reference
    none = np.zeros((1, len(at.sector)))
    design = flawed(**ERRORS, seed=seed)
    positions = np.random.default_rng(seed).choice(pitches_of(design), 2)
    solved = full_solves(
        design, follow, [Rest(state=state, at=at)], positions, (0.0, 20.0)
    )
    assert solved.torque.size == 4
    for torque in (0.0, 20.0):
        every = gaps_at(design, at, np.arange(0, 7320, 20))
        turn = at.respond(every, torque).output_angle
        turn -= at.respond(none, torque).output_angle
        spread = np.ptp(turn)
        assert spread > 5e-5
        gaps = gaps_at(design, at, positions)
        found = at.respond(gaps, torque).output_angle
        found -= at.respond(none, torque).output_angle
        perfect = follow.to_torque(state, torque).rotation
        wanted = solved.output_error[solved.torque == torque] - perfect
        assert (np.abs(found - wanted) < np.array(within) * spread).all()
        # to first order the gaps miss somewhere on the turn: contacts change
        first = every @ at.angle_by_gap
        assert np.abs(first - turn).max() > 0.05 * spread


@pytest.mark.parametrize(
    "name", ["reference-2d", "reference-2d-flexspline-fixed", "wave_generator_fixed"]
)
def test_a_pitch_on_the_next_teeth_stand_alike(name):
    """Turning the input by whole pitches equals moving the errors on to other teeth."""
    fixed = name == "wave_generator_fixed"
    design = flawed("reference-2d" if fixed else name, **ERRORS)
    if fixed:
        design = design.with_changes({"drive.layout": name})
    follow, found = influences(design, phases=1)
    pitches = 5
    moved = full_solves(design, follow, found, np.array([pitches]), (20.0,))
    model = sector_model(design, friction=False)
    turned = Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)
    there = turned.to_torque(turned.engage(turned.deflect()), 20.0)
    here = turned.output_angle(there)
    angle = pitches * pitch_of(design)
    there = turned.to_angle(there, angle)
    assert there.outcome.ok
    error = turned.output_angle(there) - angle / design.ratio
    assert error == pytest.approx(moved.output_error[0], abs=1e-9)
    # it is not the error of the first position
    assert abs(here - error) > 1e-6
    assert turned.input_torque(there) == pytest.approx(moved.input_torque[0], abs=1e-6)


def test_flawed_or_half_models_are_refused(reference):
    """The linearised drive has perfect teeth and all sectors."""
    from swgjoint.fe.tolerances.influence import influence

    follow, state, _ = reference
    shifts = np.full((120, 2), 1e-6)
    for change in ({"tooth_shift": shifts}, {"half": True}):
        model = replace(follow.model, **change)
        with pytest.raises(
            ValueError, match=naming("whole drive", "friction", "errors")
        ):
            influence(model, state, circular_spline_is_output=False)

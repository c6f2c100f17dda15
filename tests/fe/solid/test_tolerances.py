"""Errors of teeth and axis in space: superposed against full solves, orders, mirror."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from messages import naming
from solved import kept

from swgjoint.errors import DesignError
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.tolerance_influence import influence
from swgjoint.fe.tolerances.cycle import gap_errors, pitch_of, pitches_of, shift_errors
from swgjoint.fe.tolerances.rest import influences
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import ToothErrors, axis_tilt

pytestmark = [pytest.mark.fe, pytest.mark.usefixtures("few_masters_everywhere")]

TORQUE = 5.0
LEAN = 2e-4
"""Tilt of the tests: a micrometre at the edges of the face width [rad]."""
ERRORS = {
    "flexspline_cumulative_pitch_um": 3.0,
    "circular_spline_cumulative_pitch_um": 3.0,
    "random_pitch_um": 0.5,
    "circular_spline_ovality_um": 1.0,
    "circular_spline_eccentricity_um": 1.0,
    "misalignment_arcmin": 1.0,
}


@pytest.fixture(scope="module")
def design():
    """40 and 42 teeth, coarse, no crowning: teeth that carry without load."""
    return Design.load("reference-3d").with_changes(
        {
            "drive.teeth_flexspline": 40,
            "drive.teeth_circular_spline": 42,
            "cup.length_mm": 14.0,
            "cup.bore_radius_mm": 7.0,
            "mesh.refinement": 0.5,
        }
    )


@pytest.fixture(scope="module")
def reference(design, few_masters, few_masters_everywhere):
    """The perfect drive without load, and its influences."""

    def solve():
        follow, found = influences(design, phases=1, model="3d")
        return follow, found[0].state, found[0].at

    return kept(f"influences {design.content_hash()} {few_masters}", solve)


def none(follow, at):
    """No errors at all."""
    return np.zeros((40, 2)), np.zeros((42, 2)), np.zeros(2)


def test_leaning_changes_gaps_by_its_height(reference):
    """In a plane at z the circular spline stands off by z times the slope."""
    follow, state, _ = reference
    model, tilt = follow.model, LEAN * np.array([0.6, 0.8])

    def found(teeth):
        return teeth.find(
            model.frames(state)[0],
            model.loads(state),
            teeth.displace_circular_spline(state.circular_spline_force),
            0.03 * model.lobe_height,
            state.held,
            thorough=True,
        )

    def keys(rows):
        c = rows.contacts
        every = list(zip(c.sector, c.side, rows.plane, strict=True))
        return {key: k for k, key in enumerate(every) if every.count(key) == 1}

    straight, leans = found(model.teeth), found(replace(model.teeth, tilt=tilt))
    here, there = keys(straight), keys(leans)
    both = [(k, there[key]) for key, k in here.items() if key in there]
    assert len(both) > 5
    turn = model.frames(state)[0].turn
    angle = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    contacts, z = straight.contacts, model.strip.mesh.teeth.z
    normal = rotate(contacts.normal, angle[contacts.sector])
    wanted = -z[straight.plane] * (normal @ tilt)
    change = np.array(
        [leans.contacts.gap[b] - contacts.gap[a] for a, b in both]
    ) - np.array([wanted[a] for a, _ in both])
    assert np.abs(wanted).max() > 3e-7
    # feet wander along the flanks, to second order
    assert np.abs(change).max() < 1e-9


def test_without_errors_the_perfect_drive_comes_back(reference):
    """Angle, compliance and energy over torque are those of full solves."""
    follow, state, at = reference
    gaps = np.zeros((1, len(at.sector)))
    rest = at.respond(gaps, 0.0)
    assert rest.output_angle[0] == pytest.approx(state.rotation, abs=1e-14)
    assert rest.compliance[0] == pytest.approx(state.compliance, rel=1e-6)
    loaded = follow.to_torque(state, TORQUE)
    found = at.respond(gaps, TORQUE)
    moved = loaded.rotation - state.rotation
    # strains of this small gear are far above those of steel
    assert found.output_angle[0] - state.rotation == pytest.approx(moved, rel=0.02)
    gain = loaded.energy + TORQUE * loaded.rotation - state.energy
    assert found.potential[0] == pytest.approx(gain, rel=0.02)


def test_superposition_errs_by_the_square_of_the_errors(reference):
    """U + T psi against full solves: half the errors, a quarter of the difference.

    All errors at once: a derivative by teeth or tilt that is wrong would halve it.
    """
    follow, state, at = reference
    random = np.random.default_rng(1)
    sizes = (((40, 2), 1e-7), ((42, 2), 1e-7), ((2,), 5e-5))
    shapes = [size * random.normal(size=shape) for shape, size in sizes]
    apart = []
    for part in (1.0, 0.5):
        errors = [part * e for e in shapes]
        full = follow.with_errors(*errors).to_torque(state, 0.0)
        assert full.outcome.ok
        found = at.respond(at.gap_change(*errors)[None], 0.0)
        gained = full.energy - state.energy
        assert abs(gained) > 1e-9
        apart.append(found.potential[0] - gained)
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.1)


def test_superposition_follows_contacts_that_change(design, reference):
    """Errors of micrometres: the output within 3 % of the largest change."""
    follow, state, at = reference
    flawed = design.with_changes({f"tolerances.{k}": v for k, v in ERRORS.items()})
    pitches = np.array([250])
    errors = gap_errors(flawed, pitches)
    found = at.respond(at.gap_change(*errors), 0.0)
    assert found.active.any()
    full = []
    for one in zip(*errors, strict=True):
        there = follow.with_errors(*one).to_torque(state, 0.0)
        assert there.outcome.ok
        full.append(there.rotation)
    moved = np.array(full) - state.rotation
    apart = found.output_angle - state.rotation - moved
    assert np.abs(moved).max() > 2e-5
    # the frozen tangent leaves the curvature of the contacts out
    assert np.abs(apart).max() < 0.03 * np.abs(moved).max()


def test_opposite_misalignment_is_seen_in_the_mirror(reference):
    """Tilt, torque and output mirrored; half a turn maps opposite tilts alike."""
    _, _, at = reference
    tilts = 5.0 * LEAN * np.array([[0.6, 0.8], [-0.6, 0.8], [-0.6, -0.8]])
    still = np.zeros((3, 40, 2)), np.zeros((3, 42, 2))
    gaps = at.gap_change(*still, tilts)
    forth, back = (at.respond(gaps, t).output_angle for t in (TORQUE, -TORQUE))
    perfect = at.respond(0.0 * gaps, TORQUE).output_angle
    assert np.abs(forth - perfect).max() > 1e-6
    assert forth[0] == pytest.approx(-back[1], abs=1e-10)
    assert forth[1] == pytest.approx(-back[0], abs=1e-10)
    assert forth[2] == pytest.approx(forth[0], abs=1e-10)


def orders(at, errors):
    """Amplitudes per turn of the input, a position a pitch [rad]."""
    angle = at.respond(at.gap_change(*errors), TORQUE).output_angle
    assert np.isfinite(angle).all()
    return 2.0 * np.abs(np.fft.rfft(angle)) / angle.size


def test_even_orders_add_and_odd_ones_cancel(design, reference):
    """Pitch errors of 1 and 3 per turn against 2 and 4; misalignment shows at 2."""
    _, _, at = reference
    angle = 2.0 * pi / 42 * np.arange(42)
    pitches, still = np.arange(42), np.zeros((42, 40, 2))
    found = {}
    for low, high in ((1, 3), (2, 4)):
        wave = 2e-7 * (np.cos(low * angle) + np.cos(high * angle + 1.0))
        errors = ToothErrors(tangential=wave, radial=np.zeros(42))
        moved = shift_errors(errors, pitches, "circular_spline_fixed")
        found[low] = orders(at, (still, moved, np.zeros((42, 2))))[1:13].max()
    # a shift of all teeth turns the output by itself over the pitch radius
    assert found[2] == pytest.approx(2e-7 / 21e-3, rel=0.2)
    assert found[1] < 0.05 * found[2]
    leaning = design.with_changes({"tolerances.misalignment_arcmin": 3.0})
    assert pitches_of(leaning) == 42
    seen = orders(at, gap_errors(leaning, pitches))
    assert seen[2] > 1e-7
    assert seen[[1, 3, 5]].max() < 0.01 * seen[2]


@pytest.mark.parametrize(
    "layout", ["circular_spline_fixed", "flexspline_fixed", "wave_generator_fixed"]
)
@pytest.mark.slow
def test_a_pitch_on_the_next_teeth_stand_alike(design, reference, layout):
    """Turning the input by whole pitches equals moving the errors to other teeth."""
    changes = {f"tolerances.{k}": v for k, v in ERRORS.items()}
    flawed = design.with_changes(changes | {"drive.layout": layout})
    follow, rest, _ = reference
    perfect = replace(follow, layout=layout, ratio=flawed.ratio)
    pitches = 3
    errors = (one[0] for one in gap_errors(flawed, np.array([pitches])))
    moved = perfect.with_errors(*errors)
    there = moved.to_torque(rest, TORQUE)
    assert there.outcome.ok
    turned = replace(perfect, model=solid_sector_model(flawed))
    state = turned.to_torque(rest, TORQUE)
    angle = pitches * pitch_of(flawed)
    here = turned.output_angle(state)
    state = turned.to_angle(state, angle)
    assert state.outcome.ok
    error = turned.output_angle(state) - angle / flawed.ratio
    # ends of the face width, where the axis leans by the output angle of three pitches
    assert error == pytest.approx(moved.output_angle(there), abs=2e-9)
    assert abs(here - error) > 1e-6
    assert turned.input_torque(state) == pytest.approx(
        moved.input_torque(there), abs=1e-5 * TORQUE
    )


def test_misalignment_is_an_angle_in_a_drawn_direction(design):
    """The key in radians; the seed turns it."""
    leaning = design.with_changes({"tolerances.misalignment_arcmin": 2.0})
    size = np.linalg.norm(axis_tilt(leaning))
    assert size == pytest.approx(np.deg2rad(2.0 / 60.0))
    other = axis_tilt(leaning.with_changes({"tolerances.seed": 2}))
    assert np.linalg.norm(other) == pytest.approx(size)
    assert np.abs(other - axis_tilt(leaning)).max() > 0.1 * size


def test_flawed_half_or_rigid_models_are_refused(design, reference):
    """The linearised drive is perfect and whole; errors need an elastic ring."""
    follow, state, _ = reference
    flawed = follow.with_errors(np.full((40, 2), 1e-6), *none(follow, None)[1:])
    with pytest.raises(ValueError, match=naming("all sectors", "elastic", "errors")):
        flawed.influence(state)
    with pytest.raises(ValueError, match=naming("all sectors", "elastic", "errors")):
        influence(
            replace(follow.model, half=True), state, circular_spline_is_output=False
        )
    leaning = design.with_changes({"tolerances.misalignment_arcmin": 2.0})
    with pytest.raises(
        DesignError, match=naming("reference-3d", "tolerances", "elastic")
    ):
        solid_sector_model(leaning, elastic_circular_spline=False)
    with pytest.raises(
        DesignError, match=naming("reference-3d", "half model", "--half")
    ):
        solid_sector_model(leaning, half=True)


@pytest.mark.parametrize("layout", ["circular_spline_fixed", "flexspline_fixed"])
@pytest.mark.slow
def test_errors_keep_the_balance_of_energy(design, reference, layout):
    """T_wg is the slope of U + T psi: outline eccentric and oval, teeth, axis.

    A circular spline that is the output turns about its own, leaning axis.
    """
    changes = ERRORS | {
        "wave_generator_eccentricity_um": 3.0,
        "wave_generator_ovality_um": 3.0,
        "misalignment_arcmin": 3.0,
    }
    flawed = design.with_changes(
        {f"tolerances.{k}": v for k, v in changes.items()} | {"drive.layout": layout}
    )
    perfect, rest, _ = reference
    follow = replace(
        perfect, model=solid_sector_model(flawed), layout=layout, ratio=flawed.ratio
    )
    start = follow.to_torque(rest, TORQUE)
    theta, step = 0.4 * pitch_of(flawed), 3e-4
    middle = follow.to_angle(start, theta)
    assert middle.outcome.ok
    low, high = (follow.to_angle(middle, theta + s * step) for s in (-1, 1))
    turned = follow.output_angle(high) - follow.output_angle(low)
    gained = high.energy - low.energy + TORQUE * turned
    torque = middle.wave_generator_torque
    assert gained == pytest.approx(2.0 * step * torque, rel=1e-4)
    outside = torque + middle.holding_torque
    if layout == "circular_spline_fixed":
        assert middle.holding_torque == pytest.approx(-TORQUE, rel=1e-6)
    assert middle.tooth_moment == pytest.approx(-outside, abs=1e-6 * TORQUE)
    # it is not the torque of the perfect drive
    assert abs(torque - TORQUE / flawed.ratio) > 1e-3 * TORQUE


@pytest.mark.slow
def test_once_per_turn_needs_eccentricity_and_pitch_errors(design, reference):
    """Unequal lobes show what equal ones cancel."""
    values = {"circular_spline_cumulative_pitch_um": 3.0}
    eccentric = {"tolerances.wave_generator_eccentricity_um": 3.0}
    flawed = design.with_changes({f"tolerances.{k}": v for k, v in values.items()})
    errors = gap_errors(flawed, np.arange(42))
    _, found = influences(design.with_changes(eccentric), phases=1, model="3d")
    both, without = (orders(at, errors) for at in (found[0].at, reference[2]))
    assert both[1] > 10.0 * without[1]
    assert both[1] > 0.01 * both[2]

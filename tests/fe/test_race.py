"""Bearing of the wave generator in the plane: laws, limits and the thin-ring twin."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from messages import naming
from solved import BEARING

from swgjoint.drives.build_map import build_map
from swgjoint.errors import DesignError
from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.plane.drive2d import (
    can_halve,
    carries_bearing,
    sector_model,
    unmodelled_parts,
)
from swgjoint.fe.plane.linearise import linearise
from swgjoint.fe.plane.newton_step import Load
from swgjoint.fe.plane.race import PlaneRace
from swgjoint.fe.rings.loading import solve_loaded, solve_unloaded
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.tolerances.cycle import gap_errors, pitches_of
from swgjoint.fe.tolerances.full_solves import full_solves
from swgjoint.fe.tolerances.rest import influences
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design

TORQUE = 20.0
PITCH = 2.0 * pi / 42
FLAWED = {"tolerances.circular_spline_cumulative_pitch_um": 5.0}
MORE_ERRORS = {
    "tolerances.flexspline_cumulative_pitch_um": 10.0,
    "tolerances.random_pitch_um": 1.0,
    "tolerances.wave_generator_ovality_um": 1.0,
}
TEETH = {
    "drive.teeth_flexspline": 40,
    "drive.teeth_circular_spline": 42,
    "mesh.refinement": 0.5,
}


@cache
def small(**changes):
    """A coarse gear of 40 and 42 teeth with a bearing of even balls."""
    return Design.load("reference-2d").with_changes(TEETH | BEARING | changes)


@cache
def drive(*, half=True, cage_held=False):
    """Follows its equilibria."""
    model = sector_model(small(), half=half, cage_held=cage_held)
    return Continuation(model=model, ratio=small().ratio)


@cache
def turned_on(*, half=True, cage_held=False):
    """Under torque, at no position of symmetry of teeth and balls."""
    follow = drive(half=half, cage_held=cage_held)
    state = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
    state = follow.to_angle(state, 0.4 * PITCH)
    assert state.outcome.ok
    return state


def on_rigid_ring(design, **changes):
    """Half of a drive whose circular spline does not yield."""
    model = sector_model(design, half=True, elastic_circular_spline=False, **changes)
    return Continuation(model=model, ratio=design.ratio)


def stretched(bore, race, half):
    """Coordinates of all sectors from those of nodes, as the race's forces have them.

    Args:
        bore: Of bore nodes (N, b/2, 2).
        race: Of the race's nodes (N, m, 2, 2).
        half: Whether the last node is the opposite of the first.
    """
    last = np.roll(race[:, :1], -1, axis=0)
    last[-1] *= -1.0 if half else 1.0
    nodes = np.concatenate([race, last], axis=1)
    flat = [part.reshape(len(part), -1) for part in (bore, nodes)]
    return np.concatenate(flat, axis=1)


@pytest.mark.parametrize("half", [True, False])
def test_forces_are_the_slope_of_the_energy(half):
    """Race, balls and bore on it: gradient and tangent against central differences."""
    state, model = turned_on(half=half), drive(half=half).model
    race, rng, h = model.race, np.random.default_rng(1), 1e-9
    bore = model.skeleton(state)[:, model.bore_nodes]
    there = state.race + 1e-7 * rng.standard_normal(state.race.shape)
    bore_way, way = (rng.standard_normal(x.shape) for x in (bore, there))

    def at(s):
        points = bore + s * bore_way
        return race.forces(there + s * way, 0.1, points, state.touching)

    found, low, high = at(0.0), at(-h), at(h)
    assert found.balls.force.max() > 100.0 and state.touching.sum() > 10
    both = stretched(bore_way, way, half)
    slope = model.copies * float(np.sum(found.gradient * both))
    assert (high.energy - low.energy) / (2 * h) == pytest.approx(slope, rel=1e-6)
    bend = model.copies * float(np.einsum("si,sij,sj->", both, found.hessian, both))
    up, down = (float(np.sum(x.gradient * both)) * model.copies for x in (high, low))
    assert (up - down) / (2 * h) == pytest.approx(bend, rel=1e-6)
    gaps = np.einsum("sbi,si->sb", found.rows, both)
    assert (high.gap - low.gap) / (2 * h) == pytest.approx(gaps, abs=1e-5)


def test_newton_step_sees_the_tangent_of_the_whole_ring():
    """Gradient of rim and race together against the tangent, in the bases of nodes."""
    model, state = drive().model, turned_on()
    here = linearise(model, state, None)
    rng, h = np.random.default_rng(3), 1e-10
    way = rng.standard_normal((model.sectors, here.gradient.shape[1]))
    face = model.face_dofs
    way[:, -face:] = np.roll(way[:, :face], -1, axis=0)
    way[here.fixed] = 0.0
    shift = here.rotate_to_global(way)
    size, inside = model.element.face_size, model.element.bore_size
    nodes = way[:, model.race_dofs[:-4]].reshape(state.race.shape)

    def gradient(s):
        there = replace(
            state,
            faces=state.faces + s * shift[:, :size],
            bores=state.bores + s * shift[:, size : size + inside],
            race=state.race + s * nodes,
        )
        return linearise(model, there, None).gradient

    # forces on flanks are dead in the frames, the gradient that of strain and bearing
    free = replace(state, flank_force=np.zeros_like(state.flank_force))
    linear = linearise(model, free, None)
    tangent = linear.hessian.copy()
    tangent[0] -= linear.anchor_stiffness * np.outer(linear.anchor[0], linear.anchor[0])
    change = np.sum((gradient(h) - gradient(-h)) * way) / (2 * h)
    expected = float(np.einsum("si,sij,sj->", way, tangent, way))
    assert change == pytest.approx(expected, rel=1e-5)


def test_work_without_teeth_equals_energy():
    """T_wg dalpha + M dpsi = dU on the rolling balls, the flexspline held by M.

    Both torques are ripples, small against what a coarse race takes to stay in place.
    """
    model, follow = drive().model, drive()
    race = PlaneRace.from_design(small(), model.element, half=True, elements=760)
    model = replace(model, race=race)
    start = follow.solver(
        model, model.initial_guess(0.11, 0.0), Load(rotation=0.0, teeth=False)
    )

    def held(alpha, psi):
        moved = model.predict_field(start, alpha, psi, 0.0)
        return follow.solver(model, moved, Load(rotation=psi, teeth=False))

    h = 1e-4
    for d_alpha, d_psi in ((h, 0.0), (0.3 * h, h)):
        low, high = (held(0.11 + s * d_alpha, s * d_psi) for s in (-1, 1))
        work = 2 * start.wave_generator_torque * d_alpha
        work += 2 * start.holding_torque * d_psi
        assert high.energy - low.energy == pytest.approx(work, rel=0.01)


@pytest.mark.parametrize("cage_held", [True, False])
def test_work_equals_energy(cage_held):
    """T_wg dtheta - T dpsi = dU by central differences at a smooth position."""
    follow, state = drive(cage_held=cage_held), turned_on(cage_held=cage_held)
    h = 0.001 * PITCH
    low, high = (follow.to_angle(state, 0.4 * PITCH + s * h) for s in (-1, 1))
    work = state.wave_generator_torque * 2 * h
    gained = high.energy - low.energy + TORQUE * (high.rotation - low.rotation)
    assert gained == pytest.approx(work, rel=3e-5)
    low, high = (follow.to_torque(state, TORQUE + s * 0.05) for s in (-1, 1))
    turn = high.rotation - low.rotation
    assert high.energy - low.energy == pytest.approx(-TORQUE * turn, rel=1e-6)
    # contact points that slide along their flanks are left out of the tangent
    assert state.compliance == pytest.approx(-turn / 0.1, rel=4e-3)


def test_moments_balance():
    """What the balls push the race with and the teeth the flexspline bears the load.

    Where balls stand on the elements of the race is worth a moment, which holds it in
    its place; finer ones leave less.
    """
    off = []
    for elements in (190, 380):
        model, design = drive().model, small()
        race = PlaneRace.from_design(
            design, model.element, half=True, elements=elements
        )
        follow = Continuation(model=replace(model, race=race), ratio=design.ratio)
        state = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
        state = follow.to_angle(state, 0.4 * PITCH)
        alpha = state.wave_generator_angle
        nodes = model.skeleton(state)[:, model.bore_nodes]
        found = race.forces(state.race, alpha, nodes, state.touching)
        pushed = (
            rotate_right_angle(race.on_balls.balls(alpha, race.phase)[0])
            * found.balls.push
        )
        off.append(abs(float(pushed.sum()) + state.tooth_moment - TORQUE))
        # bore on race: nothing pulls, what does not press is apart
        assert state.pressure.min() == 0.0
        assert found.gap[~state.touching].min() > 0.0
    assert off[0] < 1e-4 * TORQUE and off[1] < 1e-5 * TORQUE
    # with a cage that stands still on the cam it is what turns the wave generator
    state = turned_on(cage_held=True)
    total = state.wave_generator_torque + state.tooth_moment
    assert total == pytest.approx(TORQUE, rel=1e-4)


def test_half_and_full_model_agree():
    """Even balls: half of the drive is the whole drive."""
    half, full = turned_on(), turned_on(half=False)
    for name in ("rotation", "energy", "wave_generator_torque", "compliance"):
        assert getattr(half, name) == pytest.approx(getattr(full, name), rel=1e-7)
    # the whole race is held on one side only
    assert half.ball_force == pytest.approx(full.ball_force, rel=1e-5, abs=1e-6)


def test_odd_balls_need_the_whole_drive():
    """Half a turn puts no ball on another; a rigid wave generator does not mind."""
    odd = small(**{"wave_generator.bearing.balls": 11})
    assert can_halve(small()) and not can_halve(odd) and can_halve(odd, bearing=False)
    with pytest.raises(
        DesignError,
        match=naming(
            "reference-2d",
            "40/42 teeth",
            "11 balls",
            "half model",
            "even",
            "tolerances",
        ),
    ):
        sector_model(odd, half=True)
    assert sector_model(odd, half=True, bearing=False).race is None


def test_held_cage_repeats_after_a_pitch():
    """Error, torque and energy; the mean torque is that of the ratio."""
    follow = drive(cage_held=True)
    state = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
    rows = []
    for k in range(13):
        state = follow.to_angle(state, k / 12 * PITCH)
        error = state.rotation - k / 12 * PITCH / small().ratio
        rows.append((error, state.wave_generator_torque, state.energy))
    table = np.array(rows)
    assert np.abs(table[-1] - table[0]).max() < 1e-6
    # 12 positions: corners where teeth come in alias
    assert table[:-1, 1].mean() == pytest.approx(TORQUE / small().ratio, rel=2e-3)


def test_turning_the_drive_as_a_whole_changes_nothing():
    """Wave generator, flexspline and race by one angle: same gaps and energy."""
    state, model = turned_on(cage_held=True), drive(cage_held=True).model
    turn, alpha = 0.7, state.wave_generator_angle
    moved = model.predict_field(state, alpha + turn, state.rotation + turn, turn)
    found = [
        model.race.forces(
            s.race,
            s.wave_generator_angle,
            model.skeleton(s)[:, model.bore_nodes],
            s.touching,
        )
        for s in (state, moved)
    ]
    assert found[1].energy == pytest.approx(found[0].energy, rel=1e-9)
    assert np.abs(found[1].gap - found[0].gap).max() < 1e-12


def test_many_hard_balls_are_the_rigid_surface():
    """Torsion over that of the rigid outline falls to 1 as balls get many and hard.

    What is left at 48 balls is the race that yields and bends between them: nodes of
    the bore that press on it lie up to 3 um inside the outline.
    """
    torsion, deepest = [], []
    for balls, diameter, race, harder in (
        (12, 4.0, 1.0, (1.0,)),
        (24, 2.0, 0.5, (1.0, 100.0)),
        (48, 1.5, 0.5, (1.0, 10.0, 100.0)),
    ):
        design = small(
            **{
                "wave_generator.bearing.balls": balls,
                "wave_generator.bearing.ball_diameter_mm": diameter,
                "wave_generator.bearing.race_thickness_mm": race,
                "wave_generator.bearing.clearance_um": 0.0,
            }
        )
        follow, state = on_rigid_ring(design), None
        for factor in harder:
            model = follow.model
            constant = factor * BallBearing.from_design(design).hertz_constant()
            own = replace(model.race.on_balls, ball_constant=constant)
            model = replace(model, race=replace(model.race, on_balls=own))
            follow = replace(follow, model=model)
            start = model.initial_guess() if state is None else state
            state = follow.solver(model, start, Load(rotation=0.0, teeth=False))
            assert state.outcome.ok
        state = follow.to_torque(follow.engage(state), TORQUE)
        assert state.outcome.ok
        nodes = model.skeleton(state)[:, model.bore_nodes]
        gap, _, _ = model.wave_generator_gap(nodes, 0.0)
        torsion.append(-state.rotation)
        deepest.append(-gap[state.touching].min())
    follow = on_rigid_ring(small(), bearing=False)
    rigid = -follow.to_torque(follow.engage(follow.deflect()), TORQUE).rotation
    over = np.array(torsion) / rigid
    assert over[0] > 3.0 and over[0] > over[1] > over[2] > 1.0
    assert over[2] < 1.05 and deepest[2] < 3.5e-6


@pytest.mark.slow
def test_thin_rings_tell_the_same():
    """Size 25, ratio 50, whole drive, 23 balls: K at small and at large torque.

    The rings smear the toothed rim over its pitch and take rigid teeth on springs. K
    rises, by more than without clearance.
    """
    rise = []
    for clearance in (None, 0.0):
        design = Design.load("size-25-50").with_changes({"mesh.refinement": 0.5})
        if clearance is not None:
            design = design.with_changes(
                {"wave_generator.bearing.clearance_um": clearance}
            )
        # the teeth of the rings have the patch of a contact alone
        model = replace(sector_model(design), indentation=None)
        follow = Continuation(model=model, ratio=design.ratio)
        state, rings = follow.engage(follow.deflect()), thin_ring(design)
        twin, found, theirs = solve_unloaded(rings, 0.0), [], []
        for torque in (5.0, 14.0, 48.0, 100.0):
            state, twin = (
                follow.to_torque(state, torque),
                solve_loaded(rings, twin, torque),
            )
            assert state.outcome.ok and twin.outcome.ok
            # 3 % where one pair of teeth more or less comes in, else below 1.5 %
            assert state.rotation == pytest.approx(twin.rotation, rel=0.035)
            found.append(state.rotation)
            theirs.append(twin.rotation)
        # between the torques: a tangent jumps by 15 % where a pair comes in
        assert np.diff(found) == pytest.approx(np.diff(theirs), rel=0.05)
        softness = np.diff(found) / [9.0, 34.0, 52.0]
        rise.append(softness[0] / softness[-1])
    assert rise[0] > 1.5 and rise[1] < 1.0


def test_no_bearing_is_no_change():
    """A design with a bearing that is left out is the design without one."""
    plain = Design.load("reference-2d").with_changes(TEETH)
    states = []
    for design, bearing in ((plain, True), (small(), False)):
        model = sector_model(design, half=True, bearing=bearing)
        follow = Continuation(model=model, ratio=design.ratio)
        states.append(follow.to_torque(follow.engage(follow.deflect()), TORQUE))
        assert states[-1].race is None
    for name in ("rotation", "energy", "compliance", "wave_generator_torque"):
        assert getattr(states[0], name) == getattr(states[1], name)


def test_labels_say_where_the_bearing_is():
    """In the plane under an outline without corners, the circular spline fixed."""
    assert (
        unmodelled_parts(small()) is None
        and unmodelled_parts(small(), "ring") is not None
    )
    assert unmodelled_parts(small(), "3d").startswith("wave_generator.bearing and ")
    assert unmodelled_parts(small(), bearing=False) == "wave_generator.bearing"
    held = small(**{"drive.layout": "flexspline_fixed"})
    assert unmodelled_parts(held) == "wave_generator.bearing"
    assert sector_model(held, half=True).race is None
    run = simulate_meshing(small(), torque=TORQUE, steps=2, turn=0.01, half=True)
    assert run.to_json()["label"]["bearing"] == "balls roll"
    balls = run.steps[1].state.ball_force
    assert balls.shape == (12,) and (balls > 0.0).sum() == 6


@pytest.mark.slow
def test_map_carries_the_bearing():
    """Softer than on the rigid surface; a pitch on it repeats, and so does a mirror."""
    rated = {"ratings.rated_torque_Nm": 10.0, "ratings.repeated_peak_Nm": 20.0}
    found = build_map(small(**rated), model="2d", angles=8, cache=False)
    plain = Design.load("reference-2d").with_changes(TEETH | rated)
    rigid = build_map(plain, model="2d", angles=8, cache=False)
    soft, hard = (max(m.info["stiffness_range_Nm_rad"]) for m in (found, rigid))
    assert soft < 0.3 * hard
    again = found.info["second_pitch"]
    assert again["largest_difference_rad"] < 1e-9  # samples are solved to that
    # of a rotation of 2e-4 rad
    assert abs(found.info["mirror"]["difference_rad"]) < 2e-9
    label = found.info["label"]
    assert label["bearing"] == "balls at rest on the cam, their passage left out"
    assert label["left_out"] is None and rigid.info["label"]["bearing"] is None
    # also where another member is fixed, with the stiffness of the same gear
    other = small(**rated, **{"drive.layout": "flexspline_fixed"})
    moved = build_map(other, model="2d", angles=8, cache=False)
    assert moved.max_stiffness == pytest.approx(found.max_stiffness * (42 / 40) ** 2)
    assert moved.info["label"]["bearing"] == label["bearing"]


@pytest.mark.parametrize("clearance_um", [20.0, 120.0])
def test_superposed_errors_meet_full_solves_on_the_balls(clearance_um):
    """Within 1 % of the cycle up to half the peak torque, with play (120 um) or none.

    The positions are linearised under load, so that the same balls are pressed.
    """
    key = "wave_generator.bearing.clearance_um"
    # an eccentric cam would take up the play
    offset = {"tolerances.wave_generator_eccentricity_um": min(3.0, 120 - clearance_um)}
    design = small(**FLAWED, **MORE_ERRORS, **offset, **{key: clearance_um})
    rated, phases = ratings_of(design).rated_torque, 2
    follow, rests = influences(design, phases=phases)
    assert follow.model.race is not None
    assert all((rest.opposite is not None) == (clearance_um > 100) for rest in rests)
    levels = (0.2 * rated, rated)
    rests = [rest.under_both_signs(follow, np.array(levels)) for rest in rests]
    pitches = np.arange(pitches_of(design))
    errors = gap_errors(design, pitches)
    positions = np.array([31, 300, 555, 1000, 1231, 1500])
    solved = full_solves(design, follow, rests, positions, levels)
    assert solved.torque.size == positions.size * len(levels)
    for torque in levels:
        superposed = []
        for k, rest in enumerate(rests):
            _, at = rest.near(torque)
            angle = at.respond(at.gap_change(*errors), torque).output_angle
            superposed.append(angle - PITCH * k / phases / design.ratio)
        cycle = np.array(superposed).T.ravel()
        assert np.isfinite(cycle).all()
        wrong = cycle[positions] - solved.output_error[solved.torque == torque]
        assert np.abs(wrong).max() < 0.01 * np.ptp(cycle)


@pytest.mark.slow
def test_a_map_with_errors_has_its_bearing():
    """Pattern and errors on the balls: soft as without errors, with its play.

    Errors take some teeth out of contact, so that the drive becomes softer.
    """
    peak = {"ratings.rated_torque_Nm": 5.0}
    clearance = {"wave_generator.bearing.clearance_um": 120.0}
    design = small(**FLAWED, **peak, **clearance)
    rigid = design.with_changes({"wave_generator.bearing": None})
    found, perfect, stiff = (
        build_map(d, model="2d", angles=6, cache=False)
        for d in (design, small(**peak, **clearance), rigid)
    )
    assert found.info["label"]["left_out"] is None
    assert found.info["label"]["bearing"] is not None
    assert found.info["tolerances"]["free_positions"] > 0
    for part in (0.3, 1.0, 2.0):
        torsion = [m.mean_torsion(part * 5.0) for m in (found, perfect, stiff)]
        assert 0.98 * torsion[1] < torsion[0] < 1.15 * torsion[1]
        assert torsion[0] > 4.0 * torsion[2]
    rows = found.info["validation"]["rows"]
    # half of the solves are where the drive is softest; in the clearance, six angles
    # do not follow it, and the record says so
    at = [row for row in rows if abs(row["torque_Nm"]) == 5.0]
    assert len(at) == 2
    assert max(row["output_error_largest"] for row in at) < 0.05


def test_three_lobes_keep_the_rigid_wave_generator():
    """A search begins with two lobes of the race."""
    three = Design.load("reference-2d").with_changes(
        {"drive.teeth_circular_spline": 123, "wave_generator": {"kind": "cosine"}}
        | BEARING
    )
    assert three.lobes == 3
    assert not carries_bearing(three)


def test_exchanges_at_one_linearisation_lead_to_the_same_equilibrium():
    """The nodes on the race settle without another search for contact."""
    follow, state = drive(), turned_on()
    plain = replace(follow, solver=replace(follow.solver, exchanges=0))
    one, other = (f.to_torque(state, 2.5 * TORQUE) for f in (follow, plain))
    assert len(one.history) < len(other.history)
    assert np.abs(one.faces - other.faces).max() < 1e-11
    assert one.touching.tobytes() == other.touching.tobytes()


def test_an_exchange_changes_the_tangent_as_the_node_on_the_race_does():
    """Taken in or out of the linearised ring, or linearised anew."""
    model, state = drive().model, turned_on()
    linear, found = (linearise(model, state, state.torque) for _ in range(2))
    stations = np.abs(linear.gap) < 8e-8
    assert (stations & state.touching).any() and (stations & ~state.touching).any()
    sectors = found.exchange(stations, state.touching)
    assert sectors.tolist() == np.flatnonzero(stations.any(axis=1)).tolist()
    other = replace(state, touching=state.touching ^ stations)
    wanted = linearise(model, other, state.torque)
    scale = np.abs(wanted.gradient).max()
    assert np.abs(found.gradient - wanted.gradient).max() < 1e-12 * scale
    # but for the curvature of the race, in proportion to the gap
    size = np.abs(wanted.hessian).max()
    assert np.abs(linear.hessian - wanted.hessian).max() > 1e-3 * size
    assert np.abs(found.hessian - wanted.hessian).max() < 1e-4 * size

"""Outer race of the wave generator on its balls, in space: laws."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from messages import naming
from solved import BEARING

from swgjoint.errors import DesignError
from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.wave_generator.race import AXIAL, NODE, ROLL, SIGN, SolidRace
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.neutral_line import NeutralLine
from swgjoint.gear.wave_generators.ellipse import Elliptical

TORQUE = 5.0


@pytest.fixture(scope="module")
def design(small_design):
    """The small gear with a bearing, the race narrower than the teeth."""
    return small_design.with_changes(BEARING)


@pytest.fixture(scope="module")
def model(design, few_masters):
    """Half of it."""
    return solid_sector_model(
        design,
        half=True,
        bearing="free",
        elastic_circular_spline=False,
        orders=few_masters,
    )


@pytest.fixture(scope="module")
def drive(design, model):
    """Follows its equilibria."""
    return SolidContinuation(model=model, ratio=design.ratio)


@pytest.fixture(scope="module")
def deflected(drive):
    """On the balls, no tooth contact."""
    return drive.deflect()


@pytest.fixture(scope="module")
def turned_on(drive, deflected):
    """Under torque, at no position of symmetry of teeth and balls."""
    state = drive.to_torque(drive.engage(deflected), TORQUE)
    return drive.to_angle(state, 0.4 * 2.0 * pi / 42)


def at_nodes(sectors):
    """Sum by nodes of what sectors give to both of theirs, of half a ring."""
    last = np.roll(sectors[:, NODE:], 1, axis=0)
    last[0] *= SIGN
    return sectors[:, :NODE] + last


def test_forces_are_the_slope_of_the_energy(model, deflected):
    """Race, balls and roll: gradient and tangent against central differences."""
    race, rng, h = model.race, np.random.default_rng(1), 1e-8
    here = deflected.race + 2e-6 * rng.standard_normal(deflected.race.shape)
    way = rng.standard_normal(here.shape)
    way[0, 0, [0, 1, 3]] = 0.0  # held there
    found = race.forces(here, 0.1)
    low, high = (race.forces(here + s * h * way, 0.1) for s in (-1.0, 1.0))
    gradient = at_nodes(found.gradient)
    slope = 2.0 * float(np.sum(gradient * way.reshape(len(way), NODE)))
    assert (high.energy - low.energy) / (2.0 * h) == pytest.approx(slope, rel=1e-6)
    change = (at_nodes(high.gradient) - at_nodes(low.gradient)) / (2.0 * h)
    tangent = np.einsum("sij,sj->si", found.hessian, race.elements(way))
    seen = at_nodes(tangent)
    assert np.abs(change - seen)[1:].max() < 1e-6 * np.abs(seen).max()


def test_gap_changes_as_its_derivatives_say(model, deflected):
    """By the points and by the race, crown and roll included."""
    race, rng, h = model.race, np.random.default_rng(2), 1e-8
    frame = model.frames(deflected)[0]
    local = model.bore_positions(frame, deflected)
    points = np.einsum("sij,spj->spi", frame.turn, local)
    here = deflected.race + 1e-5 * rng.standard_normal(deflected.race.shape)
    way, moved = (rng.standard_normal(part.shape) for part in (here, points))
    _, by_point, by_race = race.gap(here, points, model.bore_places)
    low, high = (
        race.gap(here + s * h * way, points + s * h * moved, model.bore_places)[0]
        for s in (-1.0, 1.0)
    )
    expected = np.einsum("sbi,sbi->sb", by_point, moved)
    expected += np.einsum("sbi,si->sb", by_race, race.elements(way))
    assert (high - low) / (2.0 * h) == pytest.approx(expected, abs=1e-6)
    assert np.abs(by_race[..., AXIAL]).max() == 0.0


def test_race_on_the_outline_is_the_rigid_surface(model, deflected):
    """Mean line half its thickness inside the outline, no roll: the gap to 0.1 um.

    A cubic on 1/40 of a turn misses two lobes of 1 mm by h^4 16 w0/384, 0.03 um, and as
    much again where points see it beyond their own sector. The rigid surface has the
    crown of the race and no slope.
    """
    race, alpha = model.race, 0.3
    surface = replace(model.wave_generator, slope=0.0)
    offset = 0.5 * race.on_balls.bearing.race_thickness
    line = replace(
        race.on_balls.cam,
        offset=-offset,
        radius=surface.outline.perimeter / (2.0 * pi) - offset,
    )
    h = 1e-6

    def pose(angle):
        point = line.pose(angle.ravel()).point.reshape(*angle.shape, 2)
        return rotate(point, alpha)

    angle = race.pitch * (np.arange(race.sectors) - 0.5)
    coordinates = np.zeros((race.sectors, 2, 4))
    coordinates[:, 0, :2] = pose(angle)
    slope = (pose(angle + h) - pose(angle - h)) / (2.0 * h)
    coordinates[:, 1, :2] = slope * race.pitch
    bore = model.strip.bore
    phi = race.pitch * np.arange(race.sectors)[:, None]
    outside = pose(phi + np.arctan2(-bore[:, 0], bore[:, 1]))
    points = np.zeros((race.sectors, len(bore), 3))
    points[..., :2] = outside * (1.0 + (offset + 1e-5) / 0.018)
    points[..., 2] = bore[:, 2]
    gap = race.gap(coordinates, points, model.bore_places)[0]
    expected = surface.gap(points.reshape(-1, 3), alpha)[0].reshape(gap.shape)
    assert np.ptp(expected) > 1e-5
    assert gap == pytest.approx(expected, abs=1e-7)


def rolled(race, roll, axial, lobes):
    """Nodes with roll theta = roll cos(lobes phi) [rad] and axial motion axial cos."""
    n = race.on_balls.race.elements
    phi, step = 2.0 * pi / n * np.arange(n), 2.0 * pi / n
    wave = np.cos(lobes * phi), -lobes * step * np.sin(lobes * phi)
    nodes = np.zeros((n, 2, 4))
    for k in range(2):
        nodes[:, k, 2] = 0.5 * race.outside.width * roll * wave[k]
        nodes[:, k, 3] = axial * wave[k]
    return nodes


def out_of_plane_energy(race, *motion):
    """Of such a roll, whole."""
    nodes = rolled(race, *motion)
    both = replace(race, half=False).elements(nodes)[:, np.r_[ROLL, AXIAL]]
    return 0.5 * float(np.einsum("si,ij,sj->", both, race.roll.stiffness, both))


def test_roll_of_a_ring_has_its_closed_forms(model):
    """Even roll, two lobes held or free along the axis, and a tilt, which is free."""
    race, roll = model.race, 0.01
    r = race.on_balls.race.radius
    around = 2.0 * pi * r
    even = 0.5 * race.roll.rolling * (roll / r) ** 2 * around
    assert out_of_plane_energy(race, roll, 0.0, 0) == pytest.approx(even, rel=1e-9)
    held = (
        0.25 * (race.roll.rolling + 4.0 * race.roll.twisting) * (roll / r) ** 2 * around
    )
    assert out_of_plane_energy(race, roll, 0.0, 2) == pytest.approx(held, rel=1e-4)
    least = min(
        out_of_plane_energy(race, roll, -roll * r * part, 2)
        for part in np.linspace(0.2, 0.35, 16)
    )
    assert least < 0.2 * held
    tilt = out_of_plane_energy(race, roll, -roll * r, 1)
    assert tilt < 1e-6 * out_of_plane_energy(race, roll, 0.0, 1)


def test_anchor_gives_way_to_the_softest_roll():
    """What it adds to two lobes that warp, so that a step goes all of its way but 1 %.

    At size 25 and ratio 100, whose 200 short elements are stiff and whose race is not.
    """
    race = SolidRace.from_design(Design.load("size-25-100"), half=False)
    r, roll = race.on_balls.race.radius, 0.01
    motions = [(roll, -roll * r * part, 2) for part in np.linspace(0.2, 0.35, 16)]
    softest = min(motions, key=lambda motion: out_of_plane_energy(race, *motion))
    here = race.coordinates(np.zeros((race.sectors, 2, 4)), 0.0)
    moved = race.elements(rolled(race, *softest))
    tangent = race.forces(here, 0.0).hessian
    stiff = 0.5 * float(np.einsum("si,sij,sj->", moved, tangent, moved))
    own = out_of_plane_energy(race, *softest)
    assert own <= stiff < 1.01 * own


def moments(model, state):
    """Of the balls on the race and of the race on the bore, whole drive [N·m]."""
    race = model.race
    balls = race.forces(state.race, state.wave_generator_angle).balls
    centre = race.on_balls.balls(state.wave_generator_angle, race.phase)[0]
    frame = model.frames(state)[0]
    local = model.bore_positions(frame, state)
    points, force = (
        np.einsum("sij,spj->spi", frame.turn, part)
        for part in (local, state.bore_force.reshape(local.shape))
    )
    on_bore = 2.0 * float(np.sum(rotate_right_angle(points[..., :2]) * force[..., :2]))
    return float(np.sum(balls.push * rotate_right_angle(centre))), on_bore


def test_balls_teeth_and_load_balance(model, turned_on):
    """Teeth and bore carry T; bore and balls press alike but for what is held.

    Between its nodes a race bends as cubics do, so that balls of 1400 N on elements of
    3 mm press a little along it: Q^2 h^2/(400 E I), 1 N, at the node that is held.
    """
    of_balls, of_bore = moments(model, turned_on)
    assert turned_on.tooth_moment + of_bore == pytest.approx(TORQUE, rel=1e-7)
    assert of_bore == pytest.approx(of_balls, abs=0.005 * TORQUE)
    assert abs(of_bore) > 0.04 * TORQUE
    loaded = turned_on.ball_force > 0.0
    assert 4 <= loaded.sum() < 12


@pytest.mark.slow
def test_ball_and_bore_forces_balance(design, few_masters):
    """Net forces of an odd number of balls and of the bore, along x and y.

    At no position of symmetry, so that 5 N are left; node 0 is held along x, see above.
    """
    odd = design.with_changes({"wave_generator.bearing.balls": 11})
    whole = solid_sector_model(
        odd, bearing="free", elastic_circular_spline=False, orders=few_masters
    )
    state = SolidContinuation(model=whole, ratio=odd.ratio).deflect(0.1)
    assert state.outcome.ok
    balls = whole.race.forces(state.race, state.wave_generator_angle).balls
    frame = whole.frames(state)[0]
    on_bore = state.bore_force.reshape(whole.sectors, -1, 3)
    on_bore = np.einsum("sij,spj->i", frame.turn, on_bore)
    x, y = balls.push.sum(axis=0)
    assert abs(y) > 1.0
    assert on_bore[1] == pytest.approx(y, rel=1e-6)
    assert on_bore[0] == pytest.approx(x, abs=1e-3 * balls.force.max())


@pytest.mark.parametrize(("clearance", "figure"), [(0.0, 4.37), (5e-6, 5.0)])
def test_rigid_race_after_stribeck(model, clearance, figure):
    """A round race moved over a round cam: Q = 4.37 P/Z without clearance, 5 with."""
    own = model.race.on_balls
    bearing = replace(own.bearing, clearance=clearance, balls=24)
    centres = bearing.raceways[0] + 0.5 * bearing.ball_diameter
    circle = Elliptical(major=centres, minor=centres)
    cam = NeutralLine(outline=circle, lobes=2, radius=centres, offset=0.0)
    race = replace(
        model.race, half=False, on_balls=replace(own, bearing=bearing, cam=cam)
    )
    moved = np.zeros((race.sectors, 2, 4))
    moved[:, 0, 1] = -10e-6
    still = np.arange(race.sectors)
    moved[:, 0, :2] = rotate(moved[:, 0, :2], -race.pitch * still)
    found = race.forces(race.coordinates(moved, 0.0), 0.0)
    resultant = found.balls.push.sum(axis=0)
    assert abs(resultant[0]) < 1e-9 * abs(resultant[1])
    assert found.balls.force[0] == found.balls.force.max()  # the ball at the top
    expected = figure * abs(resultant[1]) / bearing.balls
    # with clearance the factor depends on it: 5 is customary
    assert found.balls.force[0] == pytest.approx(
        expected, rel=0.05 if clearance else 0.01
    )
    # moved without bending: what holds the nodes is the balls' push
    held = found.gradient[:, [0, 1, 8, 9]].reshape(-1, 2, 2).sum(axis=(0, 1))
    free = np.flatnonzero(~found.fixed[0, :2])
    assert -held[free] == pytest.approx(resultant[free], abs=0.02 * abs(resultant[1]))


def test_contact_is_on_the_race_alone(model, turned_on):
    """Beside the race nothing presses; on it nothing overlaps, nothing pulls."""
    from swgjoint.fe.solid.linearise import bore_contact

    contact = bore_contact(model, turned_on, model.frames(turned_on)[0])
    count = len(model.strip.bore)
    on = model.race.covers(model.strip.bore[:, 2])
    assert 0 < on.sum() < count
    assert np.abs(turned_on.pressure[:, :count][:, ~on]).max() == 0.0
    assert contact.gap[contact.present].min() > -1e-9
    assert turned_on.pressure.min() > -1e-6  # of hundreds of newtons
    assert turned_on.pressure.max() > 100.0


def test_input_torque_is_the_slope_of_the_energy(model, drive, turned_on):
    """T_wg and the work on what is held are d(U + T psi)/d alpha; finer steps agree."""
    alpha, torque = turned_on.wave_generator_angle, turned_on.wave_generator_torque
    of_balls, of_bore = moments(model, turned_on)
    held = (of_balls - of_bore) / turned_on.race[0, 0, 1]  # along x at node 0
    errors = []
    for step in (2e-2, 2e-3):
        h = step * 2.0 * pi / 42
        low, high = (drive.to_angle(turned_on, alpha + s * h) for s in (-1.0, 1.0))
        moved = (high.race - low.race)[0, 0, 0]
        work = [s.energy + TORQUE * s.rotation for s in (low, high)]
        slope = (work[1] - work[0] - held * moved) / (2.0 * h)
        errors.append(abs(slope / torque - 1.0))
    assert errors[1] < 3e-5
    assert errors[1] < 0.5 * errors[0]


def test_race_rolls_with_the_cone_unless_its_warping_is_held(model, design, deflected):
    """At a lobe the edge towards the closed end goes in; held axially by less."""
    stiff = replace(model, race=replace(model.race, axially_free=False))
    held = SolidContinuation(model=stiff, ratio=design.ratio).deflect()
    assert held.outcome.ok
    free, less = (state.race[0, 0, 2] for state in (deflected, held))
    assert free < 1.2 * less < 0.0
    assert np.abs(held.race[..., 3]).max() == 0.0
    assert np.abs(deflected.race[..., 3]).max() > 1e-5


def test_bearing_is_absent_unless_asked_for(design, few_masters):
    """A design with a bearing keeps its rigid wave generator."""
    plain = solid_sector_model(
        design, half=True, elastic_circular_spline=False, orders=few_masters
    )
    assert plain.race is None
    assert plain.initial_guess().race is None
    assert plain.size == 3 * plain.strip.masters.size


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({"wave_generator.bearing": None}, ("wave_generator.bearing",)),
        (
            {"wave_generator.bearing.balls": 11},
            ("wave_generator.bearing.balls", "11", "even"),
        ),
    ],
)
def test_what_is_not_modelled_is_refused(design, changes, wanted):
    """One line that says what."""
    with pytest.raises(DesignError, match=naming("reference-3d-modified", *wanted)):
        solid_sector_model(design.with_changes(changes), half=True, bearing="free")

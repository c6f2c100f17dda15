"""Friction of a thin-ring drive that turns: laws of the torque on its input."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from solved import hundred_elements

from swgjoint.errors import DesignError
from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.rings import model as rings
from swgjoint.fe.rings import running as ring_running
from swgjoint.fe.rings.contacts import linearise, race_on_balls
from swgjoint.fe.rings.equilibrium import ThinRingSolver, rim_rotation
from swgjoint.fe.rings.facing import distances_to_ring
from swgjoint.fe.rings.loading import (
    positions,
    solve_loaded,
    solve_unloaded,
    without_torque,
)
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.running import (
    STEP,
    RunningFriction,
    running_friction,
    running_over_load,
)
from swgjoint.fe.rings.sliding import weighted_median
from swgjoint.gear.bearing.rolling_friction import GreasedBearing
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design

ANGLE = 0.3
ANCHOR = ThinRingSolver().anchor
TORQUE = 5.0
TIGHT = {
    "wave_generator.bearing.clearance_um": 0.0,
    "flexspline.thickness_coefficient": 1.03,
}
"""Teeth too thick for their spaces: both flanks are pressed without any torque."""


@pytest.fixture(scope="module", autouse=True)
def few_elements():
    """The laws hold for rings of any number of elements."""
    with hundred_elements():
        yield


@pytest.fixture(scope="module")
def design():
    """100 teeth, rim of 0.0125 pitch diameters, where few contacts change in a step."""
    return Design.preset("size-25-50").with_changes({"flexspline.rim_mm": 0.79375})


def standing(model, theta, torque):
    """Equilibrium at an input angle."""
    state = without_torque(model, theta)
    return solve_loaded(model, state, torque) if torque else state


def race_forces(model, state, way):
    """Friction of rim on race, mu = 1, on all coordinates; the race takes no moment.

    Args:
        model: The rings.
        state: Equilibrium.
        way: How the coordinates move.
    """
    rim, race = np.split(state.q, [model.rim.size])
    half = 0.5 * model.bearing.race_thickness
    points = model.bore.points(rim)[0]
    seen = distances_to_ring(model.race, race, points, state.bore_feet, inside=False)
    normal = model.press_per_point * np.maximum(half - seen.distance, 0.0)
    dofs, rows, _ = model.bore.rows(rim, seen)
    # the outside of the race lags where its section turns
    by_race = seen.by_ring[:, 1] + half * seen.by_ring[:, 2]
    slip = np.einsum("ni,ni->n", rows[:, 1], way[dofs])
    slip += np.einsum("ni,ni->n", by_race, way[seen.dofs + model.rim.size])
    # creep at which the moments balance; the last point takes what is left over
    arm = np.einsum("ni,ni->n", rotate_right_angle(points), seen.tangent)
    order = np.argsort(slip / arm)
    moment = (normal * arm)[order]
    below = np.concatenate([[0.0], np.cumsum(moment)])
    part = np.clip((below[-1] / 2.0 - below[:-1]) / np.maximum(moment, 1e-300), 0, 1)
    push = np.empty_like(normal)
    push[order] = (1.0 - 2.0 * part) * normal[order]
    force = np.zeros(model.size)
    np.add.at(force, dofs, -push[:, None] * rows[:, 1])
    np.add.at(force, seen.dofs + model.rim.size, -push[:, None] * by_race)
    return force


def tooth_forces(model, state, way):
    """The same of the teeth on the circular spline."""
    force = np.zeros(model.size)
    if not state.loaded_teeth:
        return force
    nodes = state.q[: model.rim.size].reshape(-1, 2, 2)[:: model.nodes_per_tooth]
    j = state.contacts.sector
    foot, slope = nodes[j, 0], nodes[j, 1]
    angle = np.arctan2(-slope[:, 1], -slope[:, 0])
    along = rotate(state.contacts.tangent, angle)
    arm = rotate(state.contacts.point, angle) - foot
    turn = rotate_right_angle(slope) / np.einsum("ni,ni->n", slope, slope)[:, None]
    row = np.concatenate(
        [along, np.einsum("ni,ni->n", along, rotate_right_angle(arm))[:, None] * turn],
        axis=1,
    )
    dofs = 4 * model.nodes_per_tooth * j[:, None] + np.arange(4)
    slip = np.einsum("ni,ni->n", row, way[dofs])
    np.add.at(force, dofs, -(state.tooth_force * np.sign(slip))[:, None] * row)
    return force


def torque_under_friction(design, torque, direction):
    """Input torque that friction forces in the equilibrium add, per mu [N·m].

    Parts of teeth and race: loads on the tangent of the rings, the torque from the
    balls. What leaves the output free of teeth holds it, at the ideal ratio, and takes
    its part of the power: friction drags a free flexspline along to the next flank.
    """
    model = thin_ring(design)
    ends = [
        standing(model, ANGLE + part * STEP * direction, torque) for part in (-0.5, 0.5)
    ]
    way = (ends[1].q - ends[0].q) / STEP
    state = standing(model, ANGLE, torque)
    state, total, held = linearise(model, state, teeth=bool(state.loaded_teeth))
    _, turn = rim_rotation(model, state.q, state.rotation)
    found = []
    for forces in (tooth_forces, race_forces):
        right = np.stack([forces(model, state, way), turn], axis=1)
        shift, reach = total.solve(model.order, held, right, ANCHOR).T
        load = 0.0
        if not state.loaded_teeth:
            load = float(turn @ shift) / float(turn @ reach)
            shift = shift - load * reach
        part = 1e-7 / np.abs(shift).max(initial=1e-30)
        race, moved = state.q[model.rim.size :], shift[model.rim.size :]
        up, down = (
            race_on_balls(model, state, race + sign * part * moved).input_torque
            for sign in (1.0, -1.0)
        )
        found.append((up - down) / (2.0 * part) - load / model.ratio)
    return found


@pytest.mark.parametrize(
    ("changes", "torque", "direction"),
    [({}, 0.0, -1.0), ({}, TORQUE, 1.0), (TIGHT, 0.0, -1.0)],
)
def test_work_is_what_friction_forces_take(design, changes, torque, direction):
    """Forces of friction in the equilibrium ask for it, against either direction."""
    own = design.with_changes(changes)
    found = running_friction(own, torque=torque, angles=[ANGLE])
    teeth, race = torque_under_friction(own, torque, direction)
    # 1 %: contacts that come in or leave within the step
    assert direction * teeth == pytest.approx(found.teeth[0], rel=0.01)
    assert direction * race == pytest.approx(found.race[0], rel=0.01)
    assert (found.tooth_pairs[0] > 0.0) == (found.teeth[0] > 0.0) == bool(teeth)
    assert found.race[0] > 0.0


@pytest.fixture(scope="module")
def free(design):
    """Turning without load at one angle."""
    return running_friction(design, angles=[ANGLE])


@pytest.mark.parametrize("angle", [0.2, 0.5, 5.8])
def test_output_with_errors_and_play_comes_to_rest(design, angle):
    """One tooth holds the ideal angle; the output gives way until none does.

    Between the teeth nothing holds the output, where Newton's method without torque
    jumps to and fro.
    """
    flawed = design.with_changes(
        {
            "tolerances.flexspline_cumulative_pitch_um": 13.4,
            "tolerances.circular_spline_cumulative_pitch_um": 13.4,
            "tolerances.random_pitch_um": 0.92,
            "tolerances.wave_generator_ovality_um": 5.0,
            "tolerances.wave_generator_eccentricity_um": 3.0,
            "tolerances.circular_spline_ovality_um": 6.0,
            "tolerances.circular_spline_eccentricity_um": 4.0,
            "tolerances.seed": 1,
        }
    )
    model = thin_ring(flawed)
    ideal = solve_unloaded(model, angle)
    free = without_torque(model, angle)
    assert free.outcome.ok
    assert abs(ideal.torque) > 1e-3 * ratings_of(design).rated_torque
    assert abs(free.torque) < 1e-5 * ratings_of(design).rated_torque
    assert free.energy < ideal.energy


def test_rings_that_bend_without_stretching(design):
    r"""Race alone: N times what two inextensional rings slide, within 10 %.

    Bent to :math:`w_0\cos 2\varphi` a section turns by :math:`\frac32 w_0\sin
    2\varphi/R`, so surfaces a and b from the mean lines slide per turn of the lobes by
    :math:`3 w_0 (a/R_a + b/R_b)\cos 2\varphi`, less the creep. What a real lobe has of
    higher order is left out.
    """
    own = design.with_changes({"wave_generator.bearing.clearance_um": 0.0})
    found = running_friction(own, angles=[ANGLE])
    model = thin_ring(own)
    state = without_torque(model, ANGLE)
    rim, race = np.split(state.q, [model.rim.size])
    points = model.bore.points(rim)[0]
    half = 0.5 * model.bearing.race_thickness
    seen = distances_to_ring(model.race, race, points, state.bore_feet, inside=False)
    normal = model.press_per_point * np.maximum(half - seen.distance, 0.0)
    depth = model.rim.radius - model.bearing.bore_radius
    lever = depth / model.rim.radius + half / model.race.radius
    angle = np.arctan2(-points[:, 0], points[:, 1]) - ANGLE
    slides = 3.0 * model.lobe_height * lever * np.cos(2.0 * angle)
    closed = normal @ np.abs(slides - weighted_median(slides, normal))
    assert found.teeth == 0.0
    assert found.race == pytest.approx(closed, rel=0.1)


def test_without_coefficient_nothing_and_with_it_in_proportion(free):
    """Zero at mu = 0, linear in mu, both parts count; a start needs the worst angle."""
    assert free.running_torque(0.0, 0.0, 1e-4) == free.ball_torque(0.0, 1e-4)[0]
    more = free.running_torque(0.1, 0.0, 1e-4) - free.running_torque(0.0, 0.0, 1e-4)
    assert more == pytest.approx(0.1 * (free.teeth + free.race)[0])
    assert free.teeth_share == 0.0
    made = RunningFriction(
        input_angle=np.arange(3.0),
        elastic=np.array([0.3, 0.0, -0.3]),
        teeth=np.array([1.0, 3.0, 2.0]),
        race=np.array([3.0, 5.0, 4.0]),
        tooth_pairs=np.zeros(3),
        lobe_force=np.zeros((3, 2)),
        bending=np.zeros(3),
        bearing=free.bearing,
    )
    assert made.running_torque(0.1, 200.0, 1e-4) == pytest.approx(0.6)
    assert made.teeth_share == pytest.approx(1.0 / 3.0)
    assert made.starting_torque(0.1) == pytest.approx(0.8)
    assert made.starting_torque(0.01) == pytest.approx(0.34)


def test_lobes_push_alike_and_roll_as_two_bearings(design, free):
    """Balls in balance; twice the moment of one lobe, which load makes larger."""
    one, other = free.lobe_force[0]
    # an odd number of balls does not press both lobes at the same places
    assert one == pytest.approx(other, rel=0.02)
    model = thin_ring(design)
    state = without_torque(model, ANGLE)
    assert 0.8 * state.ball_force.sum() < one + other < state.ball_force.sum()
    speed, oil = 200.0, 1e-4
    bearing = GreasedBearing.from_bearing(free.bearing, oil)
    twice = 2.0 * bearing.friction_torque(0.5 * (one + other), speed)
    assert free.ball_torque(speed, oil)[0] == pytest.approx(twice, rel=1e-3)
    loaded = running_friction(design, torque=TORQUE, angles=[ANGLE])
    assert loaded.lobe_force.sum() > free.lobe_force.sum()
    assert loaded.ball_torque(speed, oil) > free.ball_torque(speed, oil)


def test_without_friction_the_input_balances_the_load(design):
    """T/i but for the ripple of balls and teeth, which is below 1 %."""
    torque = 4.0 * TORQUE
    found = running_friction(design, torque=torque, angles=[ANGLE])
    assert found.elastic == pytest.approx(torque / design.ratio, rel=0.01)
    # load presses the teeth on: they rub more than the race does
    assert found.teeth_share > 0.5


def test_similar_drives_take_torque_in_proportion(design, free):
    """Twice all lengths, clearances too: eight times the torque."""
    bearing = design.wave_generator.bearing
    large = Design.preset("size-50-50").with_changes(
        {
            "wave_generator.bearing.clearance_um": 2.0 * bearing.clearance_um,
            "flexspline.rim_mm": 2.0 * design.flexspline.rim_mm,
        }
    )
    found = running_friction(large, angles=[ANGLE])
    # 1e-3: profiles of the family are rounded to a nanometre
    assert found.race == pytest.approx(8.0 * free.race, rel=1e-3)


def test_neither_step_nor_elements_matter(design, free, monkeypatch):
    """A tenth of the step, twice the elements of both rings: 0.1 %."""
    monkeypatch.setattr(ring_running, "STEP", 0.1 * STEP)
    monkeypatch.setattr(rings, "ELEMENTS", 2 * rings.ELEMENTS)
    found = running_friction(design, angles=[ANGLE])
    assert found.race == pytest.approx(free.race, rel=1e-3)


@pytest.mark.slow
def test_positions_stand_for_the_passage(design):
    """Other angles, half as many: the same mean within 0.5 %."""
    model = thin_ring(design)
    few, other = positions(model, 3), positions(model, 4) + 0.1
    means = [running_friction(design, angles=at).per_mu.mean() for at in (few, other)]
    assert means[0] == pytest.approx(means[1], rel=0.005)


def test_the_coefficient_of_the_design_is_not_looked_at(design, free):
    """It multiplies the result; what the rings do not hold is refused."""
    rubs = design.with_changes({"friction.tooth_coefficient": 0.1})
    assert running_friction(rubs, angles=[ANGLE]).race == pytest.approx(free.race)
    with pytest.raises(
        DesignError,
        match=naming("reference-2d", "wave_generator.bearing", "table", "2d model"),
    ):
        running_friction(Design.preset("reference-2d"))


def test_loads_on_one_path_equal_loads_alone(design):
    """Starting from another equilibrium changes no result."""
    path = running_over_load(design, (0.0, TORQUE, 4.0 * TORQUE), angles=[ANGLE])
    for one, torque in zip(path, (0.0, TORQUE, 4.0 * TORQUE), strict=True):
        alone = running_friction(design, torque=torque, angles=[ANGLE])
        # 1e-6: the solver ends below its tolerance, not at round-off
        assert one.per_mu == pytest.approx(alone.per_mu, rel=1e-6)
        assert one.bending == pytest.approx(alone.bending, rel=1e-6)
        assert one.elastic == pytest.approx(alone.elastic, rel=1e-6)


def test_a_flooded_bearing_drags_once(free):
    """One bearing, however many lobes it has; a start has no drag."""
    oil = GreasedBearing.from_bearing(free.bearing, 1e-4)
    assert free.drag_torque(200.0, 1e-4) == oil.drag_torque(200.0) > 0.0
    assert free.drag_torque(0.0, 1e-4) == 0.0

"""Fields of equilibria: continuity, balance with the loads, the passage of a lobe."""

from __future__ import annotations

from functools import cache
from math import pi

import numpy as np
import pytest
from solved import kept

from swgjoint.fe.meshing import simulate_meshing
from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.plane.elasticity import stress_maxima
from swgjoint.fe.plane.fields import (
    circular_spline_field,
    flexspline_field,
    root_stress,
    tooth_angles,
    tooth_forces,
    wave_generator_contact,
)
from swgjoint.fe.plane.stress import flexspline_stress
from swgjoint.gear.design.design import Design
from swgjoint.units import deg

TORQUE = -20.0
"""Against the motion of the output: the input drives."""


@cache
def half_turn():
    design = Design.load("reference-2d")
    return kept(
        "half a turn",
        lambda: simulate_meshing(design, torque=TORQUE, steps=24, half=True),
    )


def state():
    return half_turn().steps[5].state


@pytest.mark.parametrize("field", [flexspline_field, circular_spline_field])
def test_members_are_continuous(field):
    """Sectors meet in the same points with the same stress, all around the drive."""
    model = half_turn().model
    found = field(model, state())
    element = model.element
    if field is circular_spline_field:
        element = model.circular_spline.compliance.element
    first, last = element.mesh.face_first, element.mesh.face_last
    assert len(found.points) == element.sectors
    for values in (found.points, found.stress):
        after = np.roll(values, -1, axis=0)[:, first]
        assert np.abs(values[:, last] - after).max() < 1e-9 * np.abs(values).max()


def test_recovered_mesh_follows_skeleton_and_invariants():
    """Bore nodes lie where the solver put them; turning leaves the invariants alone."""
    model = half_turn().model
    found = flexspline_field(model, state())
    bore = found.points[: model.sectors, model.element.mesh.bore[:-1]]
    exact = model.skeleton(state())[:, model.bore_nodes]
    assert np.abs(bore - exact).max() < 1e-12
    for ours, theirs in zip(
        found.maxima, stress_maxima(flexspline_stress(model, state())), strict=True
    ):
        assert np.allclose(ours[: model.sectors], theirs, rtol=1e-9, atol=1.0)


def test_global_stress_is_that_of_the_bent_rim():
    """At the minor axis the bore is in tension along the rim, whatever its place."""
    model = half_turn().model
    found = flexspline_field(model, state())
    tooth = int(np.argmin(np.abs(tooth_angles(model, state()) - pi / 2)))
    node = model.element.mesh.bore[len(model.element.mesh.bore) // 2]
    xx, yy, xy, _ = found.stress[tooth, node]
    unit = rotate_right_angle(found.points[tooth, node])
    unit = unit / np.hypot(*unit)
    along = unit[0] ** 2 * xx + unit[1] ** 2 * yy + 2 * unit[0] * unit[1] * xy
    assert along == pytest.approx(found.maxima[0][tooth, node], rel=1e-3)
    assert along > 50e6


def test_teeth_do_not_overlap_in_the_picture():
    """No flexspline node lies in the steel of the circular spline as it is drawn."""
    model = half_turn().model
    found, ring = (
        field(model, state()) for field in (flexspline_field, circular_spline_field)
    )
    points = found.points[:, found.outline].reshape(-1, 2)
    profile = model.circular_spline.profile
    # into the frame of the nearest ring tooth as drawn, mirrored to its right flank
    pitch = 2 * pi / profile.teeth
    centre = ring.points[0].mean(axis=0)
    tooth = np.arctan2(-centre[0], centre[1])
    polar = np.arctan2(-points[:, 0], points[:, 1]) - tooth
    local = rotate(points, -(np.round(polar / pitch) * pitch + tooth))
    local[:, 0] = np.abs(local[:, 0])
    gap, _, _ = profile.signed_distance(local)
    deep = np.hypot(*points.T) > profile.addendum_radius
    assert deep.any()
    # the ring's flanks give way by a few micrometres
    assert gap[deep].min() > -5e-6


def test_tooth_forces_carry_the_load():
    """Forces times their lever arms are the moment of the teeth; half is whole."""
    run = half_turn()
    force = tooth_forces(run.model, state())
    assert force.shape == (120, 2)
    assert np.array_equal(force[:60], force[60:])
    contacts = state().contacts
    arm = np.einsum("ki,ki->k", rotate_right_angle(contacts.point), contacts.normal)
    # both flanks have their lever arm, of opposite sign
    arms = [arm[contacts.side == side].mean() for side in (0, 1)]
    moment = force[:, 0].sum() * arms[0] + force[:, 1].sum() * arms[1]
    assert moment == pytest.approx(run.steps[5].tooth_moment, rel=1e-3)
    angles = tooth_angles(run.model, state())
    loaded = force.any(axis=1)
    assert np.abs((angles[loaded] + pi / 2) % pi - pi / 2).max() < 10 * deg


def test_wave_generator_contact_carries_the_teeth():
    """Line load integrates to the forces; contact arcs hold them, lobe by lobe."""
    run = half_turn()
    found = wave_generator_contact(run.model, state(), 2)
    force = run.model.copies * state().pressure[state().touching].sum()
    assert found.force.sum() == pytest.approx(force, rel=1e-12)
    bore = np.hypot(*run.model.element.skeleton.T).min()
    whole = found.line_load.mean() * 2 * pi * bore
    assert whole == pytest.approx(force, rel=0.005)  # the bore is not quite round
    assert (np.diff(found.angle) > 0.0).all()
    assert np.allclose(found.arcs[0], found.arcs[1], atol=1e-9)
    loaded = (found.angle[found.force > 0.0] + pi / 2) % pi - pi / 2
    inside = [
        any(low - 1e-9 <= a <= high + 1e-9 for low, high in found.arcs[0])
        for a in loaded
    ]
    assert all(inside)
    # the lobe carries the wedged teeth, an arc about it is there at every position
    assert any(low < 0.0 < high for low, high in found.arcs[0])


def test_contact_of_a_bare_ellipse_is_the_whole_bore():
    """Its perimeter exceeds that of the bore: one arc from axis to axis."""
    run = half_turn()
    (arc,) = wave_generator_contact(run.model, run.setup[0].state, 2).arcs[0]
    assert arc[0] < -86 * deg and arc[1] > 86 * deg


def test_root_stress_while_a_lobe_passes():
    """Compression far from the lobe, tension near it, a dip below it, more before.

    Thesis 4.10: compression up to about -35 deg and from about 45 deg on, tension
    between, a sudden reduction at zero, the larger peak before the lobe has passed.
    """
    run = half_turn()
    found = root_stress(run.model, run.states, run.design.lobes)
    lobe, tooth = found.lobe_position[:, found.tooth] / deg, found.tooth
    assert -90 <= lobe[0] < -85 and 75 < lobe[-1] < 90
    assert (np.diff(lobe) > 0.0).all()
    tensile, compressive = found.tensile[:, tooth], found.compressive[:, tooth]
    assert (compressive > tensile)[np.abs(lobe) > 55].all()
    assert (compressive < tensile)[np.abs(lobe) < 40].all()
    # all teeth at all positions draw the curve finely
    at, values = found.lobe_position.ravel() / deg, found.tensile.ravel()
    before = values[(at > -8) & (at < -2)].max()
    after = values[(at > 2) & (at < 8)].max()
    below = values[np.abs(at) < 1].min()
    assert below < 0.8 * after < 0.8 * before
    # the whole flexspline has its largest stress at that node
    worst = max(step.stress.flexspline.von_mises for step in run.steps)
    assert found.von_mises.max() == pytest.approx(worst, rel=1e-9)


def test_json_holds_the_fields():
    """Arcs per step and lobe, forces per tooth, the root over the turn."""
    result = half_turn().to_json()
    arcs = result["per_step"]["contact_arc_deg"]
    assert len(arcs) == 24 and all(len(lobes) == 2 for lobes in arcs)
    assert all(low <= high for lobe in arcs[3] for low, high in lobe)
    forces = result["contact_forces_N"]
    assert len(forces["right"]) == len(forces["left"]) == 120
    assert len(result["root_stress"]["tensile_MPa"]) == 24

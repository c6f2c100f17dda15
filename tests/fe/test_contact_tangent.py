"""Second derivatives of tooth gaps in the tangent of the 2D model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.linearise import linearise
from swgjoint.gear.design.design import Design

CASES = {
    "bearing": ("size-25-100", 173.0),
    "four rollers": ("reference-2d-four-roller", 17.0),
    "fixed flexspline": ("reference-2d-flexspline-fixed", 17.0),
    "conforming flanks": ("dca-80-to-1", 113.0),
}


@pytest.fixture(scope="module", params=CASES)
def loaded(request):
    """Solver of a coarse drive, and an equilibrium under a high torque."""
    name, torque = CASES[request.param]
    change = {"mesh.refinement": 0.5}
    if request.param == "bearing":
        change["wave_generator.bearing"] = dict(
            balls=22, ball_diameter_mm=5.0, race_thickness_mm=1.5
        )
    design = Design.load(name).with_changes(change)
    model = sector_model(design, half=True)
    follow = Continuation(model=model, ratio=design.ratio, layout=design.drive.layout)
    state = follow.to_torque(follow.engage(follow.deflect()), torque)
    assert state.outcome.ok
    return follow, state


@pytest.mark.fe
def test_compliance_is_the_derivative_of_the_output_angle(loaded):
    """Forces that turn with their sectors instead change it by up to 2 %."""
    follow, state = loaded
    torque, angle = state.torque, follow.input_angle(state)
    up, down = (follow.load(state, f * torque, angle) for f in (1.001, 0.999))
    turned = follow.output_angle(down) - follow.output_angle(up)
    # neighbouring points of conforming flanks replace each other within the difference
    assert state.compliance == pytest.approx(turned / (2e-3 * torque), rel=6e-4)


@pytest.mark.fe
@pytest.mark.parametrize("loaded", ["bearing"], indirect=True)
def test_tangent_of_tooth_forces_is_the_derivative_of_their_loads(loaded):
    """Contact points slide and normals turn as nodes of the rim move smoothly.

    The few teeth that touch where arcs of the profile meet have no derivative there.
    """
    follow, state = loaded
    model, contacts, force = follow.model, state.contacts, state.tooth_force
    here = linearise(model, state, state.torque)
    free = replace(state, flank_force=0.0 * state.flank_force, tooth_force=0.0 * force)
    bending = here.hessian - linearise(model, free, state.torque).hessian
    size, inside = model.element.face_size, model.element.bore_size
    nodes, h = model.skeleton(state), 1e-8
    place = np.arctan2(nodes[..., 1], nodes[..., 0])

    def loads(way, shift):
        """Loads of the teeth on the nodes, at the contact points that are found."""
        moved = replace(
            state,
            faces=state.faces + way * shift[:, :size],
            bores=state.bores + way * shift[:, size : size + inside],
        )
        ring = linearise(model, moved, state.torque)
        found = ring.search.search(ring.flank, 2e-6, None)
        points = found.chosen(contacts.nearest_in(found))
        rows = force[:, None] * ring.gap_gradient(points)
        result = np.zeros_like(ring.gradient)
        np.add.at(result, points.sector, -rows)
        return result

    for waves in (2, 6, 10):
        radial = np.cos(waves * place) / np.hypot(nodes[..., 0], nodes[..., 1])
        shift = radial[..., None] * nodes
        increment = np.zeros(here.gradient.shape)
        increment[:, model.dofs] = shift.reshape(len(shift), -1)
        turn = (loads(h, shift) - loads(-h, shift)) / (2.0 * h)
        ours = np.einsum("si,sij,sj->s", increment, bending, increment)
        wanted = np.sum(turn * increment, axis=1)
        teeth = np.flatnonzero(wanted)
        wrong = np.abs(ours[teeth] / wanted[teeth] - 1.0)
        assert np.median(wrong) < 0.01, waves

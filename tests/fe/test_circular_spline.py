"""The elastic circular spline: reciprocity, symmetry, feet on deformed flanks."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from swgjoint.fe.common.block_circulant import SharedShapes, respond
from swgjoint.fe.plane.circular_spline import FlankSplines
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.elasticity import plane_basis, stiffness_matrix
from swgjoint.gear.design.design import Design


@cache
def ring():
    return sector_model(Design.load("reference-2d")).circular_spline


def test_compliance_is_reciprocal():
    """A force here moves a tooth there as much as the other way round."""
    compliance = ring().compliance
    blocks = dict(zip(compliance.offsets.tolist(), compliance.flank, strict=True))
    for offset, block in blocks.items():
        assert np.abs(block - blocks[-offset].T).max() < 1e-12 * np.abs(block).max()
    force = np.random.default_rng(1).normal(size=(122, ring().flank_dofs))
    assert np.sum(force * compliance.displacement(force)) > 0.0


def test_unloaded_flanks_share_the_shapes_of_two_faces(monkeypatch):
    """Displacements in shared shapes against the sum over all blocks.

    The outer node of a face is fixed.
    """
    compliance = ring().compliance
    size = compliance.element.face_size
    shared = SharedShapes.from_blocks(compliance.offsets, compliance.flank)
    assert shared.shapes.shape[1] == 2 * 2 * (size - 1)
    rng = np.random.default_rng(3)
    force = rng.normal(size=(122, ring().flank_dofs))
    force[20:100] = 0.0
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    theirs = respond(compliance.offsets, compliance.flank, force)
    ours = shared.respond(force)
    assert np.abs(ours - theirs).max() < 1e-14 * np.abs(theirs).max()


def test_a_tooth_that_moves_no_other_shares_no_shape():
    """With a rim so stiff that only the loaded tooth moves, its own block is left."""
    own = np.random.default_rng(5).normal(size=(1, 4, 4))
    shared = SharedShapes.from_blocks(np.zeros(1, dtype=np.int64), own)
    force = np.arange(12.0).reshape(3, 4)
    assert np.array_equal(shared.respond(force), force @ own[0].T)


def test_compliance_between_points_is_that_of_the_fields():
    """Pair compliances against the displacement field of one force at a time."""
    compliance = ring().compliance
    rng = np.random.default_rng(2)
    tooth = np.array([3, 3, 4, 120])
    weight = rng.normal(size=(4, ring().flank_dofs))
    found = compliance.contact_compliance(tooth, weight, 122)
    for k in range(4):
        force = np.zeros((122, ring().flank_dofs))
        force[tooth[k]] = weight[k]
        field = compliance.displacement(force)
        assert found[:, k] == pytest.approx(
            np.einsum("nb,nb->n", weight, field[tooth]), rel=1e-12, abs=1e-18
        )


def test_lone_tooth_meets_an_uncondensed_sector():
    """With the neighbours held too, a tooth bends as the full sector mesh says."""
    element = ring().compliance.element
    mesh = element.mesh
    basis = plane_basis(mesh.mesh)
    design = Design.load("reference-2d")
    material = design.material_of("circular_spline")
    matrix = stiffness_matrix(
        basis, material.youngs_modulus, material.poisson_ratio, 0.01
    )
    skeleton = np.concatenate([mesh.face_first, mesh.bore[1:-1], mesh.face_last])
    free = np.setdiff1d(np.arange(basis.N), basis.nodal_dofs[:, skeleton].ravel())
    load = np.zeros(basis.N)
    load[basis.nodal_dofs[0, mesh.flank_right[5]]] = 1.0
    u = np.zeros(basis.N)
    u[free] = spsolve(matrix[free][:, free].tocsc(), load[free])
    force = np.zeros(4 * element.flank_size)
    force[2 * 5] = 1.0
    flank = np.concatenate([mesh.flank_right[:-1], mesh.flank_left[:-1]])
    assert element.flank_compliance @ force == pytest.approx(
        u[basis.nodal_dofs[:, flank].T.ravel()], rel=1e-8, abs=1e-18
    )


def test_feet_on_a_deformed_flank():
    """Distance to the displaced curve against the nearest of many of its points."""
    surface = ring()
    stations = surface.compliance.element.mesh.flank_stations[:-1]
    wave = 2e-5 * np.stack([np.sin(3e3 * stations), np.cos(2e3 * stations)], axis=-1)
    flanks = FlankSplines.fit(surface.spline, wave[None])
    s = np.linspace(*surface.compliance.element.flank_range, 40)[2:-2]
    base, normal, _ = surface.profile.evaluate(s)
    points = base + 3e-5 * normal
    index = np.zeros(len(s), dtype=int)
    feet = surface.feet(points, flanks, index)
    dense = np.linspace(stations[0], stations[-1], 200_001)
    curve = surface.profile.evaluate(dense)[0]
    curve = curve + flanks.evaluate_at(np.zeros(dense.size, dtype=int), dense)[0]
    nearest = np.array([np.hypot(*(curve - p).T).min() for p in points])
    assert np.abs(feet.gap) == pytest.approx(nearest, abs=1e-9)
    spline = surface.spline(feet.station) @ wave
    moved, slope = flanks.evaluate_at(index, feet.station)
    assert np.allclose(moved, spline, atol=1e-15)
    h = 1e-8
    steps = [flanks.evaluate_at(index, feet.station + k * h)[0] for k in (-1, 1)]
    assert slope == pytest.approx((steps[1] - steps[0]) / (2 * h), abs=1e-6)


def free_rim(rim_mm):
    return Design.preset("reference-2d").with_changes(
        {"circular_spline.outer_rim": "free", "circular_spline.rim_mm": rim_mm}
    )


def test_free_rim_becomes_oval_like_a_thin_ring():
    """Two opposite radial forces against the closed form; teeth make it stiffer."""
    spline = sector_model(free_rim(5.0)).circular_spline
    compliance, teeth = spline.compliance, spline.profile.teeth
    force = np.zeros((teeth, spline.flank_dofs))
    nodes = spline.flank_dofs // 4
    # the radial components at both corners of the tips, along +y of their teeth
    for tooth in (0, teeth // 2 + teeth % 2):
        force[tooth, [1, 2 * nodes + 1]] = 0.5
    outer = compliance.element.face_size - 1
    moved = compliance.skeleton_displacement(force)[:, 2 * outer + 1]
    radius = np.hypot(*compliance.element.skeleton.T).max() - 2.5e-3
    second_moment = 10e-3 * (5e-3) ** 3 / 12.0
    # Timoshenko, Strength of Materials II, thin ring under two forces P: the radius
    # grows by 0.0744 P R^3/(E I) at the forces and shrinks by 0.0683 across
    scale = radius**3 / (210e9 * second_moment)
    assert 0.6 < moved[0] / (0.0744 * scale) < 1.0
    assert moved[30] / moved[0] == pytest.approx(-0.0683 / 0.0744, rel=0.03)
    # the ring is held in the mean
    assert abs(moved.mean()) < 0.05 * moved[0]


def test_free_rim_answers_reciprocally():
    """G of tooth k by tooth j is the transpose of G of tooth j by tooth k."""
    compliance = sector_model(free_rim(5.0)).circular_spline.compliance
    at = {int(offset): k for k, offset in enumerate(compliance.offsets)}
    largest = np.abs(compliance.flank).max()
    for offset in (0, 1, 17, 60):
        there, back = compliance.flank[at[offset]], compliance.flank[at[-offset]]
        assert np.abs(there - back.T).max() < 1e-9 * largest


def test_free_rim_keeps_the_energy_balance():
    """T_wg is the derivative of U + T psi also where the whole ring deforms."""
    design = free_rim(10.0)
    follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    potential, step = [], 1e-4
    for angle in (0.01 - step, 0.01, 0.01 + step):
        state = follow.to_angle(state, angle)
        assert state.outcome.ok
        potential.append(state.energy + 20.0 * state.rotation)
        if angle == 0.01:
            torque = state.wave_generator_torque
    slope = (potential[2] - potential[0]) / (2.0 * step)
    assert torque == pytest.approx(slope, rel=1e-6)


def test_a_free_rim_that_is_too_soft_is_an_outcome():
    """A 2 mm ring under 20 N·m leaves the range of its linear model."""
    design = free_rim(2.0)
    follow = Continuation(model=sector_model(design, half=True), ratio=design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    assert not state.outcome.ok

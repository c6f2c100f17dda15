"""Condensed segments turning in space: rigid motion, derivatives, direct solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from swgjoint.fe.solid.corotation import (
    dead_load_tangent,
    energies,
    matrices_in_global,
    project_to_frames,
    rotate_to_global,
    segment_frames,
    tangent,
)
from swgjoint.fe.solid.strip.elasticity import solid

PLACE = Rotation.from_rotvec([[0, 0, 0.0], [0, 0, 0.4], [0, 0, 2.0]]).as_matrix()


@pytest.fixture(scope="module", params=[0, 1, 4])
def segment(request, small_ring):
    """Teeth, cylinder and fillet."""
    return small_ring.strip.segments[request.param]


def deformed(segment, scale, seed=3):
    """Three sectors with random displacements."""
    rng = np.random.default_rng(seed)
    x = np.einsum("sij,aj->sai", PLACE, segment.position)
    return x + scale * rng.normal(size=x.shape)


def energy(segment, x):
    return energies(segment, segment_frames(segment, x, PLACE))


def gradient(segment, x):
    frames = segment_frames(segment, x, PLACE)
    return rotate_to_global(
        frames, project_to_frames(frames, frames.deformation @ segment.stiffness)
    )


def test_infinitesimal_rigid_motion_needs_no_force(segment):
    """Translations exactly; rotations as far as polynomials follow the shape."""
    size = np.linalg.norm(segment.stiffness, 2)
    for axis in np.eye(3):
        moved = np.tile(axis, len(segment.position))
        assert np.abs(segment.stiffness @ moved).max() < 1e-12 * size
        turned = np.cross(axis, segment.position - segment.position.mean(axis=0))
        forces = segment.stiffness @ turned.ravel()
        # the arc of the fillet is a cubic to 3e-3 of its radius
        assert np.linalg.norm(forces) < 2e-3 * size * np.linalg.norm(turned)


def test_every_node_travels_with_its_masters(segment):
    """A translation of the masters is that of all nodes to the last digit."""
    moved = np.tile([1.0, -2.0, 0.5], len(segment.position))
    nodes = segment.displacement(moved[None])[0]
    assert np.abs(nodes - [1.0, -2.0, 0.5]).max() < 1e-12


def test_large_rotation_leaves_the_energy(segment):
    """A turn by 1.2 rad about a skew axis and a shift: the same energy and forces."""
    turn = Rotation.from_rotvec([0.5, -0.4, 1.0]).as_matrix()
    x = deformed(segment, 1e-6)
    moved = x @ turn.T + [1e-3, -2e-3, 3e-3]
    assert energy(segment, moved) == pytest.approx(energy(segment, x), rel=1e-9)
    before = gradient(segment, x).reshape(x.shape) @ turn.T
    after = gradient(segment, moved).reshape(x.shape)
    assert np.abs(after - before).max() < 1e-9 * np.abs(before).max()


def test_gradient_is_the_derivative_of_the_energy(segment):
    """Forces against extrapolated differences, far from the undeformed shape."""
    x = deformed(segment, 1e-4)
    way = np.random.default_rng(5).normal(size=x.shape)

    def slope(h):
        change = energy(segment, x + h * way) - energy(segment, x - h * way)
        return change / (2 * h)

    ours = np.einsum("sn,sn->s", gradient(segment, x), way.reshape(3, -1))
    assert (4 * slope(1e-6) - slope(2e-6)) / 3 == pytest.approx(ours, rel=1e-7)


def tangent_at(segment, x):
    """In the global frame."""
    frames = segment_frames(segment, x, PLACE)
    force = project_to_frames(frames, frames.deformation @ segment.stiffness)
    return matrices_in_global(frames, tangent(segment, frames, force))


def test_tangent_is_the_derivative_of_the_gradient(segment):
    """Far from the undeformed shape, too."""
    way = np.random.default_rng(6).normal(size=(3, *segment.position.shape))
    for scale, h in ((1e-4, 1e-7), (1e-6, 1e-8)):
        x = deformed(segment, scale)
        matrix = tangent_at(segment, x)
        largest = np.abs(matrix).max()
        assert np.abs(matrix - matrix.transpose(0, 2, 1)).max() < 1e-12 * largest
        ours = np.einsum("sij,sj->si", matrix, way.reshape(3, -1))
        by = gradient(segment, x + h * way) - gradient(segment, x - h * way)
        assert np.abs(by / (2 * h) - ours).max() < 1e-5 * np.abs(ours).max()


def test_forces_turn_with_a_stressed_segment(segment):
    """Along an infinitesimal rotation the forces change by their own rotation."""
    x = deformed(segment, 1e-5)
    matrix = tangent_at(segment, x)
    acting = gradient(segment, x).reshape(x.shape)
    for axis in np.eye(3):
        turned = np.cross(axis, x).reshape(3, -1)
        change = np.einsum("sij,sj->si", matrix, turned).reshape(x.shape)
        wanted = np.cross(axis, acting)
        assert np.linalg.norm(change - wanted) < 1e-8 * np.linalg.norm(wanted)


def test_dead_loads_keep_their_direction(segment):
    """Their potential is that of constant forces, wherever the frame turns."""
    x = deformed(segment, 1e-5)
    rng = np.random.default_rng(8)
    # points that follow a translation of the masters
    m = len(segment.position)
    carry = rng.normal(size=(6, m, 3))
    carry += (np.tile(np.eye(3), (2, 1)) - carry.sum(axis=1))[:, None] / m
    carry, point = carry.reshape(6, 3 * m), 1e-3 * rng.normal(size=(2, 3))
    force, way = rng.normal(size=(3, 2, 3)), rng.normal(size=x.shape)

    def potential(x):
        frames = segment_frames(segment, x, PLACE)
        moved = (frames.displacement @ carry.T).reshape(3, 2, 3) + point
        return -np.einsum("sij,spj,spi->s", frames.turn, moved, force)

    frames = segment_frames(segment, x, PLACE)
    local = force @ frames.turn
    moved = (frames.displacement @ carry.T).reshape(3, 2, 3) + point
    arm = moved - frames.centre[:, None] - segment.position.mean(axis=0)
    by_turn, matrix = dead_load_tangent(frames, carry, arm, local)
    push = -local.reshape(3, -1) @ carry
    slope = project_to_frames(frames, push) + by_turn
    # what the tangent of the segment contains without the segment's own stiffness
    soft = replace(segment, stiffness=np.zeros_like(segment.stiffness))
    matrix = matrices_in_global(frames, matrix + tangent(soft, frames, slope))
    slope = rotate_to_global(frames, slope)
    h, d = 1e-6, way.reshape(3, -1)
    ahead, here, back = potential(x + h * way), potential(x), potential(x - h * way)
    first = np.einsum("si,si->s", slope, d)
    second = np.einsum("si,sij,sj->s", d, matrix, d)
    assert (ahead - back) / (2 * h) == pytest.approx(first, rel=1e-5)
    assert (ahead - 2 * here + back) / h**2 == pytest.approx(second, rel=1e-3)


def test_condensed_segment_is_the_direct_solution(small_ring, small_design):
    """Boundary moved by its masters and a force in the bore: every node, and energy."""
    strip = small_ring.strip
    segment, follow = strip.teeth, strip.masters.segments[0]
    steel = small_design.material_of("flexspline")
    body = solid(segment.mesh.mesh, steel.youngs_modulus, steel.poisson_ratio)
    rng = np.random.default_rng(4)
    d = 1e-6 * rng.normal(size=3 * len(segment.position))
    load = np.zeros(segment.loaded.size)
    load[-3 * 40 :: 7] = 2.0
    n = body.stiffness.shape[0]
    fixed = (3 * follow.boundary[:, None] + np.arange(3)).ravel()
    free = np.setdiff1d(np.arange(n), fixed)
    u, force = np.zeros(n), np.zeros(n)
    u[fixed] = (follow.weight @ d.reshape(-1, 3)).ravel()
    force[segment.loaded] = segment.nodal_force(load[None])[0]
    right = force[free] - body.stiffness[free][:, fixed] @ u[fixed]
    u[free] = spsolve(body.stiffness[free][:, free].tocsc(), right)
    found = segment.displacement(d[None], load[None])[0].ravel()
    assert np.abs(found - u).max() < 1e-8 * np.abs(u).max()
    stored = 0.5 * d @ segment.stiffness @ d + 0.5 * load @ segment.compliance @ load
    assert stored == pytest.approx(0.5 * u @ body.stiffness @ u, rel=1e-8)
    # what the masters must be pushed with
    on_boundary = (body.stiffness @ u - force)[fixed].reshape(-1, 3)
    pushed = segment.stiffness @ d - load @ segment.loaded_from_masters
    by_hand = (follow.weight.T @ on_boundary).ravel()
    assert np.abs(pushed - by_hand).max() < 1e-8 * np.abs(by_hand).max()

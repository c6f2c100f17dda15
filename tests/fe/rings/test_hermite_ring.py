"""The Hermite ring against differences, ring theory and plane finite elements."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from swgjoint.fe.rings.facing import FacingSurface, distances_to_ring
from swgjoint.fe.rings.free_ring import FreeRing, pull_ring
from swgjoint.fe.rings.hermite_ring import HermiteRing
from swgjoint.gear.shell_theory import ring_stiffness

RING = HermiteRing(radius=30e-3, elements=24, stretching=2e6, bending=0.1)


def disturbed(ring, size=3e-4, seed=0):
    """Coordinates of a smoothly deformed and turned ring."""
    rng = np.random.default_rng(seed)
    x = ring.reference.copy()
    phi = 2 * np.pi / ring.elements * np.arange(ring.elements)
    for k in (2, 3):
        a, b = rng.normal(size=2) * size
        wave = (a * np.cos(k * phi) + b * np.sin(k * phi))[:, None, None]
        x = x * (1 + wave / ring.radius)
    return x.ravel() + 1e-2 * size * rng.normal(size=ring.size)


def hessian(ring, q):
    """Assembled Hessian, dense."""
    *_, parts = ring.forces(q)
    rows = np.repeat(ring.dofs, 8, axis=1).ravel()
    columns = np.tile(ring.dofs, (1, 8)).ravel()
    return coo_matrix((parts.ravel(), (rows, columns)), 2 * (ring.size,)).tocsc()


def test_forces_are_derivatives():
    """Gradient and Hessian against central differences of the energy."""
    q = disturbed(RING)
    energy, gradient, _ = RING.forces(q)
    assert energy == RING.energy(q)
    matrix = hessian(RING, q).toarray()
    rng = np.random.default_rng(1)
    for _ in range(3):
        d = rng.normal(size=q.size) * 1e-8
        up, down = RING.energy(q + d), RING.energy(q - d)
        assert up - down == pytest.approx(2 * gradient @ d, rel=1e-5)
        change = RING.forces(q + d)[1] - RING.forces(q - d)[1]
        assert change == pytest.approx(2 * matrix @ d, rel=1e-5, abs=1e-4)


def test_rigid_motion_costs_nothing():
    """A ring turned and moved holds no energy and no force."""
    turn = np.array([[np.cos(1.1), -np.sin(1.1)], [np.sin(1.1), np.cos(1.1)]])
    x = RING.reference @ turn.T
    x[:, 0] += [2e-3, -1e-3]
    assert RING.energy(x) < 1e-22
    assert np.abs(RING.forces(x)[1]).max() < 1e-6


def squeezed(ring, travel):
    """Force of two opposite points at the ends of the y axis, pulled apart."""
    q = ring.reference.ravel().copy()
    top, bottom = 0, ring.elements // 2
    # points on the axis stay on it with their tangents level
    held = {4 * top: 0.0, 4 * top + 3: 0.0, 4 * bottom: 0.0, 4 * bottom + 3: 0.0}
    held[4 * top + 1] = ring.radius + travel
    held[4 * bottom + 1] = -ring.radius - travel
    fixed = np.array(list(held))
    free = np.setdiff1d(np.arange(ring.size), fixed)
    for part in np.linspace(0.25, 1.0, 4):
        start = ring.reference.ravel()[fixed]
        q[fixed] = start + part * (np.array(list(held.values())) - start)
        for _ in range(20):
            _, gradient, _ = ring.forces(q)
            step = spsolve(hessian(ring, q)[np.ix_(free, free)], -gradient[free])
            q[free] += step
            if np.abs(step).max() < 1e-13:
                break
    return q, ring.forces(q)[1][4 * top + 1]


@pytest.mark.parametrize("elements", [48, 96])
def test_opposite_forces_after_ring_theory(elements):
    """A small pull needs the force of inextensional ring theory."""
    E, wall, radius, width = 2.1e11, 0.4e-3, 30e-3, 10e-3
    ring = HermiteRing(
        radius=radius,
        elements=elements,
        stretching=E * wall * width,
        bending=E * width * wall**3 / 12,
    )
    _, force = squeezed(ring, 1e-7)
    expected = width * ring_stiffness(E, wall, radius) * 1e-7
    # the ring also stretches, by (t/r)^2 = 2e-4; 48 elements lock by 3e-4, 96 by 5e-6
    assert force == pytest.approx(expected, rel=4e-4 if elements == 48 else 1e-4)


def test_large_pull_against_plane_elements():
    """Pulled beyond the lobes of a drive it agrees with nonlinear plane elements."""
    plain = FreeRing(
        outer_radius=30.2e-3,
        thickness=0.4e-3,
        width=10e-3,
        youngs_modulus=2.1e11,
        poisson_ratio=0.29,
    )
    angle = np.linspace(0.1, 0.5 * np.pi, 7)
    travel = 0.5e-3
    peer = pull_ring(plain, np.linspace(0.1, 1.0, 10) * travel, angle)
    ring = HermiteRing(
        radius=plain.mean_radius,
        elements=64,
        stretching=plain.youngs_modulus * plain.width * plain.thickness,
        bending=plain.bending_stiffness,
    )
    q, force = squeezed(ring, travel)
    # a line knows no pinch under the rollers
    assert force == pytest.approx(peer.force[-1], rel=5e-3)
    outside = FacingSurface(ring=ring, place=np.linspace(0, 64, 400), offset=0.2e-3)
    points = outside.points(q)[0]
    around = np.arctan2(np.abs(points[:, 0]), points[:, 1])
    order = np.argsort(around)
    shape = np.interp(angle, around[order], np.hypot(*points[order].T)) - 30.2e-3
    assert shape == pytest.approx(peer.deflection[-1], abs=2e-3 * travel)
    # linear theory is far off there
    linear = plain.width * ring_stiffness(2.1e11, 0.4e-3, 30e-3) * travel
    assert force / linear - 1 > 0.025


@pytest.mark.parametrize("inside", [True, False])
def test_distance_from_a_ring_and_its_derivatives(inside):
    """Rows and curvature of the distance against differences."""
    q = disturbed(RING)
    place = np.array([0.3, 5.9, 17.2])
    other = disturbed(RING, seed=3)
    beside = FacingSurface(ring=RING, place=place, offset=-2e-3 if inside else 2e-3)

    def seen(q, other):
        return distances_to_ring(RING, q, beside.points(other)[0], place, inside=inside)

    found = seen(q, other)
    dofs, rows, bend = beside.rows(other, found)
    rng = np.random.default_rng(2)
    d, e = (rng.normal(size=q.size) * 1e-6 for _ in range(2))
    up, down = seen(q + d, other + e), seen(q - d, other - e)
    own = np.einsum("nkm,nm->nk", found.by_ring, d[found.dofs])
    their = np.einsum("nkm,nm->nk", rows, e[dofs])
    move = own + their * [1.0, 1.0, 0.0]
    assert up.distance - down.distance == pytest.approx(2 * move[:, 0], rel=1e-6)
    expected = np.einsum("nkl,nk,nl->n", found.bends(), move, move)
    expected += bend * their[:, 2] ** 2
    second = up.distance + down.distance - 2 * found.distance
    # n . d2p is taken along the normals alone
    assert second == pytest.approx(expected, rel=2e-2)

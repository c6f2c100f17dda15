"""The incompatible-mode hexahedron: patch test, rank, bending, stress recovery."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import MeshHex

from swgjoint.fe.solid.strip.elasticity import solid, stress_maxima

E, NU = 210e9, 0.29
STRAIN = 1e-4 * np.array([[3.0, 1.0, -2.0], [1.0, -4.0, 0.5], [-2.0, 0.5, 2.0]])


def distorted(cells=3, size=0.25):
    """A cube whose inner nodes are moved at random: faces are not even plane."""
    line = np.linspace(0.0, 1.0, cells + 1)
    mesh = MeshHex.init_tensor(line, line, line)
    rng = np.random.default_rng(1)
    p = np.array(mesh.p)
    inside = ((p > 1e-9) & (p < 1.0 - 1e-9)).all(axis=0)
    p[:, inside] += size / cells * rng.uniform(-1, 1, (3, inside.sum()))
    return MeshHex(p, mesh.t), inside


def expected_stress():
    lame = E * NU / ((1 + NU) * (1 - 2 * NU))
    stress = E / (1 + NU) * STRAIN + lame * np.trace(STRAIN) * np.eye(3)
    return stress[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]


def test_patch_test_on_distorted_hexahedra():
    """A linear field on the surface goes on inside, with its stress at every node."""
    mesh, inside = distorted()
    body = solid(mesh, E, NU)
    exact = (STRAIN @ mesh.p).T.ravel()
    free = np.repeat(inside, 3)
    u = np.where(free, 0.0, exact)
    right = -body.stiffness[free][:, ~free] @ exact[~free]
    u[free] = spsolve(body.stiffness[free][:, free].tocsc(), right)
    assert inside.sum() == 8
    assert np.abs(u - exact).max() < 1e-12 * np.abs(exact).max()
    stress = (body.stress @ u).reshape(-1, 6)
    assert stress == pytest.approx(np.tile(expected_stress(), (len(stress), 1)))


def test_element_has_no_mode_without_force_but_the_rigid_ones():
    """Six zero eigenvalues of a distorted element, the others far above."""
    rng = np.random.default_rng(2)
    line = np.array([0.0, 1.0])
    cube = MeshHex.init_tensor(line, line, line)
    mesh = MeshHex(cube.p + 0.15 * rng.uniform(-1, 1, cube.p.shape), cube.t)
    values = np.linalg.eigvalsh(solid(mesh, 1.0, NU).stiffness.toarray())
    assert np.abs(values[:6]).max() < 1e-12
    assert values[6] > 1e-3


def test_thin_plate_bends_as_a_beam_with_one_element_through_it():
    """Cantilever with a shear force at its end, length 20 and one element high."""
    length, height = 20.0, 1.0
    mesh = MeshHex.init_tensor(
        np.linspace(0, length, 11), np.array([0, height]), np.array([0, height])
    )
    body = solid(mesh, 1.0, 0.0)
    x = np.asarray(mesh.p)
    free = np.repeat(x[0] > 1e-9, 3)
    force = np.zeros(free.size)
    end = np.flatnonzero(x[0] > length - 1e-9)
    force[3 * end + 1] = 0.25
    u = np.zeros(free.size)
    u[free] = spsolve(body.stiffness[free][:, free].tocsc(), force[free])
    # Timoshenko: F L^3/3EI + 6/5 F L/GA; the element knows no warping (5/6)
    beam = length**3 / (3 / 12) + length / 0.5
    assert u[3 * end + 1].mean() == pytest.approx(beam, rel=5e-3)


def test_principal_and_von_mises_stress():
    """Uniaxial tension, pure shear and pressure, turned into a skew direction."""
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    states = np.array(
        [np.diag([2.0, 0, 0]), [[0, 3.0, 0], [3.0, 0, 0], [0, 0, 0]], -np.eye(3)]
    )
    turned = turn @ states @ turn.T
    found = stress_maxima(turned[:, [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]])
    assert found[0] == pytest.approx([2.0, 3.0, 0.0], abs=1e-12)
    assert found[1] == pytest.approx([0.0, 3.0, 1.0], abs=1e-12)
    assert found[2] == pytest.approx([2.0, 3.0 * np.sqrt(3), 0.0], abs=1e-7)

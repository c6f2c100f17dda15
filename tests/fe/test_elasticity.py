"""Plane elements against exact solutions."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import Basis, FacetBasis, Functional, LinearForm, MeshQuad, condense
from skfem.helpers import eye, sym_grad, trace

from swgjoint.fe.plane.elasticity import (
    in_plane_constants,
    nodal_stress_operator,
    plane_basis,
    stiffness_matrix,
    stress_maxima,
)
from swgjoint.fe.plane.sector_mesh import sector_mesh
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile

E, NU, WIDTH = 210e9, 0.29, 0.01


def quarter_ring(inner, outer, radial, around):
    r, phi = np.linspace(inner, outer, radial + 1), np.linspace(0, pi / 2, around + 1)
    grid = np.stack(np.meshgrid(r, phi, indexing="ij"))
    corner = np.arange(grid[0].size).reshape(grid[0].shape)
    cells = np.stack(
        [corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]]
    ).reshape(4, -1)
    r, phi = grid.reshape(2, -1)
    return MeshQuad(np.stack([r * np.cos(phi), r * np.sin(phi)]), cells)


def symmetric_supports(basis):
    x, y = basis.mesh.p
    return np.concatenate(
        [basis.nodal_dofs[0, x < 1e-9], basis.nodal_dofs[1, y < 1e-9]]
    )


def test_patch_test_on_the_tooth_mesh():
    """A linear displacement field is in equilibrium and gives its exact stress."""
    profile = tooth_profile(Design.load("reference-2d"), "flexspline")
    mesh = sector_mesh(profile, 1e-3, 1).mesh
    basis = plane_basis(mesh)
    matrix = stiffness_matrix(basis, E, NU, WIDTH)
    u = np.zeros(basis.N)
    u[basis.nodal_dofs[0]] = 1e-3 * mesh.p[0] + 2e-3 * mesh.p[1]
    u[basis.nodal_dofs[1]] = 5e-4 * mesh.p[0] - 1e-3 * mesh.p[1]
    boundary = np.zeros(basis.N, dtype=bool)
    boundary[basis.nodal_dofs[:, mesh.boundary_nodes()]] = True
    force = matrix @ u
    assert np.abs(force[~boundary]).max() < 1e-11 * np.abs(force).max()
    stress = (nodal_stress_operator(basis, E, NU) @ u).reshape(-1, 3)
    factor = E / (1 - NU**2)
    exact = factor * np.array(
        [1e-3 - NU * 1e-3, NU * 1e-3 - 1e-3, (1 - NU) / 2 * 2.5e-3]
    )
    assert np.allclose(stress, exact, rtol=1e-9)


def michell_ring(inner, outer, pressure):
    """Coefficients of the Airy function (A r^2 + B r^4 + C/r^2 + D) cos 2 phi."""

    def rows(r):
        return [
            [-2, 0, -6 / r**4, -4 / r**2],
            [2, 6 * r**2, -6 / r**4, -2 / r**2],
        ]

    return np.linalg.solve([*rows(inner), *rows(outer)], [0, 0, pressure, 0])


def exact_displacement(p, coefficients):
    a, b, c, d = coefficients
    r, phi = np.hypot(*p), np.arctan2(p[1], p[0])
    radial = -2 * (1 + NU) * a * r - 4 * NU * b * r**3 + 2 * (1 + NU) * c / r**3
    radial = (radial + 4 * d / r) * np.cos(2 * phi) / E
    along = 2 * (1 + NU) * a * r + (6 + 2 * NU) * b * r**3 + 2 * (1 + NU) * c / r**3
    along = (along - 2 * (1 - NU) * d / r) * np.sin(2 * phi) / E
    return np.stack(
        [
            radial * np.cos(phi) - along * np.sin(phi),
            radial * np.sin(phi) + along * np.cos(phi),
        ]
    )


def exact_stress(x, coefficients):
    """Stress xx, yy, xy of the same solution."""
    a, b, c, d = coefficients
    r, phi = np.hypot(*x), np.arctan2(x[1], x[0])
    radial = (-2 * a - 6 * c / r**4 - 4 * d / r**2) * np.cos(2 * phi)
    hoop = (2 * a + 12 * b * r**2 + 6 * c / r**4) * np.cos(2 * phi)
    shear = (2 * a + 6 * b * r**2 - 6 * c / r**4 - 2 * d / r**2) * np.sin(2 * phi)
    middle, half = 0.5 * (radial + hoop), 0.5 * (radial - hoop)
    cos, sin = np.cos(2 * phi), np.sin(2 * phi)
    turned = half * cos - shear * sin
    return np.stack([middle + turned, middle - turned, half * sin + shear * cos])


def energy_norm(basis, u, coefficients):
    """Energy norm of the error of a solution."""

    @Functional
    def squared(w):
        strain = sym_grad(w["u"])
        lame, shear = E * NU / (1 - NU**2), E / (2 * (1 + NU))
        stress = 2 * shear * strain + lame * eye(trace(strain), 2)
        found = np.stack([stress[0, 0], stress[1, 1], stress[0, 1]])
        xx, yy, xy = found - exact_stress(w.x, coefficients)
        return WIDTH * (xx**2 + yy**2 - 2 * NU * xx * yy + 2 * (1 + NU) * xy**2) / E

    return np.sqrt(squared.assemble(basis, u=u))


def test_thick_ring_converges_with_its_orders():
    """A thick ring under a cos 2 phi traction meets the exact solution (Michell).

    Displacement with order two, energy norm with order one (Wilson's element).
    """
    inner, outer, pressure = 0.03, 0.06, 1e6
    coefficients = michell_ring(inner, outer, pressure)

    @LinearForm
    def traction(v, w):
        phi = np.arctan2(w.x[1], w.x[0])
        normal = v[0] * np.cos(phi) + v[1] * np.sin(phi)
        return WIDTH * pressure * np.cos(2 * phi) * normal

    errors, energies = [], []
    for n in (8, 16, 32):
        mesh = quarter_ring(inner, outer, n, 3 * n)
        basis = plane_basis(mesh)
        outside = mesh.facets_satisfying(
            lambda x: np.hypot(*x) > outer * 0.995, boundaries_only=True
        )
        load = traction.assemble(FacetBasis(mesh, basis.elem, facets=outside))
        load[basis.interior_dofs] = 0.0  # incompatible modes carry no load
        matrix = stiffness_matrix(basis, E, NU, WIDTH)
        u = np.zeros(basis.N)
        matrix, rhs, u, keep = condense(matrix, load, x=u, D=symmetric_supports(basis))
        u[keep] = spsolve(matrix.tocsc(), rhs)
        exact = exact_displacement(mesh.p, coefficients)
        found = u[basis.nodal_dofs]
        errors.append(np.sqrt(np.mean((found - exact) ** 2)) / np.abs(exact).max())
        fine = Basis(mesh, basis.elem, intorder=7)
        energies.append(energy_norm(fine, u, coefficients))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (orders > 1.9).all(), (errors, orders)
    assert errors[-1] < 1e-3
    orders = np.log2(np.array(energies[:-1]) / np.array(energies[1:]))
    assert orders == pytest.approx([1.0, 1.0], abs=0.1), energies


def test_thin_ring_under_two_point_forces():
    """Deflection under and across two opposite forces as in thin-ring theory."""
    radius, thickness, force = 0.05, 0.001, 10.0
    mesh = quarter_ring(radius - thickness / 2, radius + thickness / 2, 4, 240)
    basis = plane_basis(mesh)
    matrix = stiffness_matrix(basis, E, NU, WIDTH)
    x, y = mesh.p
    loaded = np.flatnonzero((x < 1e-9) & (np.abs(y - radius) < thickness / 100))[0]
    across = np.flatnonzero((y < 1e-9) & (np.abs(x - radius) < thickness / 100))[0]
    load = np.zeros(basis.N)
    load[basis.nodal_dofs[1, loaded]] = -force / 2
    u = np.zeros(basis.N)
    matrix, rhs, u, keep = condense(matrix, load, x=u, D=symmetric_supports(basis))
    u[keep] = spsolve(matrix.tocsc(), rhs)
    unit = force * radius**3 / (E * WIDTH * thickness**3 / 12)
    # Timoshenko, Strength of Materials II: changes of the two diameters
    assert -2 * u[basis.nodal_dofs[1, loaded]] == pytest.approx(
        (pi / 4 - 2 / pi) * unit, rel=0.01
    )
    assert 2 * u[basis.nodal_dofs[0, across]] == pytest.approx(
        (2 / pi - 0.5) * unit, rel=0.01
    )


def test_stress_maxima_of_pure_shear():
    """Pure shear: principal stresses of both signs, von Mises sqrt(3) times it."""
    tensile, compressive, mises = stress_maxima(np.array([0.0, 0.0, 2.0]))
    assert (tensile, compressive) == (2.0, 2.0)
    assert mises == pytest.approx(2.0 * np.sqrt(3.0))


def test_von_mises_counts_the_axial_stress():
    """The same stress in all directions yields nothing; zero zz is plane stress."""
    equal = stress_maxima(np.array([5.0, 5.0, 0.0, 5.0]))
    assert equal[2] == pytest.approx(0.0, abs=1e-12)
    flat = np.array([3.0, -1.0, 0.5])
    assert stress_maxima(np.r_[flat, 0.0]) == stress_maxima(flat)


def test_constants_of_plane_strain():
    """E/(1 - nu^2) and nu/(1 - nu); a mixture shears as both limits do."""
    assert in_plane_constants(E, NU, 0.0) == (E, NU)
    assert in_plane_constants(E, NU, 1.0) == pytest.approx(
        (E / (1 - NU**2), NU / (1 - NU))
    )
    modulus, ratio = in_plane_constants(E, NU, 0.4)
    assert modulus / (1 + ratio) == pytest.approx(E / (1 + NU))


@pytest.mark.parametrize("confinement", [0.0, 1.0])
def test_lame_ring(confinement):
    """A thick ring under inner pressure, free ends or held between plates (Lame).

    Timoshenko and Goodier, Theory of Elasticity, section 28: hoop and radial stress are
    A (1 +- b^2/r^2) in both; the displacement and the axial stress 2 nu A are not.
    """
    inner, outer, pressure = 0.03, 0.06, 1e6
    mesh = quarter_ring(inner, outer, 24, 48)
    basis = plane_basis(mesh)

    @LinearForm
    def push(v, w):
        radius = np.hypot(*w.x)
        return WIDTH * pressure * (v[0] * w.x[0] + v[1] * w.x[1]) / radius

    bore = mesh.facets_satisfying(
        lambda x: np.hypot(*x) < inner * 1.001, boundaries_only=True
    )
    load = push.assemble(FacetBasis(mesh, basis.elem, facets=bore))
    load[basis.interior_dofs] = 0.0  # incompatible modes carry no load
    matrix = stiffness_matrix(basis, E, NU, WIDTH, confinement)
    u = np.zeros(basis.N)
    matrix, rhs, u, keep = condense(matrix, load, x=u, D=symmetric_supports(basis))
    u[keep] = spsolve(matrix.tocsc(), rhs)
    radius = np.hypot(*mesh.p)
    radial = np.einsum("in,in->n", u[basis.nodal_dofs], mesh.p) / radius
    level = pressure * inner**2 / (outer**2 - inner**2)
    if confinement:
        inside = (1 - 2 * NU) * (1 + NU)
    else:
        inside = 1 - NU
    exact = level / E * (inside * radius + (1 + NU) * outer**2 / radius)
    assert radial == pytest.approx(exact, rel=1e-3)
    stress = nodal_stress_operator(basis, E, NU, confinement) @ u
    trace_of = stress.reshape(-1, 3)[:, :2].sum(axis=1)
    inside = (radius > 1.1 * inner) & (radius < 0.95 * outer)
    # uniform, so that zz = 2 nu A; 0.5 %: extrapolation to the nodes of this mesh
    assert trace_of[inside] == pytest.approx(2.0 * level, rel=5e-3)

"""Plate theory of a rim between plane stress and plane strain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Legendre

from swgjoint.gear.wide_ring import (
    RimAcross,
    anticlastic_share,
    edge_confinement,
    rim_confinement,
)

E, NU = 210e9, 0.3
RADIUS, THICKNESS, MODULE = 0.058, 1e-3, 1e-3


def rim(across=6.0):
    """A rim whose teeth make it stiffer across than around; 1 for a smooth ring."""
    bending = E * THICKNESS**3 / 12.0
    return RimAcross(
        radius=RADIUS,
        bending=bending,
        stretching=E * THICKNESS,
        across=across * bending,
    )


def ritz_share(width, found):
    """Minimum of bending and stretching energy over polynomials across the width."""
    points, weights = np.polynomial.legendre.leggauss(60)
    half = 0.5 * width
    shapes = [Legendre.basis(k) for k in range(24)]
    values = np.array([shape(points) for shape in shapes])
    curved = np.array([shape.deriv(2)(points) for shape in shapes]) / half**2
    weights = weights * half
    stiffness = found.across * (curved * weights) @ curved.T
    stiffness += found.stretching / found.radius**2 * (values * weights) @ values.T
    # a unit of moment that wants the curvature 1/D_z everywhere
    load = curved @ weights
    amount = np.linalg.solve(stiffness, load)
    return found.across * float(load @ amount) / width


@pytest.mark.parametrize("width", [0.002, 0.01, 0.03, 0.1])
def test_anticlastic_share_minimises_the_energy(width):
    """The closed form is the minimum of bending across and stretching around."""
    assert anticlastic_share(width, rim()) == pytest.approx(
        ritz_share(width, rim()), rel=1e-6
    )


def test_smooth_narrow_ring_is_in_plane_stress():
    """Without teeth and with a face below the root of r t nothing is confined.

    However much wider than thick: here twenty times.
    """
    thin = RimAcross(radius=1.0, bending=1.0, stretching=12.0 / 1e-6, across=1.0)
    assert rim_confinement(0.02, MODULE, 1e-3, thin) == pytest.approx(0.0, abs=0.01)


def test_limits_of_the_width():
    """Plane stress for a disc, plane strain for a tube."""
    assert rim_confinement(1e-6, MODULE, THICKNESS, rim()) < 1e-5
    assert rim_confinement(10.0, MODULE, THICKNESS, rim()) == pytest.approx(
        1.0, abs=1e-3
    )
    assert edge_confinement(1e-9, MODULE, THICKNESS) >= 0.0
    # where the series takes over from the closed form
    around = [edge_confinement(1.5e-7 * by, MODULE, THICKNESS) for by in (0.99, 1.01)]
    assert around[1] / around[0] == pytest.approx((1.01 / 0.99) ** 2, rel=1e-5)


def test_confinement_grows_with_the_width_and_with_the_teeth():
    """A wider face and ribs that are stiffer across free less of the axial stress."""
    widths = np.geomspace(1e-4, 1.0, 200)
    shares = [rim_confinement(width, MODULE, THICKNESS, rim()) for width in widths]
    assert (np.diff(shares) > 0.0).all()
    assert 0.0 < shares[0] and shares[-1] < 1.0
    ribs = [
        rim_confinement(0.01, MODULE, THICKNESS, rim(across))
        for across in (1, 2, 5, 20)
    ]
    assert (np.diff(ribs) > 0.0).all()


def test_units_do_not_matter():
    """Every length a thousand times larger gives the same confinement."""
    big = replace(
        rim(),
        radius=1e3 * RADIUS,
        bending=1e9 * rim().bending,
        stretching=1e3 * rim().stretching,
        across=1e9 * rim().across,
    )
    assert rim_confinement(10.0, 1e3 * MODULE, 1e3 * THICKNESS, big) == pytest.approx(
        rim_confinement(0.01, MODULE, THICKNESS, rim()), rel=1e-12
    )

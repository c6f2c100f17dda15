"""Buckling of cylinders under torsion against Donnell's equation and its limits."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from scipy.linalg import eigvalsh
from scipy.optimize import minimize_scalar

from swgjoint.gear.design.design import Design
from swgjoint.gear.torsional_buckling import (
    torsional_buckling_stress,
    wall_for_buckling_torque,
)
from swgjoint.units import mm
from swgjoint.validation.catalogue.printed import catalogue_buckling_torque

STEEL = Design.preset("size-25-100").material_of("flexspline")
RIGIDITY = STEEL.youngs_modulus / (12.0 * (1.0 - STEEL.poisson_ratio**2))
RADIUS, WALL = 31e-3, 0.35e-3


def donnell_stress(wall, radius, length, terms=40):
    """Smallest shear stress of Donnell's equation for a cylinder with hinged ends.

    D nabla^4 w + (E t / r^2) nabla^-4 w_xxxx + 2 tau t w_xy = 0 (Batdorf's form) with
    w a sum over m of sin(m pi x / L) times sin(k y) for odd and cos(k y) for even m;
    the waves around the circumference have any length.
    """
    m = np.arange(1, terms + 1)
    i, j = np.meshgrid(m, m, indexing="ij")
    mixed = (i + j) % 2 == 1
    # mean over the length of sin(i pi x / L) times the derivative of sin(j pi x / L)
    slope = np.where(mixed, 2.0 * i * j / np.where(mixed, i**2 - j**2, 1), 0.0)
    slope *= np.where(j % 2 == 1, 1.0, -1.0) / length  # derivative of sine or cosine
    axial = (m * pi / length) ** 2

    def stress(wave):
        k = np.exp(wave) / length
        bending = RIGIDITY * wall**3 * (axial + k**2) ** 2
        stretching = STEEL.youngs_modulus * wall / radius**2
        stretching *= (axial / (axial + k**2)) ** 2
        coupling = eigvalsh(2.0 * wall * k * slope, np.diag(bending + stretching) / 2)
        return 1.0 / np.abs(coupling).max()

    waves = np.linspace(-1.0, 4.0, 60)
    best = waves[int(np.argmin([stress(wave) for wave in waves]))]
    found = minimize_scalar(stress, bounds=(best - 0.1, best + 0.1), method="bounded")
    return float(found.fun)


def length_of(Z):
    """Length of the cylinder by its curvature parameter."""
    return sqrt(Z * RADIUS * WALL / sqrt(1.0 - STEEL.poisson_ratio**2))


def coefficient(stress, length):
    """Stress divided by that of a plate strip [-]."""
    return stress / (pi**2 * RIGIDITY * (WALL / length) ** 2)


def test_the_equation_has_the_known_limits():
    """A plate in shear at no curvature, 0.85 Z^(3/4) at a large one."""
    short, long = length_of(1e-4), length_of(3000.0)
    plate = coefficient(donnell_stress(WALL, RADIUS, short), short)
    assert plate == pytest.approx(5.35, rel=0.005)
    cylinder = coefficient(donnell_stress(WALL, RADIUS, long), long)
    assert cylinder == pytest.approx(0.85 * 3000.0**0.75, rel=0.02)


@pytest.mark.parametrize("Z", [0.01, 3.0, 10.0, 30.0, 60.0, 100.0, 1000.0])
def test_closed_form_meets_the_equation(Z):
    """Within 5 % from plates to long cylinders; cups have Z from 40 to 110."""
    length = length_of(Z)
    ours = torsional_buckling_stress(
        wall=WALL, radius=RADIUS, length=length, material=STEEL
    )
    assert ours == pytest.approx(donnell_stress(WALL, RADIUS, length), rel=0.05)


def test_wall_bears_the_torque_and_no_more():
    """Stress of the torque is that at which the cylinder of this wall buckles."""
    shape = {"inner_radius": 30e-3, "length": 25e-3, "material": STEEL}
    walls = []
    for knock_down in (1.0, 0.67):
        wall = wall_for_buckling_torque(1700.0, **shape, knock_down=knock_down)
        radius = 30e-3 + 0.5 * wall
        buckling = torsional_buckling_stress(
            wall=wall, radius=radius, length=25e-3, material=STEEL
        )
        torque = 2.0 * pi * radius**2 * wall * knock_down * buckling
        assert torque == pytest.approx(1700.0, rel=1e-8)
        walls.append(wall)
    assert walls[0] < walls[1]


def test_family_bears_the_buckling_torques_of_the_catalogue():
    """One wall for all sizes, no thicker than the size that needs most."""
    reserves = []
    for size in (14, 17, 20, 25, 32):
        for ratio in (50, 80, 100):
            design = Design.preset(f"size-{size}-{ratio}")
            cup, rim = design.cup, design.flexspline.rim_mm * mm
            needed = wall_for_buckling_torque(
                catalogue_buckling_torque(size),
                inner_radius=design.flexspline_inner_radius,
                length=cup.length_mm * mm,
                material=design.material_of("flexspline"),
                knock_down=0.67,
            )
            reserves.append(cup.thickness_coefficient * rim / needed)
            assert rim / design.pitch_diameter == pytest.approx((75 + ratio / 2) * 1e-4)
    assert 1.0 <= min(reserves) < 1.02
    assert max(reserves) < 1.1

"""Closed forms of the articles at numbers recomputed by hand."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from messages import naming

from swgjoint.gear.design.design import Design
from swgjoint.gear.shell_theory import (
    PRINTED_SUM,
    SERIES_SUM,
    FatigueFactors,
    ShellDimensions,
    cup_stiffness,
    ring_stiffness,
    safety_factor,
    shell_safety_factor,
)

XB1 = {"youngs_modulus": 206e9, "wall": 0.68e-3, "radius": 40e-3}
SHELL = ShellDimensions(
    youngs_modulus=209e9,
    poisson_ratio=0.3,
    wall=1.376e-3,
    radius=31.35e-3,
    length=34e-3,
    deflection=0.372e-3,
)
LIMITS = {"bending_limit": 800e6, "torsion_limit": 320e6}


def test_series_sum():
    """(pi^2 - 8)/16 is the sum over even n; three terms exceed the printed one."""
    n = np.arange(2.0, 10000.0, 2.0)
    terms = 1.0 / (n**2 - 1.0) ** 2
    assert SERIES_SUM == pytest.approx(terms.sum(), rel=1e-10)
    assert terms[:3].sum() > PRINTED_SUM


def test_force_of_xb1():
    """1161 N/mm per metre with the printed sum, 81 N/mm on 70 mm of length."""
    per_length = ring_stiffness(**XB1, series_sum=PRINTED_SUM)
    assert per_length / 1e3 == pytest.approx(1161.0, abs=0.5)
    assert 0.07 * per_length / 1e3 == pytest.approx(81.3, abs=0.05)
    assert ring_stiffness(**XB1) / per_length == pytest.approx(PRINTED_SUM / SERIES_SUM)


def test_ring_is_castiglianos():
    """Deflection P R^3/(E I) (pi/8 - 1/pi) under each of two opposite loads."""
    inertia = XB1["wall"] ** 3 / 12.0  # per length
    by_hand = XB1["youngs_modulus"] * inertia / XB1["radius"] ** 3 / (pi / 8 - 1 / pi)
    assert ring_stiffness(**XB1) == pytest.approx(by_hand, rel=1e-12)


def test_long_cup_has_a_third_of_the_tube():
    """A cup far longer than wide stores a third of the bending of a tube, plane strain.

    Loads at its open end; the twist falls with the square of the length.
    """
    length, nu = 40.0, 0.3
    found = cup_stiffness(206e9, nu, 0.68e-3, 40e-3, length, length)
    tube = ring_stiffness(**XB1) * length / (1.0 - nu**2)
    assert found == pytest.approx(tube / 3.0, rel=1e-4)
    # the lever of the closed end: twice the place, four times the compliance
    near = cup_stiffness(206e9, nu, 0.68e-3, 40e-3, length, 0.5 * length)
    assert near == pytest.approx(4.0 * found, rel=1e-12)


def test_bending_stress_of_the_article():
    """163.3 MPa by its formula, 164.4 MPa with its C_sigma; axial 0.3 of it."""
    assert SHELL.bending_stress() / 1e6 == pytest.approx(163.3, abs=0.05)
    assert SHELL.bending_stress(1.510) / 1e6 == pytest.approx(164.4, abs=0.05)
    assert SHELL.axial_stress() == pytest.approx(0.3 * SHELL.bending_stress())
    phi = np.linspace(0.0, 2 * pi, 400001)
    w = SHELL.deflection * np.cos(2 * phi)
    bent = np.gradient(np.gradient(w, phi), phi) + w
    stress = SHELL.youngs_modulus * SHELL.wall / (2 * SHELL.radius**2) * bent
    assert np.abs(stress[2:-2]).max() == pytest.approx(SHELL.bending_stress(), rel=1e-4)


def test_shape_factor_of_four_forces():
    """Loads at 25 deg from the major axis bend a ring by about the printed C_sigma."""
    n = np.arange(2.0, 4000.0, 2.0)
    share = np.cos(n * np.deg2rad(25.0)) / (n**2 - 1.0)
    phi = np.linspace(0.0, pi / 2, 91)
    bent = np.abs(share @ np.cos(np.outer(n, phi))).max()
    factor = 0.5 * bent / np.sum(share / (n**2 - 1.0))
    assert factor == pytest.approx(FatigueFactors().bending_shape, rel=0.01)


def test_safety_factor_of_the_article():
    """S = 2.17 at 100 N·m, and it falls with the torque."""
    found = shell_safety_factor(SHELL, 100.0, **LIMITS)
    assert found.combined == pytest.approx(2.17, abs=0.005)
    assert found.normal == pytest.approx(2.028, abs=1e-3)
    assert found.shear == pytest.approx(4.826, abs=1e-3)
    # as printed, S_sigma S_tau over the root
    root = (found.normal**2 + 0.7 * found.shear**2) ** 0.5
    assert found.combined == pytest.approx(found.normal * found.shear / root)
    torques = np.arange(20.0, 141.0, 20.0)
    S = [shell_safety_factor(SHELL, T, **LIMITS).combined for T in torques]
    assert (np.diff(S) < 0.0).all()
    # backwards it is loaded as much
    back = shell_safety_factor(SHELL, -100.0, **LIMITS)
    assert back == found


def test_safety_factor_of_one_stress_alone():
    """Shear alone gives S_tau, normal stress alone S_sigma over the root of K_z."""
    alone = safety_factor(
        **LIMITS, normal_amplitude=100e6, shear_amplitude=0.0, shear_mean=0.0
    )
    assert alone.combined == pytest.approx(alone.normal / 0.7**0.5)
    plain = FatigueFactors(bending=1.0, torsion=1.0, mean_shear=0.0, biaxial=1.0)
    both = safety_factor(
        **LIMITS,
        normal_amplitude=80e6,
        shear_amplitude=32e6,
        shear_mean=500e6,
        factors=plain,
    )
    assert both.combined == pytest.approx(10.0 / 2**0.5)


def test_dimensions_of_the_design():
    """The bundled cup of that article has its numbers; a ring has none."""
    own = ShellDimensions.from_design(Design.load("stress-cup"))
    for name in SHELL.__dataclass_fields__:
        assert getattr(own, name) == pytest.approx(getattr(SHELL, name), rel=1e-6)
    with pytest.raises(ValueError, match=naming("reference-2d", "[cup]")):
        ShellDimensions.from_design(Design.load("reference-2d"))

"""Buckling of a thin circular cylinder under torsion, and the wall that prevents it."""

from __future__ import annotations

from math import hypot, pi, sqrt

from scipy.optimize import brentq

from swgjoint.gear.design.material import Material

PLATE = 5.35
"""Coefficient of a long hinged plate in shear [-]."""
CYLINDER = 0.85
"""Coefficient of :math:`Z^{3/4}` of a long hinged cylinder under torsion [-]."""


def torsional_buckling_stress(
    *, wall: float, radius: float, length: float, material: Material
) -> float:
    r"""Shear stress at which a thin cylinder with hinged ends buckles in torsion [Pa].

    .. math::
        \tau = k \frac{\pi^2 E}{12 (1-\nu^2)} \Bigl(\frac tL\Bigr)^2, \quad
        k = \sqrt{5.35^2 + (0.85\,Z^{3/4})^2}, \quad
        Z = \sqrt{1-\nu^2}\,\frac{L^2}{r t}

    The coefficient joins its limits for short cylinders, which buckle as plates in
    shear, and for long ones. It is within 5 % of the numerical solution of Donnell's
    equation. The cylinder is perfect and elastic; very long ones, which buckle with two
    waves around the circumference, are not covered.

    Args:
        wall: Wall thickness t [m].
        radius: Mean radius r [m].
        length: Length L between the supported ends [m].
        material: Elastic constants.

    Source:
        Weingarten, V. I., Seide, P. and Peterson, J. P. (1968), "Buckling of
        Thin-Walled Circular Cylinders", NASA SP-8007, section on torsion, for long
        cylinders; Timoshenko, S. and Gere, J. (1961), "Theory of Elastic Stability",
        McGraw-Hill, for plates in shear. Both coefficients are cited from memory; a
        test derives them from Donnell's equation.
    """
    plate = 1.0 - material.poisson_ratio**2
    Z = sqrt(plate) * length**2 / (radius * wall)
    k = hypot(PLATE, CYLINDER * Z**0.75)
    return k * pi**2 * material.youngs_modulus / (12.0 * plate) * (wall / length) ** 2


def wall_for_buckling_torque(
    torque: float,
    *,
    inner_radius: float,
    length: float,
    material: Material,
    knock_down: float,
) -> float:
    r"""Smallest wall of a cylinder that does not buckle under a torque [m].

    The stress of the torque is :math:`\tau = T / (2\pi r^2 t)` with the mean radius r.

    Args:
        torque: Torque T [N·m].
        inner_radius: Inner radius of the cylinder [m].
        length: Length between its hinged ends [m].
        material: Elastic constants.
        knock_down: Buckling stress of a real cylinder over that of a perfect one [-].
    """

    def reserve(wall: float) -> float:
        radius = inner_radius + 0.5 * wall
        stress = knock_down * torsional_buckling_stress(
            wall=wall, radius=radius, length=length, material=material
        )
        return 2.0 * pi * radius**2 * wall * stress / torque - 1.0

    return float(brentq(reserve, 1e-6 * inner_radius, inner_radius, xtol=1e-12))

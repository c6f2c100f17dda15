"""Closed-form torsional stiffness of the cup or hat behind the teeth."""

from __future__ import annotations

from math import pi

from swgjoint.gear.design.design import Design
from swgjoint.units import mm


def cup_torsional_stiffness(design: Design) -> float:
    r"""Torsional stiffness of the thin cylinder and the diaphragm in series [N·m/rad].

    .. math::
        \frac1K = \frac{L}{2\pi G r^3 t} + \frac{1}{4\pi G t}
            \left|\frac{1}{r_b^2} - \frac{1}{r^2}\right|

    Here t is the wall thickness of thesis eq. (3.50), which is the same in both parts,
    r the mean radius of the cylinder, and r_b the radius of the bore (cup) or of the
    clamped outer edge (hat). The formula neglects the fillet and the elliptical
    deformation.

    Args:
        design: A design with a cup.

    Returns:
        Torsional stiffness [N·m/rad].

    Raises:
        ValueError: If the design has no cup.

    Source:
        Bredt's formula for a closed thin section; pure shear of an annular plate.

    >>> from swgjoint import Design
    >>> round(cup_torsional_stiffness(Design.load("reference-3d")) / 1e3)
    314
    """
    cup = design.cup
    if cup is None:
        raise ValueError(f"{design.drive.name} has no [cup]")
    material = design.material_of("flexspline")
    shear = material.youngs_modulus / (2.0 * (1.0 + material.poisson_ratio))
    wall = cup.thickness_coefficient * design.flexspline.rim_mm * mm
    radius = design.flexspline_inner_radius + 0.5 * wall
    edge = cup.bore_radius_mm * mm
    cylinder = 2.0 * pi * shear * radius**3 * wall / (cup.length_mm * mm)
    plate = 4.0 * pi * shear * wall / abs(1.0 / edge**2 - 1.0 / radius**2)
    return 1.0 / (1.0 / cylinder + 1.0 / plate)

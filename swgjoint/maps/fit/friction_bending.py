r"""Friction due to the rim, which the turning wave generator bends cyclically.

A rim of radius r, width b and thickness t, bent to :math:`w_0 \cos n\varphi` without
stretching, has the strain energy

.. math:: U = \tfrac12 E I \oint \kappa^2\,ds
        = \frac{\pi E I w_0^2 (n^2 - 1)^2}{2 r^3}, \qquad I = b t^3/12.

Every point goes through n bending cycles per turn of the wave generator relative to the
flexspline. The peak energies of all points sum to 2 U, and each cycle dissipates
:math:`2\pi\eta` times the peak energy, with the loss factor :math:`\eta`. The resulting
torque is :math:`2 n \eta\,U` at any speed. The wall of a cup follows the rim with
deflections that fall linearly to zero at the diaphragm. If it is inextensional, it
stores

.. math:: U = \frac{\pi D w_0^2 (n^2 - 1)^2}{2 r^3}
    \Bigl(\frac L3 + \frac{2(1 - \nu) r^2}{n^2 L}\Bigr), \quad
    D = \frac{E t^3}{12 (1 - \nu^2)}.

The teeth are neglected: the finite elements of the reference drive, with teeth and an
elliptical wave generator, store 24.1 mJ, and this model stores 12.2 mJ. The shape of
the rings in equilibrium, with teeth and race and under load, is in
:mod:`swgjoint.fe.rings.bending`.

Source:
    Thesis, appendix A: efficiency losses of a constantly deflected turning body (the
    thesis measured the deflection, not the torque). Strain energy of the ring:
    Timoshenko, Young, "Vibration Problems in Engineering", inextensional flexure; of
    the cup: Timoshenko, Woinowsky-Krieger, "Theory of Plates and Shells", article 123.
"""

from __future__ import annotations

from math import pi

from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.units import mm

STEEL_LOSS_FACTOR = 1e-3
"""Order of magnitude of the loss factor eta of steel [-]. It is assumed: the value
depends on alloy, hardness and stress and must be measured for a given flexspline."""
STEEL_LOSS_FACTORS = (2e-5, 1e-2)
"""Bracket of the loss factor of steel [-]: a table of small stresses (longitudinal
waves, 0.2e-4 to 3e-4) begins with the first value; the second is ten times the value at
large stress and is assumed, so that no steel exceeds it.

Source: T. Irvine (2004), "Damping properties of materials", revision C, table 2."""


def rim_bending_energy(design: Design) -> float:
    """Strain energy U of the rim without teeth, bent by the wave generator [J]."""
    material = design.material_of("flexspline")
    n, rim = design.lobes, design.flexspline.rim_mm * mm
    radius = design.flexspline_inner_radius + 0.5 * rim
    second_moment = design.drive.face_width_mm * mm * rim**3 / 12.0
    bend = lobe_height(design) * (n**2 - 1)
    return 0.5 * pi * material.youngs_modulus * second_moment * bend**2 / radius**3


def cup_bending_energy(design: Design) -> float:
    """Strain energy of the wall of the cup, bent by the wave generator [J].

    Zero without a cup.
    """
    cup = design.cup
    if cup is None:
        return 0.0
    material = design.material_of("flexspline")
    n, wall = design.lobes, cup.thickness_coefficient * design.flexspline.rim_mm * mm
    radius, length = design.flexspline_inner_radius + 0.5 * wall, cup.length_mm * mm
    rigidity = material.youngs_modulus * wall**3 / 12.0
    rigidity /= 1.0 - material.poisson_ratio**2
    twist = 2.0 * (1.0 - material.poisson_ratio) * radius**2 / (n**2 * length)
    bend = lobe_height(design) * (n**2 - 1)
    energy = 0.5 * pi * rigidity * bend**2 / radius**3 * (length / 3.0 + twist)
    return float(energy)


def bending_torque(design: Design, loss_factor: float = STEEL_LOSS_FACTOR) -> float:
    """Input torque that cyclic bending of the rim requires [N·m].

    Args:
        design: The drive.
        loss_factor: Loss factor eta of the flexspline [-].
    """
    return 2.0 * design.lobes * loss_factor * rim_bending_energy(design)


def without_friction(design: Design) -> str:
    """Reason why a finite-element map has no losses, with the torque of rim bending."""
    return (
        "the finite elements model no friction of bearing, seals and grease, and that"
        " of the teeth only as hysteresis; a table [losses] adds all of them to a"
        " design with a wave-generator bearing; bending of the plain rim alone takes"
        f" about {1e3 * bending_torque(design):.2g} mN·m"
        f" (loss factor {STEEL_LOSS_FACTOR:g}, assumed)"
    )

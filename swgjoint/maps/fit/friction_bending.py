r"""Friction due to the rim, which the turning wave generator bends cyclically.

A rim of radius r, width b and thickness t, bent to :math:`w_0 \cos n\varphi` without
stretching, has the strain energy

.. math:: U = \tfrac12 E I \oint \kappa^2\,ds
        = \frac{\pi E I w_0^2 (n^2 - 1)^2}{2 r^3}, \qquad I = b t^3/12.

Every point goes through n bending cycles per turn of the wave generator relative to the
flexspline. The peak energies of all points sum to 2 U, and each cycle dissipates
:math:`2\pi\eta` times the peak energy, with the loss factor :math:`\eta`. The resulting
torque is :math:`2 n \eta\,U` at any speed. Teeth and cup are neglected: the finite
elements of the reference drive, with teeth and an elliptical wave generator, store
24.1 mJ, and this model stores 12.2 mJ.

Source:
    Thesis, appendix A: efficiency losses of a constantly deflected turning body (the
    thesis measured the deflection, not the torque). Strain energy of the ring:
    Timoshenko, Young, "Vibration Problems in Engineering", inextensional flexure.
"""

from __future__ import annotations

from math import pi

from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.maps.fit.friction_fit import PRESLIDING, RELAXATION
from swgjoint.maps.friction import Friction
from swgjoint.units import mm

STEEL_LOSS_FACTOR = 1e-3
"""Order of magnitude of the loss factor eta of steel [-]. Tables state 1e-4 at small
and 1e-3 at large stress. It is assumed: the value depends on alloy, hardness and stress
and must be measured for a given flexspline."""


def rim_bending_energy(design: Design) -> float:
    """Strain energy U of the rim without teeth, bent by the wave generator [J]."""
    material = design.material_of("flexspline")
    n, rim = design.lobes, design.flexspline.rim_mm * mm
    radius = design.flexspline_inner_radius + 0.5 * rim
    second_moment = design.drive.face_width_mm * mm * rim**3 / 12.0
    bend = lobe_height(design) * (n**2 - 1)
    return 0.5 * pi * material.youngs_modulus * second_moment * bend**2 / radius**3


def bending_torque(design: Design, loss_factor: float = STEEL_LOSS_FACTOR) -> float:
    """Input torque that cyclic bending of the rim requires [N·m].

    Args:
        design: The drive.
        loss_factor: Loss factor eta of the flexspline [-].
    """
    return 2.0 * design.lobes * loss_factor * rim_bending_energy(design)


def bending_friction(
    design: Design, loss_factor: float = STEEL_LOSS_FACTOR
) -> Friction:
    """Friction due to rim bending alone, without bearing, seals and grease.

    Args:
        design: The drive.
        loss_factor: Loss factor eta of the flexspline [-].
    """
    torque = bending_torque(design, loss_factor)
    return Friction(
        stiffness=torque / PRESLIDING,
        damping=RELAXATION * torque / PRESLIDING,
        bending=torque,
        source=f"bending of the plain rim, loss factor {loss_factor:g} (assumed)",
    )


def without_friction(design: Design) -> str:
    """Reason why a finite-element map has no losses, with the torque of rim bending."""
    return (
        "the finite elements model no friction of bearing, seals and grease; bending of"
        f" the plain rim alone takes about {1e3 * bending_torque(design):.2g} mN·m"
        f" (loss factor {STEEL_LOSS_FACTOR:g}, assumed)"
    )

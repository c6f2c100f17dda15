r"""Closed-form force, stress and fatigue strength of the flexspline as a thin shell.

The formulas come from two articles. This module calls them "deformation force" (on the
force that deforms the flexspline XB1-100-80) and "stress and fatigue" (on stress and
fatigue strength of the flexible gear). The articles do not number their equations, so
each equation is cited by the symbol of its result. ``models/studies/articles.toml``
contains the values that the articles print.

The wall is inextensional. Its radial deflection at the open end is
:math:`w = w_0\cos 2\varphi` on a wave generator and a Fourier series under point loads.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from swgjoint.gear.design.design import Design
from swgjoint.units import mm

SERIES_SUM = (pi**2 - 8.0) / 16.0
"""Sum of 1/(n^2 - 1)^2 over n = 2, 4, 6, ... [-]."""
PRINTED_SUM = 0.1141
"""Value of this sum as printed in the article on the deformation force [-].

The printed value is too small: the first three terms, 1/9 + 1/225 + 1/1225, already sum
to 0.1164."""


def ring_stiffness(
    youngs_modulus: float,
    wall: float,
    radius: float,
    *,
    series_sum: float = SERIES_SUM,
) -> float:
    r"""Radial stiffness per unit length of a ring or of a tube with free ends [N/m/m].

    .. math:: \frac{P}{w_0} = \frac{\pi E \delta^3}{24 R^3 S}

    The ring carries two opposite point loads. The stiffness is the force P of one of
    them, divided by the deflection under it. The dimensions of XB1-100-80 and the
    printed sum give 1161 N/mm per metre, or 81 N/mm for the length of 70 mm. The
    article prints a slope of about 1625 N/mm, which is twenty times as large.

    Args:
        youngs_modulus: Young's modulus E [Pa].
        wall: Wall thickness delta [m].
        radius: Radius R of the middle of the wall [m].
        series_sum: Sum S of the series [-]; :data:`PRINTED_SUM` reproduces the article.

    Source:
        "Deformation force", P_theory.
    """
    return pi * youngs_modulus * wall**3 / (24.0 * radius**3 * series_sum)


def cup_stiffness(
    youngs_modulus: float,
    poisson_ratio: float,
    wall: float,
    radius: float,
    length: float,
    place: float,
) -> float:
    r"""Radial stiffness of a smooth cup with a straight, inextensional wall [N/m].

    Two opposite point loads act at the distance x from the closed end, where w = 0:

    .. math:: \frac{w}{P} = \frac{x^2}{L^2}\frac{2R^3}{\pi D}\sum_{n=2,4,\dots}
        \frac{1}{(n^2-1)^2\left(\frac L3 + \frac{2(1-\nu)R^2}{n^2L}\right)},
        \quad D = \frac{E\delta^3}{12(1-\nu^2)}

    The result follows from the strain energy of :math:`w_n = b_n\frac xL\cos n\varphi`
    with the change of circumferential curvature :math:`(n^2-1)w_n/R^2` and the twist
    :math:`(n^2-1)b_n/(nRL)`. The formula neglects the bending of the diaphragm, whose
    edge moves along the axis.

    Args:
        youngs_modulus: Young's modulus E [Pa].
        poisson_ratio: Poisson's ratio nu [-].
        wall: Wall thickness delta [m].
        radius: Radius R of the middle of the wall [m].
        length: Length L from the open end to the middle of the diaphragm [m].
        place: Distance x of the loads from the closed end [m].

    Source:
        Timoshenko and Woinowsky-Krieger, "Theory of Plates and Shells", article 123,
        inextensional bending of cylindrical shells, here applied to a cup.
    """
    rigidity = youngs_modulus * wall**3 / (12.0 * (1.0 - poisson_ratio**2))
    n2 = np.arange(2.0, 2000.0, 2.0) ** 2
    twist = 2.0 * (1.0 - poisson_ratio) * radius**2 / (n2 * length)
    total = float(np.sum(1.0 / ((n2 - 1.0) ** 2 * (length / 3.0 + twist))))
    compliance = (place / length) ** 2 * 2.0 * radius**3 / (pi * rigidity) * total
    return 1.0 / compliance


@dataclass(frozen=True, kw_only=True)
class ShellDimensions:
    """Dimensions and material of the shell that determine its stresses."""

    youngs_modulus: float
    """Young's modulus E [Pa]."""
    poisson_ratio: float
    """Poisson's ratio nu [-]."""
    wall: float
    """Wall thickness s_1 of the tooth ring [m]."""
    radius: float
    """Radius r_m of the middle of that wall [m]."""
    length: float
    """Length L of the smooth cylinder [m]."""
    deflection: float
    """Radial deflection w_0 at the lobe [m]."""

    @classmethod
    def from_design(cls, design: Design) -> ShellDimensions:
        """Dimensions of the flexspline of a design.

        Raises:
            ValueError: If the design has no cup.
        """
        if design.cup is None:
            raise ValueError(f"{design.drive.name} has no [cup]")
        material, wall = design.material_of("flexspline"), design.flexspline.rim_mm * mm
        return cls(
            youngs_modulus=material.youngs_modulus,
            poisson_ratio=material.poisson_ratio,
            wall=wall,
            radius=design.flexspline_inner_radius + 0.5 * wall,
            length=design.cup.length_mm * mm,
            deflection=0.5 * design.drive.module_mm * design.tooth_difference * mm,
        )

    def bending_stress(self, factor: float = 1.5) -> float:
        r"""Largest circumferential bending stress at zero torque [Pa].

        .. math:: \sigma_\varphi = \frac{E s_1}{2r_m^2}\max|w'' + w|
            = C_\sigma\frac{w_0 E s_1}{r_m^2}, \quad C_\sigma = \tfrac32

        The dimensions of the article give 163.3 MPa, or 164.4 MPa with its
        C_sigma = 1.510 for four forces at 25 deg. The article prints 166.98 MPa.

        Args:
            factor: C_sigma [-]; the default is that of w = w_0 cos 2 phi.
        """
        return (
            factor * self.deflection * self.youngs_modulus * self.wall / self.radius**2
        )

    def axial_stress(self, factor: float = 1.5) -> float:
        """Axial bending stress nu sigma_phi at zero torque [Pa].

        Args:
            factor: C_sigma [-], as in :meth:`bending_stress`.
        """
        return self.poisson_ratio * self.bending_stress(factor)

    def deformation_shear(self, factor: float) -> float:
        r"""Shear stress due to a deflection that falls to zero over the length [Pa].

        .. math:: \tau_\varphi = C_\tau\frac{w_0 E s_1}{r_m L}

        The formula :math:`\frac{Es_1}{2r_mL}w'` of the article corresponds to
        C_tau = 1, but the fatigue assessment of the article uses 0.506. The twist of a
        straight, inextensional wall gives 3/(4 (1 + nu)), which is 0.577 for nu = 0.3.

        Args:
            factor: C_tau [-].
        """
        return (
            factor
            * self.deflection
            * self.youngs_modulus
            * self.wall
            / (self.radius * self.length)
        )

    def torque_shear(self, torque: float) -> float:
        r"""Shear stress due to a torque, uniform over the section of the wall [Pa].

        .. math:: \tau_T = \frac{T}{2\pi r_m^2 s_1}

        Args:
            torque: Torque T on the flexspline [N·m].
        """
        return torque / (2.0 * pi * self.radius**2 * self.wall)


@dataclass(frozen=True, kw_only=True)
class FatigueFactors:
    """Constants of the fatigue assessment in the article."""

    bending: float = 2.4
    """Stress concentration factor K_sigma in bending [-]."""
    torsion: float = 1.92
    """Stress concentration factor K_tau = 0.8 K_sigma in torsion [-]."""
    mean_shear: float = 0.2
    """Weight of the mean shear stress [-]."""
    biaxial: float = 0.7
    """Factor K_z of the biaxial stress state [-], for an axial stress of about 0.3
    times the circumferential stress. The von Mises criterion gives
    1 - 0.3 + 0.3^2 = 0.79."""
    bending_shape: float = 1.510
    """Coefficient C_sigma for four forces at 25 deg from the major axis [-]. The
    Fourier series gives 1.519, which occurs at the minor axis."""
    shear_shape: float = 0.506
    """Coefficient C_tau for the same four forces [-]."""


@dataclass(frozen=True, kw_only=True)
class SafetyFactor:
    """Fatigue safety factors at one point."""

    normal: float
    """S_sigma for normal stress alone [-]."""
    shear: float
    """S_tau for shear stress alone [-]."""
    combined: float
    """S for both stresses together [-]."""


def safety_factor(
    *,
    bending_limit: float,
    torsion_limit: float,
    normal_amplitude: float,
    shear_amplitude: float,
    shear_mean: float,
    factors: FatigueFactors | None = None,
) -> SafetyFactor:
    r"""Fatigue safety factors for normal stress, shear stress and both together.

    .. math:: S_\sigma = \frac{\sigma_{-1}}{K_\sigma\sigma_a}, \quad
        S_\tau = \frac{\tau_{-1}}{K_\tau\tau_a + 0.2\tau_m}, \quad
        S = \frac{S_\sigma S_\tau}{\sqrt{S_\sigma^2 + K_z S_\tau^2}}

    If K_z is less than one, S exceeds S_sigma where the shear is small, because the
    axial tension reduces the equivalent stress of the circumferential tension.

    Args:
        bending_limit: Endurance limit in reversed bending sigma_-1 [Pa].
        torsion_limit: Endurance limit in reversed torsion tau_-1 [Pa].
        normal_amplitude: Amplitude of the normal stress sigma_a [Pa].
        shear_amplitude: Amplitude of the shear stress tau_a [Pa].
        shear_mean: Mean shear stress tau_m [Pa].
        factors: Constants of the assessment; None takes those of the article.

    Source:
        "Stress and fatigue", S_sigma, S_tau, S.
    """
    k = factors or FatigueFactors()
    normal = bending_limit / (k.bending * normal_amplitude)
    weighted = k.torsion * shear_amplitude + k.mean_shear * abs(shear_mean)
    # equal to S above, but also defined if one of the stresses is zero
    one, two = 1.0 / normal, weighted / torsion_limit
    return SafetyFactor(
        normal=normal,
        shear=1.0 / two if two else float("inf"),
        combined=1.0 / sqrt(k.biaxial * one**2 + two**2),
    )


def shell_safety_factor(
    shell: ShellDimensions,
    torque: float,
    *,
    bending_limit: float,
    torsion_limit: float,
    factors: FatigueFactors | None = None,
) -> SafetyFactor:
    r"""Fatigue safety factors from the closed-form stresses alone.

    .. math:: \sigma_a = C_\sigma\frac{w_0Es_1}{r_m^2}, \quad
        \tau_a = \tau_m = \tfrac12(\tau_T + \tau_\varphi)

    The dimensions of the article give a combined factor of 2.17 at 100 N·m.

    Args:
        shell: Dimensions and material of the flexspline.
        torque: Torque on the flexspline [N·m]; its sign does not matter.
        bending_limit: Endurance limit in reversed bending [Pa].
        torsion_limit: Endurance limit in reversed torsion [Pa].
        factors: Constants of the assessment; None takes those of the article.

    Source:
        "Stress and fatigue", sigma_a, tau_a.
    """
    k = factors or FatigueFactors()
    shear = 0.5 * (
        shell.torque_shear(abs(torque)) + shell.deformation_shear(k.shear_shape)
    )
    return safety_factor(
        bending_limit=bending_limit,
        torsion_limit=torsion_limit,
        normal_amplitude=shell.bending_stress(k.bending_shape),
        shear_amplitude=shear,
        shear_mean=shear,
        factors=k,
    )

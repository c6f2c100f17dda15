r"""Closed forms of the flexspline as a thin shell: force, stress, fatigue.

From two articles, whose equations carry no numbers and are named by what they give:
"deformation force" (force that deforms the flexspline XB1-100-80) and "stress and
fatigue" (stress and fatigue strength of the flexible gear).

The wall does not stretch. Its radial deflection at the open end is
:math:`w = w_0\cos 2\varphi` on a wave generator, a Fourier series under point loads.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from swgjoint.gear.design.design import Design
from swgjoint.units import mm

SERIES_SUM = (pi**2 - 8.0) / 16.0
"""Sum of 1/(n^2 - 1)^2 over even n."""
PRINTED_SUM = 0.1141
"""What the article on the deformation force prints for it; its own first three terms,
1/9 + 1/225 + 1/1225, are already 0.1164."""


def ring_stiffness(
    youngs_modulus: float,
    wall: float,
    radius: float,
    *,
    series_sum: float = SERIES_SUM,
) -> float:
    r"""Radial stiffness of a ring or of a tube of free ends, per length [N/m/m].

    .. math:: \frac{P}{w_0} = \frac{\pi E \delta^3}{24 R^3 S}

    Force of each of two opposite point loads over the deflection under it. With XB1's
    numbers and the printed sum this is 1161 N/mm per metre, 81 N/mm on its length of
    70 mm; the article prints a slope of about 1625 N/mm, twenty times that.

    Args:
        youngs_modulus: E [Pa].
        wall: delta [m].
        radius: R of the middle of the wall [m].
        series_sum: S; :data:`PRINTED_SUM` for the article's own.

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
    r"""Radial stiffness of a smooth cup whose wall stays straight and does not stretch.

    Two opposite point loads at the distance x from the closed end, where w = 0:

    .. math:: \frac{w}{P} = \frac{x^2}{L^2}\frac{2R^3}{\pi D}\sum_{n=2,4,\dots}
        \frac{1}{(n^2-1)^2\left(\frac L3 + \frac{2(1-\nu)R^2}{n^2L}\right)},
        \quad D = \frac{E\delta^3}{12(1-\nu^2)}

    from the energy of :math:`w_n = b_n\frac xL\cos n\varphi`: bending
    :math:`(n^2-1)w/R^2` around, twist :math:`(n^2-1)b_n/(nRL)`. The bending of the
    diaphragm, whose edge moves along the axis, is left out.

    Args:
        youngs_modulus: E [Pa].
        poisson_ratio: nu [-].
        wall: delta [m].
        radius: R of the middle of the wall [m].
        length: L from the open end to the middle of the diaphragm [m].
        place: x [m].

    Source:
        Inextensional bending of cylindrical shells, Timoshenko and Woinowsky-Krieger,
        "Theory of plates and shells", article 123, here for a cup.
    """
    rigidity = youngs_modulus * wall**3 / (12.0 * (1.0 - poisson_ratio**2))
    n2 = np.arange(2.0, 2000.0, 2.0) ** 2
    twist = 2.0 * (1.0 - poisson_ratio) * radius**2 / (n2 * length)
    total = float(np.sum(1.0 / ((n2 - 1.0) ** 2 * (length / 3.0 + twist))))
    compliance = (place / length) ** 2 * 2.0 * radius**3 / (pi * rigidity) * total
    return 1.0 / compliance


@dataclass(frozen=True, kw_only=True)
class ShellDimensions:
    """What the stresses of the shell depend on."""

    youngs_modulus: float
    """E [Pa]."""
    poisson_ratio: float
    wall: float
    """s_1, of the tooth ring [m]."""
    radius: float
    """r_m, of the middle of that wall [m]."""
    length: float
    """L, of the smooth cylinder [m]."""
    deflection: float
    """w_0 [m]."""

    @classmethod
    def from_design(cls, design: Design) -> ShellDimensions:
        """Those of a design with a cup."""
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
        r"""Largest bending stress around, no load [Pa].

        .. math:: \sigma_\varphi = \frac{E s_1}{2r_m^2}(w'' + w)
            = C_\sigma\frac{w_0 E s_1}{r_m^2}, \quad C_\sigma = \tfrac32

        163.3 MPa with the article's numbers, 164.4 MPa with its C_sigma = 1.510 of four
        forces at 25 deg; the article prints 166.98 MPa.
        """
        return (
            factor * self.deflection * self.youngs_modulus * self.wall / self.radius**2
        )

    def axial_stress(self, factor: float = 1.5) -> float:
        """Bending stress along the axis, nu sigma_phi, no load [Pa]."""
        return self.poisson_ratio * self.bending_stress(factor)

    def deformation_shear(self, factor: float) -> float:
        r"""Shear stress of the deflection that falls to zero over the length [Pa].

        .. math:: \tau_\varphi = C_\tau\frac{w_0 E s_1}{r_m L}

        The article's own :math:`\frac{Es_1}{2r_mL}w'` means C_tau = 1, its fatigue part
        has 0.506; the twist of an inextensional wall that stays straight gives
        3/(4 (1 + nu)) = 0.577.
        """
        return (
            factor
            * self.deflection
            * self.youngs_modulus
            * self.wall
            / (self.radius * self.length)
        )

    def torque_shear(self, torque: float) -> float:
        r"""Shear stress of the torque spread evenly over the wall [Pa].

        .. math:: \tau_T = \frac{T}{2\pi r_m^2 s_1}
        """
        return torque / (2.0 * pi * self.radius**2 * self.wall)


@dataclass(frozen=True, kw_only=True)
class FatigueFactors:
    """Constants of the article's assessment."""

    bending: float = 2.4
    """K_sigma, stress concentration in bending."""
    torsion: float = 1.92
    """K_tau = 0.8 K_sigma."""
    mean_shear: float = 0.2
    """Weight of the mean shear stress."""
    biaxial: float = 0.7
    """K_z, for an axial stress of about 0.3 of that around; von Mises would say
    1 - 0.3 + 0.3^2 = 0.79."""
    bending_shape: float = 1.510
    """C_sigma, four forces at 25 deg from the major axis; the series gives 1.519, at
    the minor axis."""
    shear_shape: float = 0.506
    """C_tau, the same."""


@dataclass(frozen=True, kw_only=True)
class SafetyFactor:
    """Fatigue safety factors of one place."""

    normal: float
    """S_sigma, of normal stress alone."""
    shear: float
    """S_tau, of shear stress alone."""
    combined: float
    """S."""


def safety_factor(
    *,
    bending_limit: float,
    torsion_limit: float,
    normal_amplitude: float,
    shear_amplitude: float,
    shear_mean: float,
    factors: FatigueFactors | None = None,
) -> SafetyFactor:
    r"""Combined fatigue safety factor.

    .. math:: S_\sigma = \frac{\sigma_{-1}}{K_\sigma\sigma_a}, \quad
        S_\tau = \frac{\tau_{-1}}{K_\tau\tau_a + 0.2\tau_m}, \quad
        S = \frac{S_\sigma S_\tau}{\sqrt{S_\sigma^2 + K_z S_\tau^2}}

    K_z below one makes S exceed S_sigma where the shear is small: the tension along
    the axis unloads the material under that around.

    Args:
        bending_limit: sigma_-1 [Pa].
        torsion_limit: tau_-1 [Pa].
        normal_amplitude: sigma_a [Pa].
        shear_amplitude: tau_a [Pa].
        shear_mean: tau_m [Pa].
        factors: Constants; those of the article without.

    Source:
        "Stress and fatigue", S_sigma, S_tau, S.
    """
    k = factors or FatigueFactors()
    normal = bending_limit / (k.bending * normal_amplitude)
    weighted = k.torsion * shear_amplitude + k.mean_shear * abs(shear_mean)
    # the same as S above, also where one of the stresses vanishes
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
    r"""Safety factor from the closed forms alone.

    .. math:: \sigma_a = C_\sigma\frac{w_0Es_1}{r_m^2}, \quad
        \tau_a = \tau_m = \tfrac12(\tau_T + \tau_\varphi)

    2.17 at 100 N·m with the article's numbers.

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

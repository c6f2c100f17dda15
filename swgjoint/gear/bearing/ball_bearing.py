r"""The thin-race ball bearing between wave generator and flexspline.

From the bore of the rim inwards there are half the fit clearance, the outer race, half
the internal clearance, the balls, and the rigid cam that carries the inner raceway. The
outline of the wave generator describes the bore, so half of each clearance reduces the
deflection at the lobes.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

from swgjoint.gear.design.design import Design
from swgjoint.gear.design.material import Material
from swgjoint.units import GPa, mm, um

GROOVE_CONFORMITY = 0.52
"""Default groove radius over ball diameter [-]. It is about the middle of the range of
0.515 to 0.53 that is usual for deep groove ball bearings (a textbook range that was not
verified). The contact stiffness of a ball varies by about 10 % over that range."""


@dataclass(frozen=True, kw_only=True)
class BallBearing:
    """Bearing of a design in SI units, round and not deformed by the cam."""

    balls: int
    """Number of balls."""
    ball_diameter: float
    """Diameter of a ball [m]."""
    race_thickness: float
    """Radial thickness of the outer race [m]."""
    race_width: float
    """Width of the outer race along the axis [m]."""
    groove_inertia_factor: float
    """Second moment of area of the race section over that of its rectangle [-]."""
    groove_conformity: float
    """Groove radius over ball diameter in both races [-]."""
    clearance: float
    """Radial internal clearance as in catalogues, a difference of diameters [m]."""
    fit_clearance: float
    """Clearance of the outer race in the bore of the rim, a difference of diameters
    [m]."""
    bore_radius: float
    """Radius of the rim bore that contains the race [m]."""
    material: Material
    """Material of balls and races."""

    @classmethod
    def from_design(cls, design: Design) -> BallBearing:
        """Bearing of a design.

        By default, the race has a rectangular section, is as wide as the teeth and has
        no clearance in the bore, the groove conformity is :data:`GROOVE_CONFORMITY`,
        and balls and races are made of the material of the flexspline.

        Raises:
            ValueError: If the design has no bearing.
        """
        spec = design.wave_generator.bearing
        if spec is None:
            raise ValueError(f"{design.drive.name} has no [wave_generator.bearing]")
        steel = design.material_of("flexspline")
        modulus, nu = spec.youngs_modulus_GPa, spec.poisson_ratio
        width = spec.race_width_mm or design.drive.face_width_mm
        return cls(
            balls=spec.balls,
            ball_diameter=spec.ball_diameter_mm * mm,
            race_thickness=spec.race_thickness_mm * mm,
            race_width=width * mm,
            groove_inertia_factor=spec.groove_inertia_factor or 1.0,
            groove_conformity=spec.groove_conformity or GROOVE_CONFORMITY,
            clearance=spec.clearance_um * um,
            fit_clearance=(spec.fit_clearance_um or 0.0) * um,
            bore_radius=design.flexspline_inner_radius,
            material=Material(
                youngs_modulus=steel.youngs_modulus
                if modulus is None
                else modulus * GPa,
                poisson_ratio=steel.poisson_ratio if nu is None else nu,
                density=steel.density,
                fatigue_limit_bending=None,
                fatigue_limit_torsion=None,
            ),
        )

    @property
    def race_radius(self) -> float:
        """Radius of the middle of the outer race [m]."""
        return self.bore_radius - 0.5 * (self.fit_clearance + self.race_thickness)

    @property
    def raceways(self) -> tuple[float, float]:
        """Radii of the inner and the outer raceway about the axis [m]."""
        outer = self.race_radius - 0.5 * self.race_thickness
        return outer - self.ball_diameter - 0.5 * self.clearance, outer

    @property
    def cage_share(self) -> float:
        r"""Rotation of the cage divided by that of the outer race [-].

        Both rotations are relative to the cam, which carries the inner raceway:

        .. math:: \tfrac12 (1 + D/d_m)

        with the ball diameter D and the pitch diameter d_m of the bearing, for balls
        that roll without slip between round raceways.
        """
        inner, outer = self.raceways
        return 0.5 * (1.0 + self.ball_diameter / (inner + outer))

    @property
    def race_stretching(self) -> float:
        """Stretching stiffness E A of the outer race, as if it had no groove [N]."""
        section = self.race_width * self.race_thickness
        return self.material.youngs_modulus * section

    @property
    def race_bending(self) -> float:
        """Bending stiffness E I of the outer race [N·m²]."""
        plain = self.race_width * self.race_thickness**3 / 12.0
        return self.material.youngs_modulus * self.groove_inertia_factor * plain

    def hertz_constant(self) -> float:
        r"""Hertz constant K of one ball between both raceways [N/m^1.5].

        The ball force is :math:`Q = K\delta^{3/2}` with the approach of the raceways
        :math:`\delta` and

        .. math:: K = \bigl(K_i^{-2/3} + K_o^{-2/3}\bigr)^{-3/2}
        """
        ball, groove = 0.5 * self.ball_diameter, self.groove_conformity
        across = 1.0 / ball - 1.0 / (groove * self.ball_diameter)
        inner, outer = self.raceways
        both = [
            point_contact(1.0 / ball + curvature, across, effective_modulus(self))
            for curvature in (1.0 / inner, -1.0 / outer)
        ]
        return float(sum(k ** (-2.0 / 3.0) for k in both) ** -1.5)


def effective_modulus(bearing: BallBearing) -> float:
    """Effective modulus E / (2 (1 - nu^2)) of two bodies of the same material [Pa]."""
    steel = bearing.material
    return 0.5 * steel.youngs_modulus / (1.0 - steel.poisson_ratio**2)


def point_contact(curvature: float, across: float, modulus: float) -> float:
    r"""Constant K of a Hertz point contact, :math:`Q = K\delta^{3/2}` [N/m^1.5].

    With the relative curvatures :math:`2B \ge 2A` in the two principal planes,
    semi-axes :math:`a = \kappa b`, and complete elliptic integrals of the parameter
    :math:`m = 1 - 1/\kappa^2`,

    .. math:: \frac BA = \frac{\kappa^2 E(m) - K(m)}{K(m) - E(m)}, \quad
        b^3 = \frac{3 Q E(m)}{2\pi\kappa E^* (A + B)}, \quad
        \delta = \frac{3 Q K(m)}{2\pi\kappa b E^*} .

    Args:
        curvature: Sum of the curvatures of both bodies in one principal plane [1/m].
        across: Sum of the curvatures in the other principal plane [1/m].
        modulus: Effective modulus E* of both bodies [Pa].

    Raises:
        ValueError: If one of the curvatures is not positive.

    Source:
        Johnson (1985), "Contact Mechanics", section 4.2, eqs (4.26). The formulas were
        not compared with the printed text; tests check the limit of a sphere and the
        fit of Hamrock and Brewe.
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    larger, smaller = max(curvature, across), min(curvature, across)
    if smaller <= 0.0:
        raise ValueError(
            f"curvature = {smaller:g} 1/m: expected a value above 0 1/m for a point"
            " contact"
        )

    def missed(kappa: float) -> float:
        m = 1.0 - kappa**-2
        return float(
            (kappa**2 * ellipe(m) - ellipk(m)) / (ellipk(m) - ellipe(m))
            - larger / smaller
        )

    # K - E is zero at m = 0, so almost equal curvatures are treated as equal
    kappa = 1.0
    if larger / smaller > 1.0 + 1e-6:
        kappa = brentq(missed, 1.0 + 1e-7, 10.0 * larger / smaller, xtol=1e-13)
    m = 1.0 - kappa**-2
    total = 0.5 * (larger + smaller)  # A + B
    b3 = 3.0 * ellipe(m) / (2.0 * pi * kappa * modulus * total)  # per Q
    flat = 3.0 * ellipk(m) / (2.0 * pi * kappa * modulus)
    return float(sqrt(b3) / flat**1.5)

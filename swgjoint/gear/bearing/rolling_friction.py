r"""Friction of a greased ball bearing by a bearing maker's published model.

A deep groove ball bearing under the radial force F turns at n revolutions per minute
against the moment :math:`M = M_{rr} + M_{sl}` [N·mm], with d_m and F in mm and N and
the kinematic viscosity nu of the base oil in mm2/s:

.. math::
    M_{rr} = \phi_{ish}\,\phi_{rs}\,R_1\,d_m^{1.96} F^{0.54} (\nu n)^{0.6}, \qquad
    M_{sl} = S_1\,d_m^{-0.26} F^{5/3}
        \bigl(\phi_{bl}\,\mu_{bl} + (1 - \phi_{bl})\,\mu_{EHL}\bigr)

.. math::
    \phi_{ish} = \frac{1}{1 + 1.84\cdot10^{-9} (n d_m)^{1.28} \nu^{0.64}}, \quad
    \phi_{rs} = e^{-K_{rs} \nu n (d + D) \sqrt{K_Z / 2 (D - d)}}, \quad
    \phi_{bl} = e^{-2.6\cdot10^{-8} (n\nu)^{1.4} d_m}

M_rr is the rolling resistance of the oil at the inlet of the contacts, less the heating
there and the starvation between two balls; M_sl is sliding within the contacts, which
remains at rest. Neither part contains churning lubricant, seals or the cage.

If the bearing is flooded, the balls also drag through the lubricant. For a bath that
reaches up to d_m,

.. math::
    M_{drag} = 1.093\cdot10^{-7}\,n^2 d_m^3
        \left(\frac{n d_m^2 f_t}{\nu}\right)^{-1.379} R_s, \quad
    R_s = 0.36\,d_m^2 (t - \sin t)\,f_A, \quad f_A = 0.05\,K_Z \frac{D + d}{D - d},

.. math:: t = 2\arccos\frac{0.6\,d_m - H}{0.6\,d_m}, \quad H = d_m, \quad f_t = 1.

The inertial term of this moment, which the catalogue gives with a diagram of V_M, is
left out: it does not depend on the viscosity, and with V_M about 1e-3 (from memory) it
would add 0.8 to 15 mN·m at 2000 rpm for sizes 14 to 25. A grease churns until the balls
have pushed it aside. The model covers the two limits: pushed aside completely (no
drag), or not at all (drag in the base oil as if the bearing was flooded with it). The
thickener, which makes a grease stiffer than its base oil, is not modelled.

The races of a wave generator are thin, so R_1 and S_1 are those of the thinnest series
(618). They are constants of the model for round races. A wave generator is loaded at
its lobes: each of them counts as the radial load of a bearing of its own, because a
radial load, too, presses only the balls on its side.

Source:
    SKF (2013), "Rolling bearings", PUB BU/P1 10000/1 EN, chapter "Friction", pages 99
    to 110 and table 2. The drag term agrees with an independent transcription; its
    level H ends at d_m here and at 1.2 d_m there, which is 12 % more.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, exp, pi, sin, sqrt

from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.units import mm, rpm

ROLLING = 4.7e-7
"""Constant R_1 of rolling, series 618 [N·mm/(mm^1.96 N^0.54 (mm2/s·1/min)^0.6)]."""
SLIDING = 6.5e-3
"""Constant S_1 of sliding, series 618 [N·mm/(mm^-0.26 N^(5/3))]."""
STARVATION = 6e-8
"""Constant K_rs of starvation with grease [min·s/mm^3]."""
GEOMETRY = 3.1
"""Constant K_Z of deep groove ball bearings with one row [-]."""
BOUNDARY, FULL_FILM = 0.15, 0.05
"""Friction coefficients mu_bl at rest and mu_EHL under a full film, mineral oil [-]."""
BATH = 1.0
"""Level H of the lubricant in a flooded bearing, divided by d_m [-]."""
BASE_OILS = (30e-6, 300e-6)
"""Range of the kinematic viscosity of the base oil of greases at +20 °C [m2/s]. It is
assumed: base oils of the viscosity classes ISO VG 15 to 100 are in this range."""


@dataclass(frozen=True, kw_only=True)
class GreasedBearing:
    """Dimensions of a ball bearing, and the base oil of its grease."""

    pitch_diameter: float
    """Diameter d_m of the circle of ball centres [m]."""
    section: float
    """Radial height (D - d)/2 of the bearing between its bore d and outside D [m]."""
    viscosity: float
    """Kinematic viscosity nu of the base oil at the temperature in use [m2/s]."""

    @classmethod
    def from_bearing(cls, bearing: BallBearing, viscosity: float) -> GreasedBearing:
        """Bearing of a wave generator.

        Its cam carries the inner raceway. The bore is taken as far inside the circle of
        ball centres as the outside of the outer race is outside of it.

        Args:
            bearing: The bearing, round and not deformed by the cam.
            viscosity: Kinematic viscosity of the base oil [m2/s], > 0.
        """
        inner, outer = bearing.raceways
        centres = 0.5 * (inner + outer)
        return cls(
            pitch_diameter=2.0 * centres,
            section=2.0 * (outer + bearing.race_thickness - centres),
            viscosity=viscosity,
        )

    def friction_torque(self, force: float, speed: float) -> float:
        """Frictional moment M under a radial force [N·m].

        Args:
            force: Radial force F [N], not negative.
            speed: Speed between the rings, of either sign [rad/s]; at rest the moment
                is that of starting.
        """
        rolling, sliding = self.parts(force, speed)
        return rolling + sliding

    def parts(self, force: float, speed: float) -> tuple[float, float]:
        """Rolling moment M_rr and sliding moment M_sl [N·m].

        Args:
            force: Radial force F [N], not negative.
            speed: Speed between the rings, of either sign [rad/s].
        """
        n, dm = abs(speed) / rpm, self.pitch_diameter / mm
        nu, section = self.viscosity / mm**2, self.section / mm
        heating = 1.0 / (1.0 + 1.84e-9 * (n * dm) ** 1.28 * nu**0.64)
        # d + D is twice the pitch diameter
        fed = exp(-STARVATION * nu * n * 2.0 * dm * sqrt(GEOMETRY / (4.0 * section)))
        rolling = ROLLING * dm**1.96 * force**0.54 * (nu * n) ** 0.6
        boundary = exp(-2.6e-8 * (n * nu) ** 1.4 * dm)
        coefficient = boundary * BOUNDARY + (1.0 - boundary) * FULL_FILM
        sliding = SLIDING * dm**-0.26 * force ** (5.0 / 3.0) * coefficient
        return heating * fed * rolling * mm, sliding * mm

    def film_torque(self, force: float) -> float:
        """Sliding moment under a full film, at any speed [N·m].

        Args:
            force: Radial force F [N], not negative.
        """
        return self.parts(force, 0.0)[1] * FULL_FILM / BOUNDARY

    @property
    def film_speed(self) -> float:
        """Speed between the rings at which phi_bl has fallen to 1/e [rad/s]."""
        dm, nu = self.pitch_diameter / mm, self.viscosity / mm**2
        return float((2.6e-8 * dm) ** (-1.0 / 1.4) / nu * rpm)

    def drag_torque(self, speed: float) -> float:
        """Drag moment of the balls of a flooded bearing [N·m]; load has no effect.

        Args:
            speed: Speed between the rings, of either sign [rad/s].
        """
        n, dm = abs(speed) / rpm, self.pitch_diameter / mm
        nu, section = self.viscosity / mm**2, self.section / mm
        if n == 0.0:
            return 0.0
        angle = 2.0 * acos((0.6 - BATH) / 0.6)
        assert angle > pi  # f_t = 1
        reach = 0.36 * dm**2 * (angle - sin(angle)) * 0.05 * GEOMETRY * dm / section
        return float(1.093e-7 * n**2 * dm**3 * (n * dm**2 / nu) ** -1.379 * reach * mm)

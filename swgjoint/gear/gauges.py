r"""Strain gauges on the wall of a flexspline: what bridges read under torque.

The wall is a thin cylinder behind the teeth. At its outside, at the distance x from
the middle of the diaphragm, two fields add up:

- The torque T causes a uniform shear strain, that of a round tube,

  .. math:: \gamma_T = \frac{T r_o}{G J}, \quad
      J = \tfrac\pi2\left(r_o^4 - r_i^4\right)

- The wave generator deflects the plane in the middle of the face width by
  :math:`w = \sum_n w_n\cos n\vartheta`, with the angle theta from a lobe, and the
  generators of the wall remain straight. Without extension and shear of the middle
  surface the strains at the outside are those of bending and twist,

  .. math:: \varepsilon_\varphi = \frac{(n^2-1)\,t}{2r^2}\frac xL w_n\cos n\vartheta,
      \quad \varepsilon_x = 0, \quad
      \gamma_n = \frac{(n^2-1)\,t}{n r L} w_n\sin n\vartheta

A full bridge has two gauges at the angle +a and two at -a to the generator, at one
place. Per supply voltage it reads

.. math:: \frac{U}{U_0} = \frac k4\sum_i s_i\varepsilon_i
    = \frac k2\sin 2a\,\left[\gamma\cos 2\delta
    + (\varepsilon_\varphi - \varepsilon_x)\sin 2\delta\right]

where delta is the angle by which the whole rosette is turned. Without this error it
reads shear only, including the shear that turns with the wave generator. The mean of n
bridges at equal distances cancels all orders of theta that are no multiples of n.

The wall follows the outline of the wave generator here; contact with it is in
:mod:`swgjoint.fe.solid.figures.deflected_wall`. The model omits the toothed rim, the
bending of the diaphragm, gauges of finite length, and the non-uniform shear of the
tooth forces, which follows the lobes and is proportional to the torque.

Source:
    Timoshenko and Woinowsky-Krieger, "Theory of Plates and Shells", article 123,
    inextensional bending of cylindrical shells; Hashimoto, Kiyosawa and Paul (1993),
    "A Torque Sensing Technique for Robots with Harmonic Drives", for gauges on the
    flexspline; Godler, Ninomiya and Horiuchi (2001), "Ripple Compensation for Torque
    Sensors Built into Harmonic Drives", for several bridges. The last two are cited
    for the arrangement only; no value is taken from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sin

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.wave_generator import wave_generator
from swgjoint.typing import Array, Complex
from swgjoint.units import mm

HIGHEST = 12
"""Highest order of the deflection per turn around the flexspline [-]."""
SAMPLES = 4096
"""Points of the outline from which the orders of the deflection are computed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WallStrain:
    r"""Strain at the outside of the wall, in a section across the axis.

    At the angle theta from the lobe, :math:`\gamma = \gamma_T T + \mathrm{Re}\sum_n
    \gamma_n e^{i n\vartheta}`, and the other components likewise.
    """

    torsion: float
    """Shear strain per torque [1/(N·m)]."""
    orders: Array
    """Orders n around the flexspline (m,)."""
    hoop: Complex
    """Complex amplitudes of the circumferential strain (m,) [-]."""
    axial: Complex
    """Complex amplitudes of the axial strain (m,) [-]."""
    shear: Complex
    """Complex amplitudes of the shear strain (m,) [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlexsplineWall:
    """Wall behind the teeth of a flexspline, and its deflection."""

    shear_modulus: float
    """Shear modulus G [Pa]."""
    radius: float
    """Radius r of the middle of the wall [m]."""
    wall: float
    """Wall thickness t [m]."""
    length: float
    """Distance L from the middle of the diaphragm to the middle of the face width [m].
    """
    smooth: tuple[float, float]
    """Smallest and largest distance from the outside of the closed end at which the
    wall is a cylinder, between fillet and teeth [m]."""
    orders: Array
    """Orders n of the deflection around the flexspline (m,)."""
    deflection: Complex
    """Complex amplitudes w_n in the middle of the face width (m,) [m]."""

    @classmethod
    def from_design(cls, design: Design) -> FlexsplineWall:
        """Wall of a design, deflected to the outline of its wave generator.

        Raises:
            DesignError: If the design has no cup, or if its wave generator cannot be
                built.
        """
        if design.cup is None:
            raise DesignError(
                f"{design.drive.name} has no [cup], so the wall behind its teeth is not"
                " known; accepted: a design with a [cup]"
            )
        material, cup = design.material_of("flexspline"), design.cup
        wall = cup.thickness_coefficient * design.flexspline.rim_mm * mm
        face = design.drive.face_width_mm * mm
        length, fillet = cup.length_mm * mm, cup.fillet_mm * mm
        orders, deflection = deflection_orders(design)
        return cls(
            shear_modulus=0.5 * material.youngs_modulus / (1 + material.poisson_ratio),
            radius=design.flexspline_inner_radius + 0.5 * wall,
            wall=wall,
            length=length + 0.5 * (face - wall),
            smooth=(max(fillet, wall), length),
            orders=orders,
            deflection=deflection,
        )

    def torsion_strain(self) -> float:
        """Shear strain at the outside per torque, r_o/(G J) [1/(N·m)]."""
        outer, inner = self.radius + 0.5 * self.wall, self.radius - 0.5 * self.wall
        return outer / (self.shear_modulus * 0.5 * pi * (outer**4 - inner**4))

    def strain(self, place: float) -> WallStrain:
        """Strain in the section at a distance from the closed end.

        Args:
            place: Distance from the outside of the closed end [m].
        """
        n, x = self.orders, place - 0.5 * self.wall
        bent = (n**2 - 1.0) * self.wall * self.deflection
        return WallStrain(
            torsion=self.torsion_strain(),
            orders=n,
            hoop=bent * x / (2.0 * self.radius**2 * self.length),
            axial=np.zeros_like(bent),
            # sin is the real part of -i exp
            shear=-1j * bent / (n * self.radius * self.length),
        )


def deflection_orders(design: Design) -> tuple[Array, Complex]:
    """Orders and complex amplitudes of the deflection in the plane of the teeth [m].

    The middle of the rim is at the distance of half its thickness from the outline of
    the wave generator, as in :mod:`swgjoint.gear.teeth.neutral_line`.

    Args:
        design: The drive.

    Returns:
        The orders up to :data:`HIGHEST` (m,), and the amplitudes (m,) [m].

    Raises:
        DesignError: If the wave generator cannot be built.
    """
    outline = wave_generator(design)
    s = np.linspace(0.0, outline.perimeter, SAMPLES, endpoint=False)
    point, normal, _ = outline.evaluate(s)
    point = point + 0.5 * design.flexspline.rim_mm * mm * normal
    # counter-clockwise from +y; the angle grows along the convex line
    angle = np.unwrap(np.arctan2(-point[:, 0], point[:, 1]))
    even = 2.0 * pi * np.arange(SAMPLES) / SAMPLES
    radius = np.interp(even, angle, np.hypot(*point.T), period=2.0 * pi)
    amplitude = 2.0 * np.fft.rfft(radius) / SAMPLES
    orders = np.arange(outline.folds, HIGHEST + 1, outline.folds)
    orders = orders[orders > 1]
    return orders.astype(float), amplitude[orders]


@dataclass(frozen=True, kw_only=True)
class GaugeRing:
    """Full bridges around the outside of the wall, whose mean is the signal."""

    place: float
    """Distance from the outside of the closed end [m]."""
    bridges: int = 1
    """Number of bridges."""
    spacing: float | None = None
    """Angle between bridges [rad]; None distributes them around the full turn."""
    angle: float = 0.25 * pi
    """Angle a of the gauges to the generator [rad]."""
    gauge_factor: float = 2.0
    """Gauge factor k [-]."""
    shifts: tuple[float, ...] = ()
    """Errors of the bridges' angles around the flexspline [rad]; empty without."""
    turns: tuple[float, ...] = ()
    """Angles delta by which the rosettes are turned [rad]; empty without."""

    @property
    def angles(self) -> Array:
        """Angles of the bridges around the flexspline, with errors (bridges,) [rad]."""
        step = 2.0 * pi / self.bridges if self.spacing is None else self.spacing
        return step * np.arange(self.bridges) + self._each(self.shifts)

    def _each(self, errors: tuple[float, ...]) -> Array:
        """Errors of all bridges, zero if there are none (bridges,) [rad]."""
        return np.array(errors) if errors else np.zeros(self.bridges)

    def gain(self, strain: WallStrain) -> float:
        """Signal per supply voltage and torque [1/(N·m)].

        Args:
            strain: Strain in the section of the gauges.
        """
        turned = float(np.mean(np.cos(2.0 * self._each(self.turns))))
        return self.nominal_gain(strain) * turned

    def nominal_gain(self, strain: WallStrain) -> float:
        """Signal per supply voltage and torque of gauges without errors [1/(N·m)].

        Args:
            strain: Strain in the section of the gauges.
        """
        return 0.5 * self.gauge_factor * sin(2.0 * self.angle) * strain.torsion

    def ripple(self, strain: WallStrain) -> Complex:
        r"""Complex amplitudes of the signal that turns with the wave generator.

        At the angle beta of the wave generator relative to the flexspline the signal is
        :math:`\mathrm{Re}\sum_n c_n e^{-in\beta}`.

        Args:
            strain: Strain in the section of the gauges.

        Returns:
            Signal per supply voltage c_n, by order of ``strain`` (m,) [-].
        """
        turn = 2.0 * self._each(self.turns)[:, None]
        across = strain.hoop - strain.axial
        read = strain.shear * np.cos(turn) + across * np.sin(turn)
        wave = np.exp(1j * strain.orders * self.angles[:, None])
        scale = 0.5 * self.gauge_factor * sin(2.0 * self.angle)
        return np.asarray(scale * np.mean(read * wave, axis=0))

    def signal(self, strain: WallStrain, torque: ArrayLike, beta: ArrayLike) -> Array:
        """Signal per supply voltage, as recorded (n,) [-].

        Args:
            strain: Strain in the section of the gauges.
            torque: Torque from the teeth to the closed end (n,) [N·m].
            beta: Angle of the wave generator relative to the flexspline (n,) [rad].
        """
        turned = np.exp(-1j * np.multiply.outer(np.asarray(beta), strain.orders))
        ripple = (turned @ self.ripple(strain)).real
        return np.asarray(self.gain(strain) * np.asarray(torque) + ripple)


def torque_in_wall(layout: str, ratio: float) -> float:
    r"""Mean torque from the teeth to the closed end per output torque [-].

    One if the flexspline is the output. If it is fixed, it takes the reaction of the
    output and the input, :math:`-(1 - 1/i)`; if it is the input, :math:`-1/i`. Losses
    are neglected.

    Args:
        layout: Which member is fixed.
        ratio: Signed ratio i [-].

    Source:
        Balance of moments on the flexspline.
    """
    if layout == "circular_spline_fixed":
        return 1.0
    return 1.0 / ratio - 1.0 if layout == "flexspline_fixed" else -1.0 / ratio

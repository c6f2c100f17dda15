r"""Output bearing of a drive: tilt, load and life.

The bearing carries the link with all forces and the tilting moment M. Its life follows
from the mean radial force, axial force and moment, each to the power p and weighted
with the output speed:

.. math:: P = X\left(F_r + \frac{2M}{d_p}\right) + Y F_a, \quad
    L_{10} = \frac{10^6}{n_{av}} \left(\frac{C}{f_w P}\right)^p

with the mean output speed n_av in revolutions per unit time, p = 10/3 for rollers, and
X = 1, Y = 0.45 if F_a/(F_r + 2M/d_p) is at most 1.5, otherwise X = Y = 0.67.

Source:
    Harmonic Drive LLC, "FHA series", manual, chapter 2, formulas (6) and (7); the
    factors X and Y as in IKO, "Crossed Roller Bearings", formula (1) and table 5; tilt
    M/K_B as in Harmonic Drive AG (2018), "SHG Series", 1021387, equation 45.4.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, pi

from swgjoint.errors import InputError
from swgjoint.gear.catalogue import table
from swgjoint.units import arcmin, mm

EXPONENT = 10.0 / 3.0
"""Exponent p of the life of roller bearings [-]."""
LIMIT = 1.5
"""Ratio of axial to radial load at which the load factors change [-]."""


@dataclass(frozen=True, kw_only=True)
class OutputBearing:
    """A bearing between housing and output that yields to tilting moments."""

    tilt_stiffness: float
    """Tilting moment per tilt angle, equal in all directions [N·m/rad]."""
    permissible_moment: float | None = None
    """Permissible dynamic tilting moment [N·m]; None if it is not known."""
    dynamic_rating: float | None = None
    """Basic dynamic load rating C [N]; None if it is not known."""
    pitch_diameter: float | None = None
    """Pitch circle diameter of the rollers [m]; None if it is not known."""
    load_factor: float = 1.2
    """Load factor f_w, 1 to 1.2 for smooth operation [-]."""
    damping_ratio: float = 0.02
    """Damping ratio of the tilt vibration with the other joints locked [-]."""
    centre: float = 0.0
    """Centre of the bearing on the joint axis, from the origin of the joint [m]."""
    source: str = field(default="given")
    """Origin of the values."""

    def life(
        self, radial: float, axial: float, moment: float, speed: float
    ) -> float | None:
        """Life L10 that nine out of ten bearings exceed [s].

        Args:
            radial: Mean radial force [N].
            axial: Mean axial force [N].
            moment: Mean tilting moment [N·m].
            speed: Mean output speed [rad/s].

        Returns:
            The life, inf without load or speed; None if a rating is not known.
        """
        if self.dynamic_rating is None or self.pitch_diameter is None:
            return None
        across = radial + 2.0 * moment / self.pitch_diameter
        if speed == 0.0 or (across == 0.0 and axial == 0.0):
            return inf
        x, y = (0.67, 0.67) if axial > LIMIT * across else (1.0, 0.45)
        load = self.load_factor * (x * across + y * axial)
        turns = 1e6 * float((self.dynamic_rating / load) ** EXPONENT)
        return turns * 2.0 * pi / speed


def catalogue_bearing(unit: str) -> OutputBearing:
    """Output bearing of a housed unit from ``output_bearings.csv``.

    Args:
        unit: Series and size, such as ``CSG-25``.

    Raises:
        InputError: If the table has no such unit.
    """
    names = []
    for row in table("output_bearings"):
        values = {k: float(v) for k, v in row.items() if isinstance(v, float)}
        names.append(f"{row['series']}-{values['size']:g}")
        if unit == names[-1]:
            return OutputBearing(
                tilt_stiffness=values["tilt_stiffness_Nm_arcmin"] / arcmin,
                permissible_moment=values["permissible_moment_Nm"],
                dynamic_rating=values["dynamic_rating_N"],
                pitch_diameter=values["pitch_diameter_mm"] * mm,
                source=f"catalogue {unit}-2UH, second-hand",
            )
    raise InputError(f"{unit[:60]!r}; accepted: {', '.join(names)}")

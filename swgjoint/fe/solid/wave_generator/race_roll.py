r"""Roll of the wave generator's outer race about the circumferential direction.

The edge at z = b/2 moves outward by u and the other edge inward. For the roll
:math:`\vartheta = 2u/b` and the axial motion w the strain energy is that of a curved
beam (Timoshenko, Strength of Materials II, circular rings bent out of their plane; not
checked against the book):

.. math:: U = \int \tfrac12 EI_z\Bigl(\frac\vartheta r - w''\Bigr)^2
    + \tfrac12 GJ\Bigl(\vartheta' + \frac{w'}r\Bigr)^2 ds, \quad
    I_z = \tfrac1{12} t b^3, \quad J \approx \tfrac13 b t^3 (1 - 0.63\,t/b) .
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.fe.rings.hermite_ring import HermiteRing, hermite
from swgjoint.gear.bearing.ball_bearing import BallBearing
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class RaceRoll:
    """Out-of-plane stiffness of the elements of a race."""

    model: HermiteRing
    """The race in its plane, with radius r of the mean line."""
    width: float
    """Width b of the race [m]."""
    rolling: float
    """Out-of-plane bending stiffness E I_z [N·m²]."""
    twisting: float
    """Torsional stiffness G J [N·m²]."""

    @classmethod
    def from_bearing(cls, bearing: BallBearing, model: HermiteRing) -> RaceRoll:
        """Out-of-plane stiffness of the outer race of a bearing.

        The groove is assumed to reduce J but not I_z.

        Args:
            bearing: The bearing.
            model: The outer race in its plane.
        """
        t, b, steel = bearing.race_thickness, bearing.race_width, bearing.material
        torsion = bearing.groove_inertia_factor * b * t**3 / 3.0 * (1.0 - 0.63 * t / b)
        shear = 0.5 * steel.youngs_modulus / (1.0 + steel.poisson_ratio)
        return cls(
            model=model,
            width=b,
            rolling=steel.youngs_modulus * t * b**3 / 12.0,
            twisting=shear * torsion,
        )

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness of an element for u, then w, at both nodes (8, 8) [N/m].

        Each has value and derivative at the first node, then at the last node.
        """
        points, weights = np.polynomial.legendre.leggauss(4)
        value, first, second = hermite(0.5 * (points + 1.0))
        h, r, per_u = self.model.step, self.model.radius, 2.0 / self.width
        bent = np.concatenate([per_u * value / r, -second / h**2], axis=1)
        twist = np.concatenate([per_u * first / h, first / (h * r)], axis=1)
        weight = 0.5 * h * weights
        matrix = self.rolling * (bent.T * weight) @ bent
        return np.asarray(matrix + self.twisting * (twist.T * weight) @ twist)

r"""Displacement of a flank at a contact, averaged over a patch of fixed length.

The displacement under a point force on an elastic half-plane diverges with the
logarithm of the mesh size, and between coarse nodes it depends on the position within
the element. The mesh would thus cause a kinematic error of its own, a tenth of that of
the drive. A contact force is therefore spread over a patch of the flank whose length
depends on the tooth and not on the mesh, and the gap is evaluated with the displacement
averaged by the same weights:

.. math:: \bar u(s) = \int \phi\left(\frac{t}{a}\right) u(s + t)\,\frac{dt}{a}, \quad
    \phi(x) \propto (1 - x^2)^3 .

Force and displacement stay conjugate, so the energy balance holds exactly.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from scipy.interpolate import CubicSpline

from swgjoint.typing import Array

PATCH_PARTS = 14
"""Length of the flank between the lands divided by the half length of a patch [-]. With
a module of 1 mm the half length is 0.15 mm, one and a half elements of the thesis
mesh."""
FINENESS = 6
"""Number of spline knots per half length of the patch."""
QUADRATURE = 24
"""Number of Gauss points per patch."""


def half_length(stations: Array) -> float:
    """Half length a [m] of the patches on a flank, from its nodes' arc lengths [m]."""
    return float(stations[-1] - stations[0]) / PATCH_PARTS


def average_spline(stations: Array, half: float | None = None) -> CubicSpline:
    """Weights of the flank nodes in the displacement averaged around an arc length.

    Beyond the ends of the flank the displacement is continued by odd reflection, so
    that fields linear in the arc length are reproduced everywhere.

    Args:
        stations: Arc lengths of the nodes, equally spaced (n,) [m].
        half: Half length a of the patch [m]; by default that of :func:`half_length`.

    Returns:
        Cubic spline over the arc length, whose values are the n weights.
    """
    nodal = CubicSpline(stations, np.eye(stations.size))
    first, last = float(stations[0]), float(stations[-1])
    half = half_length(stations) if half is None else half
    parts = (last - first) / half
    knots = np.linspace(first, last, ceil(parts * FINENESS) + 1)
    x, weight = np.polynomial.legendre.leggauss(QUADRATURE)
    weight = weight * (1.0 - x**2) ** 3
    weight /= weight.sum()
    values = np.zeros((knots.size, stations.size))
    for offset, share in zip(half * x, weight, strict=True):
        s = knots + offset
        end = np.clip(s, first, last)
        reflected = np.where(s == end, s, 2.0 * end - s)
        # u(end + t) = 2 u(end) - u(end - t)
        sign = np.where(s == end, 1.0, -1.0)[:, None]
        values += share * (sign * nodal(reflected) + (1.0 - sign) * nodal(end))
    return CubicSpline(knots, values)

r"""Contact between the planes of the mesh, at vertices of gaps over the face width.

Crowned surfaces touch within a part of an element. Contact in the planes of the mesh
alone would close gaps that are too large by up to :math:`g'' h^2/8`, which is 2 µm at a
crowned wave generator and depends on the mesh. Contact therefore also acts at the
vertex of the gap, interpolated by a cubic spline,

.. math:: \bar g = \sum_p w_p(t)\, g_p, \qquad \sum_p w'_p(t)\, g_p = 0 .

Since the gap is stationary in t at the vertex, its derivative by displacements is the
mean of the derivatives in the planes with the same weights: force and gap remain
conjugate. The vertex moves along the width as the surfaces tilt. This adds to the
tangent of a force :math:`\lambda` the square of the derivative of the slope,

.. math:: -\lambda\, \nabla\nabla \bar g
    = \frac{\lambda}{\bar g''} \nabla \bar g' \otimes \nabla \bar g' ,

which acts like an unloaded spring between the slopes. Without it the iteration
oscillates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline

from swgjoint.fe.common.contact_patch import average_spline
from swgjoint.typing import Array, Mask

PATCH = 0.15
"""Half of the width over which a contact force is spread, in face widths [-]: one and a
half elements of the thesis mesh, as along the flanks."""
ELEMENTS = 1.5
"""Least value of that half width, in elements [-]; it applies to coarser meshes."""
FLAT = 0.1
"""Part of the crown's bend between planes below which a gap has no vertex [-]. The
bodies are then flattened and touch in several planes, as straight surfaces always do.
"""
WIDE = 3.0
"""Factor on :data:`FLAT` for planes that already share a contact, which they therefore
keep for longer [-]."""


def spread_forces(z: Array, nodes: int) -> sparse.csr_matrix:
    """Matrix that spreads the forces in the planes of the mesh over patches.

    The indentation under a point force depends on the elements and on the position of
    the force in them, see :mod:`swgjoint.fe.common.contact_patch`.

    Args:
        z: Positions of the planes, equally spaced (n_planes,) [m].
        nodes: Degrees of freedom in a plane.
    """
    half = max(PATCH * float(z[-1] - z[0]), ELEMENTS * float(z[1] - z[0]))
    if half > 0.5 * (z[-1] - z[0]):
        return sparse.eye_array(len(z) * nodes, format="csr")
    mean = average_spline(z, half)(z)
    return sparse.kron(mean.T, sparse.eye_array(nodes), format="csr")


def crown_bend(height: float, z: Array) -> float:
    """Bend of a crown's gap between neighbouring planes [m].

    Args:
        height: Height of the crown at the edges [m].
        z: Positions of the planes, equally spaced (n_planes,) [m].
    """
    return 8.0 * height / (len(z) - 1) ** 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Vertices:
    """Vertices of n gaps over the planes; t counts in distances between planes."""

    weight: Array
    """Weights w of the planes, zero without a vertex (n_planes, n)."""
    slope: Array
    """Derivatives w' of the weights by t (n_planes, n)."""
    bend: Array
    """Second derivative g'' by t (n,) [m]."""
    covered: Mask
    """Mask of the planes next to a vertex, which it replaces: their gaps are positive
    if that at the vertex is (n_planes, n)."""
    found: Mask
    """Mask of the columns that have a vertex (n,); columns with the smallest gap at an
    edge and flat ones have none."""


def vertices(gap: Array, flat: Array) -> Vertices:
    """Vertices of gaps in equally spaced planes.

    Args:
        gap: Gaps in the planes (n_planes, n) [m].
        flat: Bend up to which a column has no vertex (n,) [m].
    """
    planes, n = gap.shape
    none = np.zeros((planes, n))
    out = Vertices(
        weight=none,
        slope=none.copy(),
        bend=np.ones(n),
        found=np.zeros(n, dtype=bool),
        covered=np.zeros((planes, n), dtype=bool),
    )
    if planes < 4:
        return out
    splined = CubicSpline(np.arange(planes), np.eye(planes))(np.arange(planes), 1)
    d = splined @ gap
    index = np.arange(n)
    least = gap.argmin(axis=0)
    cell = least - (d[least, index] > 0.0)
    index = index[(cell >= 0) & (cell < planes - 1)]
    cell = cell[index]
    g0, g1, d0, d1 = (part[cell + k, index] for part in (gap, d) for k in (0, 1))
    # g' = d0 + 2 a t + 3 b t^2 rises from d0 <= 0 to d1 >= 0
    a, b = 3.0 * (g1 - g0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (g1 - g0)
    root = np.sqrt(np.maximum(a * a - 3.0 * b * d0, 0.0))
    t = np.clip(-d0 / np.where(a + root > 0.0, a + root, 1.0), 0.0, 1.0)
    bend = 2.0 * a + 6.0 * b * t
    # a gap with a minimum on both sides of a plane has two vertices, and the lower one
    # would alternate: the bodies have flattened each other there as well
    convex = (a > 0.0) & (a + 3.0 * b > 0.0)
    good = np.flatnonzero(convex & (bend > flat[index]) & (d0 <= 0.0) & (d1 >= 0.0))
    index, cell, t = index[good], cell[good], t[good]
    here, there = np.eye(planes)[cell], np.eye(planes)[cell + 1]
    rise, drop = splined[cell], splined[cell + 1]
    t = t[:, None]
    out.weight[:, index] = (
        (1.0 - t) ** 2 * ((1.0 + 2.0 * t) * here + t * rise)
        + t**2 * ((3.0 - 2.0 * t) * there - (1.0 - t) * drop)
    ).T
    out.slope[:, index] = (
        6.0 * t * (1.0 - t) * (there - here)
        + (1.0 - t) * (1.0 - 3.0 * t) * rise
        + t * (3.0 * t - 2.0) * drop
    ).T
    out.bend[index] = bend[good]
    out.found[index] = True
    at = np.arange(planes)[:, None]
    out.covered[:, index] = (at >= cell - 1) & (at <= cell + 2)
    return out

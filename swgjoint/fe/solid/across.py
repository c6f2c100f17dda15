r"""Contact between the planes of the mesh, at vertices of gaps over the face width.

A vertex is the minimum of the gap along the axis. Crowned surfaces touch on a length
shorter than an element. If contact acted only in the planes of the mesh, the closed gap
would be too large by up to :math:`g'' h^2/8`, which is 2 µm on a crowned wave generator
and depends on the mesh. Contact therefore also acts at the vertex of the gap, which a
cubic spline interpolates from the gaps :math:`g_p` in the planes,

.. math:: \bar g = \sum_p w_p(t)\, g_p, \qquad \sum_p w'_p(t)\, g_p = 0 .

Since the gap is stationary in t at the vertex, its derivative by displacements is the
mean of the derivatives in the planes with the same weights. Force and gap therefore
remain conjugate. The vertex moves along the face width as the surfaces tilt. For a
contact force :math:`\lambda` this motion adds a term to the tangent,

.. math:: -\lambda\, \nabla\nabla \bar g
    = \frac{\lambda}{\bar g''} \nabla \bar g' \otimes \nabla \bar g' ,

which acts like an unloaded spring between the slopes of the two surfaces. Without it
Newton's method oscillates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline

from swgjoint.fe.common.contact_patch import average_spline
from swgjoint.typing import Array, Mask

PATCH = 0.15
"""Half of the axial length over which a contact force is spread, in face widths [-].
This is one and a half elements of the thesis mesh, as along the flanks."""
ELEMENTS = 1.5
"""Smallest value of this half length, in elements [-]; it applies to meshes coarser
than that of the thesis."""
FLAT = 0.1
"""Bend of a gap below which it has no vertex, relative to :func:`crown_bend` [-]. The
bodies have then flattened each other and touch in several planes, as straight surfaces
always do."""
WIDE = 3.0
"""Factor on :data:`FLAT` for lines whose contact is already shared by several planes
[-]. This hysteresis keeps them from alternating."""


def spread_forces(z: Array, nodes: int) -> sparse.csr_matrix:
    """Matrix that spreads the forces in the planes of the mesh over patches.

    The indentation under a point force would depend on the size of the elements and on
    the position of the force in them, see :mod:`swgjoint.fe.common.contact_patch`.

    Args:
        z: Positions of the planes, equally spaced (n_planes,) [m].
        nodes: Number of degrees of freedom in a plane.

    Returns:
        Matrix from forces to nodal forces (n_planes nodes, n_planes nodes) [-]; the
        identity if a patch would be longer than the face width.
    """
    half = max(PATCH * float(z[-1] - z[0]), ELEMENTS * float(z[1] - z[0]))
    if half > 0.5 * (z[-1] - z[0]):
        return sparse.eye_array(len(z) * nodes, format="csr")
    mean = average_spline(z, half)(z)
    return sparse.kron(mean.T, sparse.eye_array(nodes), format="csr")


def crown_bend(height: float, z: Array) -> float:
    """Bend of the gap of a rigid parabolic crown [m].

    The bend is the second derivative of a gap by the plane number.

    Args:
        height: Depth of the crown at the edges of the face width [m].
        z: Positions of the planes, equally spaced (n_planes,) [m].
    """
    return 8.0 * height / (len(z) - 1) ** 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Vertices:
    """Vertices of n gaps over the planes; t is the position in plane distances."""

    weight: Array
    """Weights w of the planes, zero without a vertex (n_planes, n) [-]."""
    slope: Array
    """Derivatives w' of the weights by t, zero without a vertex (n_planes, n) [-]."""
    bend: Array
    """Second derivative g'' of the gap by t at the vertex (n,) [m]; one without a
    vertex."""
    covered: Mask
    """Mask of the two planes on either side of a vertex (n_planes, n). The vertex
    replaces the contact in these planes, whose gaps are not smaller than its own."""
    found: Mask
    """Mask of the gaps that have a vertex (n,). A gap that is smallest at an edge or
    too flat has none."""


def vertices(gap: Array, flat: Array) -> Vertices:
    """Find the vertices of gaps in equally spaced planes.

    Args:
        gap: Gaps in the planes (n_planes, n) [m].
        flat: Bend up to which a gap has no vertex (n,) [m].

    Returns:
        The vertices; with fewer than four planes no gap has one.
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
    # a gap with a minimum on both sides of a plane has two vertices, of which the lower
    # one would alternate; there, too, the bodies have flattened each other
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

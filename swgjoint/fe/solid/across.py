r"""Where bodies touch between the planes of the mesh: vertices of gaps over the width.

Crowned surfaces touch within a part of an element, and a contact that acts in the mesh
planes alone would close a gap that is too large by up to :math:`g'' h^2/8`: two
micrometres at a crowned wave generator, another amount for every mesh. Beside the
planes, contact therefore acts at the vertex of the gap, interpolated by a cubic spline,

.. math:: \bar g = \sum_p w_p(t)\, g_p, \qquad \sum_p w'_p(t)\, g_p = 0 .

Since the gap does not change with t there, its derivative by displacements is the same
mean of the derivatives in the planes: force and gap stay conjugate. The vertex rolls
along the width as the surfaces tilt, which adds to the tangent of a force
:math:`\lambda` the square of the derivative of the slope,

.. math:: -\lambda\, \nabla\nabla \bar g
    = \frac{\lambda}{\bar g''} \nabla \bar g' \otimes \nabla \bar g' ,

a spring between the slopes that is at rest. Without it the iteration rocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import CubicSpline

from swgjoint.fe.common.contact_patch import average_spline
from swgjoint.typing import Array, Mask

PATCH = 0.15
"""Half of the width over which a contact force is spread, in face widths: one and a
half elements of the thesis mesh, as along the flanks."""
ELEMENTS = 1.5
"""The same in elements where those are larger."""
FLAT = 0.1
"""Part of the crown's bend between planes below which the planes are enough: the bodies
have flattened each other, and touch in several planes. Straight surfaces do always."""
WIDE = 3.0
"""How many times larger it is where planes share the contact: they keep it so long."""


def spread_forces(z: Array, nodes: int) -> sparse.csr_matrix:
    """Forces in the planes of the mesh by forces there that act on patches.

    A point force on a mesh sinks in by an amount that depends on the elements, and on
    its place in them: see :mod:`swgjoint.fe.common.contact_patch`.

    Args:
        z: Of the planes, equally spaced (n_planes,) [m].
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
        height: Of the crown, at the edges [m].
        z: Of the planes, equally spaced (n_planes,) [m].
    """
    return 8.0 * height / (len(z) - 1) ** 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Vertices:
    """Of gaps over the planes; n columns."""

    weight: Array
    """w, 0 without a vertex (n_planes, n)."""
    slope: Array
    """w', the derivative by t, in distances of the planes (n_planes, n)."""
    bend: Array
    """g'' in these units (n,) [m]."""
    covered: Mask
    """Planes for which a vertex stands, those around it: no gap is negative there where
    its own is not (n_planes, n)."""
    found: Mask
    """Which columns have a vertex (n,): not those closest at an edge, nor flat ones."""


def vertices(gap: Array, flat: Array) -> Vertices:
    """Vertices of gaps in equally spaced planes.

    Args:
        gap: In the planes (n_planes, n) [m].
        flat: Bend up to which a column has none (n,) [m].
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
    # a gap that is hollow on both sides of a plane has two vertices, of which the lower
    # one would change: the bodies have flattened each other there, too
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

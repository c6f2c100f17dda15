r"""Line model of the toothed rim: stiffness and neutral radius from its 2D sector.

The teeth stiffen the rim. The condensed sector of the 2D finite-element model gives the
effective stiffness: under uniform stretch and bending its faces remain plane but are
free to deform within their planes, and the mean radial displacement of its bore is
zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from swgjoint.fe.plane.circular_spline import circular_spline_compliance
from swgjoint.fe.plane.superelement import Superelement


@dataclass(frozen=True, kw_only=True)
class RimSection:
    """Stiffness of the rim with its teeth, averaged over the pitch."""

    stretching: float
    """Axial stiffness E A [N]."""
    bending: float
    """Bending stiffness E I about the neutral line [N·m^2]."""
    neutral_radius: float
    """Radius at which bending causes no stretch [m]."""


def rim_section(element: Superelement) -> RimSection:
    r"""Axial and bending stiffness of a sector between its faces.

    The two faces enclose the angle p. Each of them moves along its outward normal by a
    at the bore radius :math:`r_b` and rotates by :math:`\omega`, so that
    :math:`u_n = a + \omega(r - r_b)`. The strain energy
    :math:`\tfrac12 S_{aa}a^2 + S_{a\omega}a\omega + \tfrac12 S_{\omega\omega}\omega^2`
    of this deformation yields

    .. math:: r_n = r_b + \frac{S_{a\omega}}{S_{aa}}, \quad
        EA = \tfrac14 p r_n S_{aa}, \quad
        EI = \tfrac14 p r_n \Bigl(S_{\omega\omega} - \frac{S_{a\omega}^2}{S_{aa}}\Bigr)

    because the stretch is :math:`2a/(p r_n)` and the change of curvature
    :math:`2\omega/(p r_n)`.

    Args:
        element: Condensed sector of the flexspline.
    """
    x, size = element.skeleton, element.face_size
    count, half = len(x), pi / element.sectors
    bore = float(np.hypot(*x[size - 1]))
    rows, values = [], []
    for nodes, side in (
        (range(size), np.sign(x[0, 0])),
        (range(count - size, count), np.sign(x[-1, 0])),
    ):
        outwards = np.array([side * cos(half), -sin(half)])
        for node in nodes:
            row = np.zeros((count, 2))
            row[node] = outwards
            rows.append(row.ravel())
            values.append([1.0, float(np.hypot(*x[node])) - bore])
    along = np.arange(size - 1, count - size + 1)  # the bore, both corners
    held = np.zeros((count, 2))
    held[along] = x[along] / np.hypot(*x[along].T)[:, None]
    rows.append(held.ravel() / len(along))
    values.append([0.0, 0.0])
    constraint, prescribed = np.array(rows), np.array(values)
    n, m = 2 * count, len(constraint)
    scale = float(np.mean(np.diag(element.stiffness)))
    system = np.zeros((n + m, n + m))
    system[:n, :n] = element.stiffness / scale
    system[n:, :n], system[:n, n:] = constraint, constraint.T
    right = np.zeros((n + m, 2))
    right[n:] = prescribed
    moved = np.linalg.solve(system, right)[:n]
    s = moved.T @ element.stiffness @ moved
    neutral = bore + s[0, 1] / s[0, 0]
    arc = 2.0 * half * neutral
    return RimSection(
        stretching=float(0.25 * arc * s[0, 0]),
        bending=float(0.25 * arc * (s[1, 1] - s[0, 1] ** 2 / s[0, 0])),
        neutral_radius=float(neutral),
    )


def tooth_pair_stiffness(
    flexspline: Superelement, circular_spline: Superelement
) -> float:
    """Stiffness of a pair of teeth along the normal, half-way up the flanks [N/m].

    It is the reciprocal of the sum of the compliances of both teeth. The skeleton of
    the flexspline's sector and the outside of the circular spline are fixed. The force
    is spread over the patch of a contact.

    Args:
        flexspline: Condensed sector of the flexspline.
        circular_spline: Condensed sector of the circular spline.
    """
    ring = circular_spline_compliance(circular_spline)
    same_tooth = ring.flank[int(np.flatnonzero(ring.offsets == 0)[0])]
    total = 0.0
    for element, compliance in (
        (flexspline, flexspline.flank_compliance),
        (circular_spline, same_tooth),
    ):
        middle = np.array([0.5 * sum(element.flank_range)])
        _, normal, _ = element.profile.evaluate(middle)
        size = element.flank_size
        row = np.zeros((2, size, 2))
        row[0] = element.spline(middle)[0][:, None] * normal
        total += float(row.ravel() @ compliance @ row.ravel())
    return 1.0 / total

"""Candidates of tooth contact in 3D: their choice, gaps and derivatives of the gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.solid.flank_minima import FlankSurfaces
from swgjoint.fe.solid.flank_points import SAME, FlankPoints
from swgjoint.typing import Array, Index, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class ToothRows:
    """The n candidate contacts and the derivatives of their gaps.

    Slopes of gaps follow the candidates. Where a minimum of the gap carries force it
    has two rows of its own for them, since the minimum moves as the slopes change, see
    :mod:`swgjoint.fe.solid.flank_minima`.
    """

    contacts: Contacts
    """Candidates as the 2D search finds them in each plane. Points between the planes
    and slopes have the place and the normal of the contact in the nearest plane, with
    their own gaps and weights."""
    plane: Index
    """Plane of each candidate, or the nearest plane (n,)."""
    z: Array
    """Axial position of each candidate (n,) [m]."""
    slope: Mask
    """Mask of the slopes (n,)."""
    spring: Array
    """Compliance of a slope: bend of the gap over the contact force; zero for all other
    candidates (n,), [1/(N m)] along the flank and [m/N] over the face width."""
    weight: Array
    """Derivative of the gaps by the displacements of the flexspline's flank nodes, in
    the frames of its teeth (n, n_flank) [-]."""
    circular_spline_weight: Array
    """Derivative of the gaps by the displacements of the circular spline's flank nodes,
    in the frames of its teeth (n, n_c) [-]."""
    rows: Array
    """Derivative of the gaps by the masters of the toothed segments in the global frame
    (n, 3 m) [-]."""
    arm: Array
    """Lever arm of the normals: derivative of the gaps by a rotation of the whole
    flexspline about the axis of the drive (n,) [m]."""
    circular_spline_arm: Array
    """Lever arm about the axis of the circular spline: negative derivative of the gaps
    by a rotation of the circular spline (n,) [m]."""

    def __len__(self) -> int:
        return len(self.plane)

    @property
    def slopes(self) -> int:
        """Number of slopes, which come last."""
        return int(self.slope.sum())

    def chosen(self, index: Index) -> ToothRows:
        """The candidates with the given indices."""
        picked = {
            key: getattr(self, key)[index]
            for key in self.__dataclass_fields__
            if key != "contacts"
        }
        return ToothRows(contacts=self.contacts.chosen(index), **picked)


def flank_candidates(
    surfaces: FlankSurfaces,
    seeds: FlankPoints,
    reach: float,
    held: FlankPoints | None,
    force: Array | None,
    *,
    stay: bool,
) -> tuple[FlankPoints, Array]:
    """Minima of the gap, and points that carry force until a minimum is close to them.

    That minimum then moves as if it carried their force. The force on a flank that is
    nearly flat over the face width makes another place its minimum. If the force went
    there as a whole it would jump to and fro for ever; if the points stay instead, they
    share the force with the minimum.

    Args:
        surfaces: Gaps of the flanks.
        seeds: Points from which minima are found.
        reach: Largest gap of a candidate [m].
        held: Points that carry force, from which minima are found, too; None if there
            are none.
        force: Forces at these points (n,) [N]; None leaves them out.
        stay: Whether a minimum takes over the force only from its own place.

    Returns:
        The candidates, minima first, and the forces of the minima (m,) [N].
    """
    if held is None:
        points = surfaces.minima(seeds, reach)
        return points, np.zeros(len(points))
    points = surfaces.minima(seeds.join(held), reach)
    force = np.zeros(len(held)) if force is None else force
    close = SAME if stay else 1.0
    loads, left = held.pass_to(points, force, surfaces.length, close)
    left &= surfaces.gaps(held).value < reach
    return points.join(held.chosen(np.flatnonzero(left))), loads

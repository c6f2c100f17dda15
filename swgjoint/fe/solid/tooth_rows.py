"""Candidates of tooth contact in 3D: gaps and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

from swgjoint.fe.plane.contact_points import Contacts
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

"""Rigid teeth on the rim and their gaps to the teeth of the circular spline.

The flanks are exact. The contact search is that of the 2D finite-element model; all
nodes on the flank of a rigid tooth have the same displacement.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from swgjoint.fe.plane.circular_spline import CircularSpline
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.corotation import rotate, rotate_right_angle
from swgjoint.fe.plane.tooth_contact import ToothContact
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array

NODES = 10
"""Number of nodes on a flank; the search for gap minima starts at twice as many
points."""


def _flank_spline(profile: ToothProfile) -> CubicSpline:
    """Spline of the weights of a flank's nodes over the arc length."""
    return CubicSpline(np.linspace(*profile.contact_range, NODES), np.eye(NODES))


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidFlanks:
    """The flexspline's flanks as input to :mod:`swgjoint.fe.plane.tooth_contact`."""

    profile: ToothProfile
    """Tooth profile of the flexspline."""
    flank_size: int = NODES
    """Number of nodes on a flank."""

    @cached_property
    def spline(self) -> CubicSpline:
        """Spline of the weights of the flank's nodes over the arc length."""
        return _flank_spline(self.profile)

    @property
    def flank_range(self) -> tuple[float, float]:
        """Arc lengths of both ends of a flank, between the lands [m]."""
        return self.profile.contact_range


@dataclass(frozen=True, kw_only=True, eq=False)
class ThinRingTeeth:
    """Teeth of both members, those of the flexspline fixed to the rim's mean line."""

    flexspline: ToothProfile
    """Tooth profile of the flexspline."""
    circular_spline: ToothProfile
    """Tooth profile of the circular spline."""
    foot_radius: float
    """Radius of the mean line that carries the flexspline's teeth [m]."""
    stiffness: float
    """Stiffness of a tooth pair along the common normal [N/m]."""
    shift: Array
    """Shifts of the flexspline's teeth due to errors, in their frames (N, 2) [m]."""
    circular_spline_shift: Array | None = None
    """Shifts of the circular spline's teeth due to errors, in their frames (N_c, 2)
    [m]; None without errors."""

    @cached_property
    def _flanks(self) -> RigidFlanks:
        """Flanks of the flexspline."""
        return RigidFlanks(profile=self.flexspline)

    @cached_property
    def _facing(self) -> CircularSpline:
        """Circular spline, whose flanks may shift only if it has errors."""
        profile = self.circular_spline
        if self.circular_spline_shift is None:
            return CircularSpline(profile=profile)
        return CircularSpline(profile=profile, weights=_flank_spline(profile))

    def find_contacts(
        self, foot: Array, slope: Array, *, reach: float = 0.0
    ) -> tuple[Contacts, Array]:
        """Overlapping flanks of the teeth on a deformed rim.

        Args:
            foot: Positions of the teeth on the rim's mean line (N, 2) [m].
            slope: Tangents of the mean line at the teeth (N, 2).
            reach: Largest gap of flanks that do not overlap but are also returned [m].

        Returns:
            The contacts, and the angles of the flexspline's teeth (N,) [rad].
        """
        angle = np.arctan2(-slope[:, 1], -slope[:, 0])
        offset = rotate(foot, -angle)
        offset[:, 1] -= self.foot_radius
        offset = offset + self.shift
        circular_spline_flank = np.zeros((self.circular_spline.teeth, 0))
        if self.circular_spline_shift is not None:
            circular_spline_flank = np.tile(self.circular_spline_shift, 2 * NODES)
        search = ToothContact(
            element=self._flanks,
            circular_spline=self._facing,
            circular_spline_flank=circular_spline_flank,
            angle=angle,
            bearing=np.arctan2(-foot[:, 0], foot[:, 1]),
        )
        # only overlapping flanks carry force; errors of the teeth may close open gaps
        nodal = np.tile(offset, 2 * NODES)
        return search.search(nodal, reach, None, thorough=False), angle

    def rows(
        self, contacts: Contacts, foot: Array, slope: Array, angle: Array
    ) -> tuple[Array, Array]:
        r"""Derivatives of the gaps with respect to the nodes below the teeth.

        n is the normal out of the circular spline, t is its tangent and J rotates by a
        right angle. The contact point p on a flexspline tooth moves by
        :math:`dp = dr + J(p - r)\,d\varphi`, where
        :math:`d\varphi = r' \times dr'/|r'|^2` is the rotation of the tooth. Flanks
        with the curvatures :math:`\kappa` (flexspline) and :math:`\kappa_c` (circular
        spline) roll and slide on each other:

        .. math:: dg = n\cdot dp, \quad d^2g = \frac{\kappa\kappa_c\,(t\cdot dp)^2
            - 2\kappa_c\,(t\cdot dp)\,d\varphi - d\varphi^2}{\kappa + \kappa_c}
            - n\cdot(p - r)\,d\varphi^2

        Args:
            contacts: The n contacts.
            foot: Positions r of the teeth on the rim's mean line (N, 2) [m].
            slope: Tangents r' of the mean line at the teeth (N, 2).
            angle: Angles of the flexspline's teeth (N,) [rad].

        Returns:
            First (n, 4) and second (n, 4, 4) derivatives with respect to (r, r').
        """
        j = contacts.sector
        normal = rotate(contacts.normal, angle[j])
        tangent = -rotate_right_angle(normal)
        arm = rotate(contacts.point, angle[j]) - foot[j]
        square = np.einsum("ni,ni->n", slope[j], slope[j])
        turn = np.zeros((len(j), 4))
        turn[:, 2:] = rotate_right_angle(slope[j]) / square[:, None]

        def moved(direction: Array) -> Array:
            row = (
                np.einsum("ni,ni->n", direction, rotate_right_angle(arm))[:, None]
                * turn
            )
            row[:, :2] += direction
            return np.asarray(row)

        across = moved(tangent)
        _, _, curvature = self.flexspline.evaluate(contacts.station)
        ring_curvature = self.facing_curvature(contacts, arm + foot[j])
        both = np.maximum(curvature + ring_curvature, 1e-3 * np.abs(curvature))
        form = np.empty((len(j), 2, 2))
        form[:, 0, 0] = curvature * ring_curvature / both
        form[:, 0, 1] = form[:, 1, 0] = -ring_curvature / both
        form[:, 1, 1] = -1.0 / both - np.einsum("ni,ni->n", normal, arm)
        pair = np.stack([across, turn], axis=1)
        return moved(normal), np.swapaxes(pair, 1, 2) @ (form @ pair)

    def facing_curvature(self, contacts: Contacts, points: Array) -> Array:
        """Curvature of the circular spline's flank at contacts (n,) [1/m].

        Args:
            contacts: The n contacts.
            points: Positions of the contacts (n, 2) [m].
        """
        pitch = 2.0 * np.pi / self.circular_spline.teeth
        place = np.asarray((contacts.tooth + 0.5) * pitch, dtype=np.float64)
        local = rotate(points, -place)
        # the profile is a right flank; a right flank of the flexspline faces a left one
        local[:, 0] *= np.where(contacts.side == 0, -1.0, 1.0)
        return np.asarray(self.circular_spline.signed_distance(local)[2])

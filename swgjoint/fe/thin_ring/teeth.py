"""Rigid teeth on the rim and their gaps to those of the circular spline.

The flanks are exact and the search for contact is that of the plane finite elements: a
tooth that moves as a whole is a flank whose nodes all move alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from swgjoint.fe.circular_spline import CircularSpline
from swgjoint.fe.corotation import rotate, turned
from swgjoint.fe.tooth_contact import Contacts, ToothContact
from swgjoint.gear.profile import ToothProfile

Array = NDArray[np.float64]
Index = NDArray[np.int64]

NODES = 10
"""Of a flank; the search for minima of the gap begins at twice as many places."""


def _flank_spline(profile: ToothProfile) -> CubicSpline:
    """Weights of the nodes of a flank, whose displacements are all alike."""
    return CubicSpline(np.linspace(*profile.contact_range, NODES), np.eye(NODES))


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidFlanks:
    """The flexspline's flanks as :mod:`swgjoint.fe.tooth_contact` wants them."""

    profile: ToothProfile
    flank_size: int = NODES

    @cached_property
    def spline(self) -> CubicSpline:
        """Weights of the nodes."""
        return _flank_spline(self.profile)

    @property
    def flank_range(self) -> tuple[float, float]:
        """Between the lands [m]."""
        return self.profile.contact_range


@dataclass(frozen=True, kw_only=True, eq=False)
class Teeth:
    """Both members' teeth; those of the flexspline stand on a line of given radius."""

    flexspline: ToothProfile
    circular_spline: ToothProfile
    foot_radius: float
    """Of the mean line that carries them [m]."""
    stiffness: float
    """Of a pair along the common normal [N/m]."""
    shift: Array
    """Errors of the flexspline's teeth in their frames (N, 2) [m]."""
    ring_shift: Array | None = None
    """The same of the circular spline (N_c, 2) [m]; None for none."""

    @cached_property
    def _flanks(self) -> RigidFlanks:
        return RigidFlanks(profile=self.flexspline)

    @cached_property
    def _facing(self) -> CircularSpline:
        profile = self.circular_spline
        if self.ring_shift is None:
            return CircularSpline(profile=profile)
        return CircularSpline(profile=profile, weights=_flank_spline(profile))

    def seen(self, foot: Array, slope: Array) -> tuple[Contacts, Array]:
        """Contacts of teeth on a deformed rim, and the angles of the teeth.

        Args:
            foot: Where the teeth stand (N, 2) [m].
            slope: Tangents of the rim there (N, 2).
        """
        angle = np.arctan2(-slope[:, 1], -slope[:, 0])
        own = rotate(foot, -angle)
        own[:, 1] -= self.foot_radius
        own = own + self.shift
        ring_flank = np.zeros((self.circular_spline.teeth, 0))
        if self.ring_shift is not None:
            ring_flank = np.tile(self.ring_shift, 2 * NODES)
        search = ToothContact(
            element=self._flanks,
            circular_spline=self._facing,
            ring_flank=ring_flank,
            angle=angle,
            bearing=np.arctan2(-foot[:, 0], foot[:, 1]),
        )
        # only what overlaps is pressed, so nothing is followed before it touches
        return search.search(np.tile(own, 2 * NODES), 0.0, None, thorough=False), angle

    def rows(
        self, contacts: Contacts, foot: Array, slope: Array, angle: Array
    ) -> tuple[Array, Array]:
        r"""Rows of the gaps by the coordinates of the nodes that carry the teeth.

        .. math:: dg = n\cdot(dr + J(p - r)\,d\varphi), \quad
            d\varphi = \frac{r' \times dr'}{|r'|^2}

        Returns:
            Rows by (r, r') (n, 4) and by the turn of the tooth (n, 4).
        """
        j = contacts.sector
        normal = rotate(contacts.normal, angle[j])
        arm = turned(rotate(contacts.point, angle[j]) - foot[j])
        square = np.einsum("ni,ni->n", slope[j], slope[j])
        turn = np.zeros((len(j), 4))
        turn[:, 2:] = turned(slope[j]) / square[:, None]
        rows = np.einsum("ni,ni->n", normal, arm)[:, None] * turn
        rows[:, :2] += normal
        return rows, turn

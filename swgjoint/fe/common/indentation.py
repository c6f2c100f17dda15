r"""Local indentation of two flanks under the narrow strip of their contact.

In :mod:`swgjoint.fe.common.contact_patch` the flanks deform as if a contact force were
spread over a patch of half length a, about a tenth of a millimetre. The real contact
strip is ten times narrower, so the flanks approach further. The closed form of an
elastic half-plane gives this additional approach: under a force F with Hertzian
pressure on a strip of half width b, the centre of the strip is displaced further than
the average over the patch by

.. math:: h = k F \left(\ln\frac{a}{b} + c\right), \quad
    k = \frac{2}{\pi w} \sum_j \frac{1}{E'_j}, \quad
    b^2 = 2 k F R, \quad
    c = 2 \ln 2 + \tfrac{1}{2} - \tfrac{1727}{840} ,

with the face width w, the in-plane moduli :math:`E'` and the radius R of relative
curvature (K. L. Johnson, *Contact Mechanics*, Cambridge 1985, section 2.3 for the
surface displacement under a strip, eq. (4.43) for b). The terms ln 2 + 1/2 come from
the centre of the strip, and 1727/840 - ln 2 comes from the weights of the patch. A
strip as wide as the patch or wider needs no correction, and the slope must stay finite
at zero force. With b_0, the half width at zero force, the model therefore uses

.. math:: h(F) = \frac{k F}{2} \ln\left(1 + \frac{A}{b_0^2 + 2 k R F}\right), \quad
    A = (a e^c)^2 .

R is a constant of the drive, so the law depends on the force alone and has a potential.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import exp, log, pi

import numpy as np

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index

CENTRE_OVER_PATCH = 2.0 * log(2.0) + 0.5 - 1727.0 / 840.0
"""Constant c for patch weights (1 - x^2)^3 [-]."""
NARROWEST = 0.01
"""Half width b_0 of the strip at zero force, in half lengths of the patch [-]."""
ABOUT_PITCH_POINT = 0.5
"""Length of flank on either side of the pitch point over which curvatures are averaged,
in modules [-]. The teeth make contact there."""
STRAIGHT = 1e-4
"""Relative curvature times module below which two points count as conforming [-]."""


@dataclass(frozen=True, kw_only=True)
class Indentation:
    """Indentation law of the flanks of a drive."""

    softness: float
    """Compliance factor k of the law [m/N]."""
    patch: float
    """Half length a of a contact patch [m]."""
    radius: float
    """Radius R of relative curvature [m]; infinite for conforming flanks."""

    def __post_init__(self) -> None:
        for key in ("softness", "patch", "radius"):
            if not getattr(self, key) > 0.0:
                raise ValueError(f"{key} = {getattr(self, key)!r}: expected > 0")

    @classmethod
    def from_members(
        cls,
        softness: tuple[float, ...],
        patch: tuple[float, ...],
        profiles: tuple[ToothProfile, ToothProfile],
    ) -> Indentation:
        """Indentation law of a drive from the properties of its members.

        Args:
            softness: Contributions 2 / (pi w E') of the elastic members to k [m/N].
            patch: Half length of a patch on each of these members [m].
            profiles: Tooth profiles of flexspline and circular spline.
        """
        total = sum(softness)
        parts = [k * log(a) for k, a in zip(softness, patch, strict=True)]
        return cls(
            softness=total,
            patch=exp(sum(parts) / total),
            radius=relative_radius(*profiles),
        )

    @property
    def _widest(self) -> float:
        """Constant A of the law [m^2]."""
        return (self.patch * exp(CENTRE_OVER_PATCH)) ** 2

    @property
    def _narrowest(self) -> float:
        """Square of b_0 [m^2]."""
        return (NARROWEST * self.patch) ** 2

    @property
    def _growth(self) -> float:
        """Derivative of b^2 with respect to the force [m^2/N]."""
        return 2.0 * self.softness * self.radius

    @property
    def constants(self) -> Array:
        """Constants k, A, b_0^2 and 2 k R of the law, in SI units (4,)."""
        return np.array(
            [self.softness, self._widest, self._narrowest, self._growth], dtype=float
        )

    def approach(self, force: Array) -> Array:
        """Additional approach h [m] under non-negative forces [N]."""
        if np.isinf(self.radius):
            return np.zeros_like(force)
        width = self._narrowest + self._growth * force
        return 0.5 * self.softness * force * np.log1p(self._widest / width)

    def slope(self, force: Array) -> Array:
        """Slope dh/dF [m/N]: positive, or zero for conforming flanks."""
        if np.isinf(self.radius):
            return np.zeros_like(force)
        width, most = self._narrowest + self._growth * force, self._widest
        steady = np.log1p(most / width)
        falling = self._growth * force * most / (width * (width + most))
        return np.asarray(0.5 * self.softness * (steady - falling))

    def energy(self, force: Array) -> Array:
        r"""Strain energy :math:`\int F\,dh` under non-negative forces F [J]."""
        if np.isinf(self.radius):
            return np.zeros_like(force)
        outer, inner = self._narrowest + self._widest, self._narrowest
        area = self._under(force, outer) - self._under(force, inner)
        return np.asarray(force * self.approach(force) - 0.5 * self.softness * area)

    def _under(self, force: Array, start: float) -> Array:
        r"""Integral :math:`\int_0^F t \ln(b_s^2 + \gamma t)\,dt`, gamma = d(b^2)/dF.

        Args:
            force: Force F [N].
            start: Square of b_s [m^2].
        """
        at = start / self._growth
        x = np.asarray(force / at)
        # for small x the terms cancel: use the series
        small = x < 0.05
        few = x if small.all() else x[small]
        series = np.zeros_like(few)
        for n in range(13, 2, -1):
            series -= (-1.0) ** n / (n * (n - 2.0))
            series *= few
        series *= few**2
        area = series
        if few is not x:
            area = 0.5 * (x**2 - 1.0) * np.log1p(x) - 0.25 * x**2 + 0.5 * x
            area[small] = series
        return np.asarray(at**2 * area + 0.5 * force**2 * log(start))


def relative_radius(own: ToothProfile, other: ToothProfile) -> float:
    """Radius R of relative curvature of two flanks near the pitch point.

    Any point of one flank may meet any point of the other. R is therefore the geometric
    mean over all pairs of points within half a module of the pitch point whose relative
    curvature is positive, so that they can touch. The contact width varies with the
    square root of R and the approach with the logarithm of the width. A factor of two
    in R thus changes h by a tenth only.

    Args:
        own: Profile of one member.
        other: Profile of the other member.

    Returns:
        Radius R [m]; infinite for conforming flanks.
    """
    module = 2.0 * own.pitch_radius / own.teeth
    one, two = (_curvatures(p, ABOUT_PITCH_POINT * module) for p in (own, other))
    relative = (one[:, None] + two).ravel()
    touching = relative[relative > STRAIGHT / module]
    if not touching.size:
        return np.inf
    return float(np.exp(-np.log(touching).mean()))


def _curvatures(profile: ToothProfile, reach: float) -> Array:
    """Curvatures at equally spaced points near the pitch point (n,) [1/m]."""
    stations = np.linspace(*profile.contact_range, 501)
    points, _, curvature = profile.evaluate(stations)
    radius = np.hypot(points[:, 0], points[:, 1])
    middle = stations[np.abs(radius - profile.pitch_radius).argmin()]
    return np.asarray(curvature[np.abs(stations - middle) <= reach])


def softness_of(modulus: float, width: float) -> float:
    """Contribution of a member to the compliance factor k.

    Args:
        modulus: In-plane modulus E' [Pa].
        width: Face width w [m].

    Returns:
        Contribution 2 / (pi w E') [m/N].
    """
    return 2.0 / (pi * width * modulus)


@dataclass(frozen=True, kw_only=True, eq=False)
class Strips:
    """Contacts grouped by flank pair: all points of a pair form one contact strip.

    On conforming flanks the force moves between points that are closer together than a
    patch. If they were treated separately, each would indent as if the others were far
    away.
    """

    law: Indentation
    """Indentation law of the drive."""
    strip: Index
    """Number of the strip to which each contact belongs (n,)."""
    force: Array
    """Force of each strip at which the law is linearised (n_strips,) [N]."""
    usual: Array | None = None
    """Mean force of each strip, while it carries any, in the problems to superpose
    (n_strips,) [N]; None if it is not known yet."""

    @classmethod
    def from_contacts(
        cls, law: Indentation, contacts: Contacts, held: Contacts | None, force: Array
    ) -> Strips:
        """Strips of contact candidates under the forces of earlier contacts.

        Args:
            law: Indentation law of the drive.
            contacts: Contact candidates.
            held: Points that carry force and need not be candidates; None if there
                are none.
            force: Normal forces of these points (n_held,) [N].
        """
        keys = _keys(contacts)
        known, strip = np.unique(keys, return_inverse=True)
        total = np.zeros(len(known))
        if held is not None and len(held):
            same = known[:, None] == _keys(held)
            total = same @ force
        return cls(law=law, strip=strip, force=total)

    def sums(self, force: Array) -> Array:
        """Forces of the strips (n_strips,) [N] from those of the contacts (n,) [N]."""
        total = np.bincount(self.strip, weights=force, minlength=self.force.size)
        return np.asarray(total, dtype=np.float64)

    @cached_property
    def _tangent(self) -> tuple[Array, Array]:
        """Tangent of the law at the forces of the strips, each (n_strips,).

        The slope [m/N] and the approach at zero force [m].
        """
        slope = self.law.slope(self.force)
        return slope, self.law.approach(self.force) - slope * self.force

    @property
    def compliance(self) -> Array:
        """Approach of each contact per force on each contact (n, n) [m/N]."""
        same = self.strip[:, None] == self.strip
        return np.where(same, self._tangent[0][self.strip], 0.0)

    def linearise(self) -> tuple[Array, Array]:
        """Linear law for a drive that is linearised once to superpose tooth errors.

        At least one strip must be loaded.

        Returns:
            Compliance (n, n) [m/N] and approach at zero force (n,) [m].
        """
        same = self.strip[:, None] == self.strip
        return np.where(same, self.line[self.strip], 0.0), self.offset

    @property
    def line(self) -> Array:
        """Compliance of each strip in the law of :meth:`linearise` (n_strips,) [m/N].

        A loaded strip gets its tangent compliance. An unloaded strip may later carry
        about as much force as the others, so it gets the secant up to their mean force.
        """
        law, force = self.law, self.force
        usual = force[force > 0.0].mean()
        secant = law.approach(usual) / usual
        return np.where(force > 0.0, self._tangent[0], secant)

    @property
    def line_offset(self) -> Array:
        """Approach of each strip at zero force in that law (n_strips,) [m]."""
        return self._tangent[1]

    def excess(self, force: Array) -> tuple[Array, Array]:
        """Approach of the strips beyond the linear law of :meth:`linearise`.

        Args:
            force: Forces of the strips (..., n_strips) [N]; negative ones count as
                zero.

        Returns:
            Approach [m] and its derivative [m/N], each (..., n_strips).
        """
        some, law = np.maximum(force, 0.0), self.law
        beyond = law.approach(some) - self.line * some - self.line_offset
        return beyond, law.slope(some) - self.line

    def excess_energy(self, force: Array) -> Array:
        """Strain energy of the strips beyond that of the linear law (...) [J].

        It is zero under the forces at which the law was linearised.

        Args:
            force: Forces of the strips (..., n_strips) [N]; negative ones count as
                zero.
        """
        some, law = np.maximum(force, 0.0), self.law
        first = 0.5 * self.line @ self.force**2 - law.energy(self.force).sum()
        beyond = first - some**2 @ (0.5 * self.line)
        # strips without force have no energy
        at = np.flatnonzero(some)
        energy = law.energy(some.ravel()[at])
        sums = np.bincount(at // force.shape[-1], energy, minlength=beyond.size)
        return np.asarray(beyond + sums.reshape(beyond.shape))

    @property
    def offset(self) -> Array:
        """Approach of each contact at zero force in the linearised law (n,) [m]."""
        return np.asarray(self.line_offset[self.strip])

    def error(self, force: Array) -> float:
        """Largest error [m] of the linearised law under contact forces (n,) [N]."""
        total, (slope, offset) = self.sums(force), self._tangent
        wrong = offset + slope * total - self.law.approach(np.maximum(total, 0.0))
        return float(np.abs(wrong).max(initial=0.0))


def strain_energy(law: Indentation, contacts: Contacts | None, force: Array) -> float:
    """Strain energy of the indentation of all strips.

    Args:
        law: Indentation law of the drive.
        contacts: Points that carry force; None if there are none.
        force: Normal forces of these points (n,) [N].

    Returns:
        Strain energy [J].
    """
    if contacts is None or not len(contacts):
        return 0.0
    strips = Strips.from_contacts(law, contacts, None, force)
    return float(law.energy(strips.sums(force)).sum())


def _keys(contacts: Contacts) -> Index:
    """Number of the flank pair of each contact, in the order of the flanks (n,)."""
    return ((2 * contacts.sector + contacts.side) << 32) + contacts.tooth

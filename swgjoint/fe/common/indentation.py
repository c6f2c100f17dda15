r"""Indentation of two flanks by the strip of their contact, closer than a patch sees.

The flanks of :mod:`swgjoint.fe.common.contact_patch` give way as if a contact force
were spread over a patch of half length a, a tenth of a millimetre. The real strip is
ten times narrower. On top of the patch the flanks therefore approach by the closed form
of an elastic half-plane: under a force F the centre of a strip of half width b with the
pressure of Hertz lies deeper than the average over the patch by

.. math:: h = k F \left(\ln\frac{a}{b} + c\right), \quad
    k = \frac{2}{\pi w} \sum_j \frac{1}{E'_j}, \quad
    b^2 = 2 k F R, \quad
    c = 2 \ln 2 + \tfrac{1}{2} - \tfrac{1727}{840} ,

with the face width w, the moduli :math:`E'` of the plane and the radius R of relative
curvature (K. L. Johnson, *Contact Mechanics*, Cambridge 1985, section 2.3 for the
surface displacement under a strip, eq. (4.43) for b). The two terms ln 2 + 1/2 belong
to the centre of the strip, 1727/840 - ln 2 to the weights of the patch. A strip as wide
as the patch, or wider, needs no correction, and the slope must stay finite where the
force vanishes:

.. math:: h(F) = \frac{k F}{2} \ln\left(1 + \frac{A}{b_0^2 + 2 k R F}\right), \quad
    A = (a e^c)^2 .

The law follows the force alone, so that it has a potential: R is one number of a drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, pi

import numpy as np

from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.gear.teeth.profile import ToothProfile
from swgjoint.typing import Array, Index

CENTRE_OVER_PATCH = 2.0 * log(2.0) + 0.5 - 1727.0 / 840.0
"""c: of the weights (1 - x^2)^3 of a patch."""
NARROWEST = 0.01
"""Half width b_0 of the strip without force, in half lengths of the patch."""
ABOUT_PITCH_POINT = 0.5
"""Modules along the flanks, on either side of the pitch point, whose curvatures count:
teeth meet there."""
STRAIGHT = 1e-4
"""Relative curvature, over the module, that counts as none."""


@dataclass(frozen=True, kw_only=True)
class Indentation:
    """Law of the flanks of a drive."""

    softness: float
    """k [m/N]."""
    patch: float
    """Half length a of a patch [m]."""
    radius: float
    """R of relative curvature [m]; infinite where flanks conform."""

    def __post_init__(self) -> None:
        for key in ("softness", "patch", "radius"):
            if not getattr(self, key) > 0.0:
                raise ValueError(f"{key} = {getattr(self, key)!r}; accepted: above 0")

    @classmethod
    def from_members(
        cls,
        softness: tuple[float, ...],
        patch: tuple[float, ...],
        profiles: tuple[ToothProfile, ToothProfile],
    ) -> Indentation:
        """That of a drive.

        Args:
            softness: 2 / (pi w E') of every elastic member [m/N].
            patch: Half length of a patch on each of them [m].
            profiles: Of flexspline and circular spline.
        """
        total = sum(softness)
        parts = [own * log(a) for own, a in zip(softness, patch, strict=True)]
        return cls(
            softness=total,
            patch=exp(sum(parts) / total),
            radius=relative_radius(*profiles),
        )

    @property
    def _widest(self) -> float:
        """A [m^2]."""
        return (self.patch * exp(CENTRE_OVER_PATCH)) ** 2

    @property
    def _narrowest(self) -> float:
        """The square of b_0 [m^2]."""
        return (NARROWEST * self.patch) ** 2

    @property
    def _growth(self) -> float:
        """Growth of the square of b with the force [m^2/N]."""
        return 2.0 * self.softness * self.radius

    def approach(self, force: Array) -> Array:
        """Approach h [m] under forces that are not negative [N]."""
        if np.isinf(self.radius):
            return np.zeros_like(force)
        width = self._narrowest + self._growth * force
        return 0.5 * self.softness * force * np.log1p(self._widest / width)

    def slope(self, force: Array) -> Array:
        """Slope dh/dF [m/N], always positive."""
        if np.isinf(self.radius):
            return np.zeros_like(force)
        width, most = self._narrowest + self._growth * force, self._widest
        steady = np.log1p(most / width)
        falling = self._growth * force * most / (width * (width + most))
        return np.asarray(0.5 * self.softness * (steady - falling))

    def energy(self, force: Array) -> Array:
        r"""Strain energy :math:`\int F\,dh` [J]."""
        if np.isinf(self.radius):
            return np.zeros_like(force)
        outer, inner = self._narrowest + self._widest, self._narrowest
        area = self._under(force, outer) - self._under(force, inner)
        return np.asarray(force * self.approach(force) - 0.5 * self.softness * area)

    def _under(self, force: Array, start: float) -> Array:
        r""":math:`\int_0^F t \ln(b_s^2 + \gamma t)\,dt`, gamma the growth of b^2.

        Args:
            force: F [N].
            start: The square of b_s [m^2].
        """
        at = start / self._growth
        x = force / at
        exact = 0.5 * (x**2 - 1.0) * np.log1p(x) - 0.25 * x**2 + 0.5 * x
        # the terms cancel where x is small: there by the series
        n = np.arange(3.0, 14.0)
        terms = np.power.outer(np.minimum(x, 0.05), n) * -((-1.0) ** n)
        series = (terms / (n * (n - 2.0))).sum(axis=-1)
        area = at**2 * np.where(x < 0.05, series, exact)
        return np.asarray(area + 0.5 * force**2 * log(start))


def relative_radius(own: ToothProfile, other: ToothProfile) -> float:
    """R of relative curvature of two flanks near the pitch point [m].

    Any point of one flank may meet any point of the other: it is the geometric mean
    over all pairs of points within half a module of the pitch point that can touch,
    those whose relative curvature is positive. The contact width follows the root of R
    and the approach the logarithm of the width: a factor of two in R is a tenth of h.
    """
    module = 2.0 * own.pitch_radius / own.teeth
    one, two = (_curvatures(p, ABOUT_PITCH_POINT * module) for p in (own, other))
    relative = (one[:, None] + two).ravel()
    touching = relative[relative > STRAIGHT / module]
    if not touching.size:
        return np.inf
    return float(np.exp(-np.log(touching).mean()))


def _curvatures(profile: ToothProfile, reach: float) -> Array:
    """Curvatures at equal steps about the pitch point (n,) [1/m]."""
    stations = np.linspace(*profile.contact_range, 501)
    points, _, curvature = profile.evaluate(stations)
    radius = np.hypot(points[:, 0], points[:, 1])
    middle = stations[np.abs(radius - profile.pitch_radius).argmin()]
    return np.asarray(curvature[np.abs(stations - middle) <= reach])


def softness_of(modulus: float, width: float) -> float:
    """A member's part of k [m/N]; ``modulus`` is that of its plane, E' [Pa]."""
    return 2.0 / (pi * width * modulus)


@dataclass(frozen=True, kw_only=True, eq=False)
class Strips:
    """Contacts gathered by their two flanks: all points of a pair are one strip.

    Where flanks conform the force wanders between points that are closer than a patch;
    each by itself would indent as if the others were far away.
    """

    law: Indentation
    strip: Index
    """Strip of each contact (n,)."""
    force: Array
    """Force of each strip, about which the law is linearised (n_strips,) [N]."""

    @classmethod
    def from_contacts(
        cls, law: Indentation, contacts: Contacts, held: Contacts | None, force: Array
    ) -> Strips:
        """Gather candidates under the forces of contacts that may be others.

        Args:
            law: Of the drive.
            contacts: The candidates.
            held: Points that carry force.
            force: Their normal forces (n_held,) [N].
        """
        keys = _keys(contacts)
        known, strip = np.unique(keys, axis=0, return_inverse=True)
        total = np.zeros(len(known))
        if held is not None and len(held):
            same = (known[:, None] == _keys(held)).all(axis=-1)
            total = same @ force
        return cls(law=law, strip=strip.ravel(), force=total)

    def sums(self, force: Array) -> Array:
        """Forces of the strips (n_strips,) from those of the contacts (n,)."""
        found = np.bincount(self.strip, weights=force, minlength=self.force.size)
        return np.asarray(found, dtype=np.float64)

    @property
    def compliance(self) -> Array:
        """Approach of each contact by the force on each other (n, n) [m/N]."""
        same = self.strip[:, None] == self.strip
        return np.where(same, self.law.slope(self.force)[self.strip], 0.0)

    def linearise(self) -> tuple[Array, Array]:
        """Linear law for a drive that is linearised once, to superpose tooth errors.

        A strip under force keeps its tangent. A strip without force may come to carry
        about as much as the others, so it gets the secant up to their mean force.

        Returns:
            The compliance (n, n) [m/N] and the approach without force (n,) [m].
        """
        law, force = self.law, self.force
        usual = force[force > 0.0].mean()
        secant = law.approach(usual) / usual
        slope = np.where(force > 0.0, law.slope(force), secant)[self.strip]
        same = self.strip[:, None] == self.strip
        return np.where(same, slope, 0.0), self.offset

    @property
    def offset(self) -> Array:
        """Approach of each contact as if linear in the force, at zero (n,) [m]."""
        law, force = self.law, self.force
        return (law.approach(force) - law.slope(force) * force)[self.strip]

    def error(self, force: Array) -> float:
        """Largest error of the linear law under forces of the contacts [m]."""
        found, law = self.sums(force), self.law
        linear = law.approach(self.force) + law.slope(self.force) * (found - self.force)
        wrong = linear - law.approach(np.maximum(found, 0.0))
        return float(np.abs(wrong).max(initial=0.0))


def strain_energy(law: Indentation, contacts: Contacts | None, force: Array) -> float:
    """Energy of the strips under the forces of their contacts [J]."""
    if contacts is None or not len(contacts):
        return 0.0
    strips = Strips.from_contacts(law, contacts, None, force)
    return float(law.energy(strips.sums(force)).sum())


def _keys(contacts: Contacts) -> Index:
    """Sector, side and tooth (n, 3)."""
    return np.stack([contacts.sector, contacts.side, contacts.tooth], axis=-1)

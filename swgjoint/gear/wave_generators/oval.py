"""An outline with a roundness error."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.wave_generators.curve import ClosedCurve
from swgjoint.typing import Array


@dataclass(frozen=True, kw_only=True)
class Oval(ClosedCurve):
    r"""An outline moved along its normal by :math:`\delta = \frac o2\cos 2(\varphi-a)`.

    The polar angle phi of a point on the nominal outline is counted counter-clockwise
    from +y. The deviation delta is of the order of micrometres, so terms in its square
    are neglected.
    """

    nominal: ClosedCurve
    """Outline without the error."""
    ovality: float
    """Ovality o, largest minus smallest deviation [m]."""
    angle: float
    """Polar angle a of the largest deviation [rad]."""

    @property
    def major(self) -> float:  # type: ignore[override]
        """Radius on the +y axis [m]."""
        return self.nominal.major + 0.5 * self.ovality * float(np.cos(2 * self.angle))

    @property
    def perimeter(self) -> float:
        """Perimeter of the nominal outline, which defines the arc length [m]."""
        return self.nominal.perimeter

    @property
    def folds(self) -> int:
        """Order of rotational symmetry, at most two."""
        return gcd(self.nominal.folds, 2)

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures at arc lengths of the nominal outline."""
        points, normals, curvature = self.nominal.evaluate(s)
        delta, slope, bend = self._deviation(points, normals)
        tilted, curvature = _moved(normals, curvature, delta, slope, bend)
        return points + delta[:, None] * normals, tilted, curvature

    def outlines(self, count: int) -> list[Array]:
        """Outlines of the nominal wave generator, without the deviation [m].

        The deviation would be too small to be visible.
        """
        return self.nominal.outlines(count)

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance, normal and curvature; see :class:`ClosedCurve`.

        The distance is that to the nominal outline minus the deviation at the foot. The
        normal is the gradient of this distance, so that the work of contact forces is
        consistent with the change of the distance.
        """
        distance, normals, curvature = self.nominal.signed_distance(points)
        foot = points - distance[:, None] * normals
        delta, slope, bend = self._deviation(foot, normals)
        reach = 1.0 + curvature * distance
        tilted, curvature = _moved(normals, curvature, delta, slope / reach, bend)
        return distance - delta, tilted, curvature

    def _deviation(self, foot: Array, normals: Array) -> tuple[Array, Array, Array]:
        """Deviation [m] and its first [-] and second derivative [1/m] along the arc."""
        square = np.einsum("ni,ni->n", foot, foot)
        phase = 2.0 * (np.arctan2(-foot[:, 0], foot[:, 1]) - self.angle)
        # d phi/ds: component of the tangent J n perpendicular to the radius
        per_length = np.einsum("ni,ni->n", foot, normals) / square
        half = 0.5 * self.ovality
        return (
            half * np.cos(phase),
            -2.0 * half * np.sin(phase) * per_length,
            -4.0 * half * np.cos(phase) * per_length**2,
        )


def _moved(
    normals: Array, curvature: Array, delta: Array, slope: Array, bend: Array
) -> tuple[Array, Array]:
    """Normals and curvatures [1/m] of the outline after moving it by the deviation."""
    tangents = np.stack([-normals[:, 1], normals[:, 0]], axis=-1)
    tilted = normals - slope[:, None] * tangents
    tilted /= np.hypot(tilted[:, 0], tilted[:, 1])[:, None]
    return tilted, curvature - curvature**2 * delta - bend

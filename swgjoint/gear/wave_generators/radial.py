"""Outlines defined by their radius as a function of the angle from the major axis."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.gear.wave_generators.curve import ClosedCurve, Kind
from swgjoint.kernels import kernels
from swgjoint.typing import Array

_PANELS = 720  # quadrature panels per turn
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


class Radial(ClosedCurve):
    """Outline whose radius is a twice differentiable function of the polar angle phi.

    The angle phi is counted counter-clockwise from +y.
    """

    @abstractmethod
    def radius(self, phi: Array, derivative: int = 0) -> Array:
        """Radius [m], or its derivative of order n with respect to phi [m/rad^n].

        Args:
            phi: Polar angles, counter-clockwise from +y [rad].
            derivative: Order n of the derivative, 0 to 2.
        """

    def _breaks(self) -> Array:
        """Angles within one turn between which the radius is smooth [rad]."""
        return np.array([0.0, 2.0 * np.pi])

    @cached_property
    def _panels(self) -> tuple[Array, Array]:
        """Ends of the quadrature panels: polar angles [rad] and arc lengths [m]."""
        turn = np.linspace(0.0, 2.0 * np.pi, _PANELS + 1)
        ends = np.unique(np.concatenate([turn, self._breaks()]))
        lengths = self._length(ends[:-1], ends[1:])
        return ends, np.concatenate([[0.0], np.cumsum(lengths)])

    def _length(self, start: Array, end: Array) -> Array:
        """Arc length of panels by Gauss-Legendre quadrature [m]."""
        half = 0.5 * (end - start)
        phi = 0.5 * (start + end)[..., None] + half[..., None] * _NODES
        speed = np.hypot(self.radius(phi), self.radius(phi, 1))
        return np.asarray(half * (speed @ _WEIGHTS))

    @property
    def perimeter(self) -> float:
        """Length of the outline [m]."""
        return float(self._panels[1][-1])

    def evaluate_at(self, phi: Array) -> tuple[Array, Array, Array]:
        """Points (n, 2) [m], outward unit normals (n, 2) and curvatures (n,) [1/m].

        Args:
            phi: Polar angles, counter-clockwise from +y (n,) [rad].
        """
        r, dr, ddr = (self.radius(phi, k) for k in range(3))
        radial = np.stack([-np.sin(phi), np.cos(phi)], axis=-1)
        across = np.stack([-np.cos(phi), -np.sin(phi)], axis=-1)
        speed = np.hypot(r, dr)
        normals = (r[..., None] * radial - dr[..., None] * across) / speed[..., None]
        curvature = (r * r + 2.0 * dr * dr - r * ddr) / speed**3
        return r[..., None] * radial, normals, curvature

    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures; see :meth:`ClosedCurve.evaluate`.

        Newton's method inverts the arc length within a quadrature panel.
        """
        ends, lengths = self._panels
        along = self._within(s)
        panel = np.clip(np.searchsorted(lengths, along, "right") - 1, 0, len(ends) - 2)
        start, wanted = ends[panel], along - lengths[panel]
        share = wanted / (lengths[panel + 1] - lengths[panel])
        phi = start + share * (ends[panel + 1] - start)
        for _ in range(20):
            speed = np.hypot(self.radius(phi), self.radius(phi, 1))
            step = (self._length(start, phi) - wanted) / speed
            phi = phi - step
            if np.max(np.abs(step), initial=0.0) < 1e-15:
                break
        return self.evaluate_at(phi)

    @cached_property
    def _nearest(self) -> tuple[Array, Any]:
        """Polar angles of sampled outline points [rad] and a search tree of these."""
        from scipy.spatial import cKDTree

        phi = np.linspace(0.0, 2.0 * np.pi, 4 * _PANELS, endpoint=False)
        return phi, cKDTree(self.evaluate_at(phi)[0])

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance, normal and curvature; see :class:`ClosedCurve`.

        Newton's method solves for the polar angle of the foot. It starts at the nearest
        of many sampled outline points, and its steps are limited to four sample
        spacings. Far inside the outline, where the distance is not a convex function of
        the angle, the second derivative is kept positive.
        """
        if (native := kernels()) is not None:
            found = np.empty((len(points), 4))
            native.outline_distance(np.ascontiguousarray(points), self.rows, found)
            return found[:, 0], found[:, 1:3], found[:, 3]
        start, tree = self._nearest
        phi = start[tree.query(points)[1]]
        limit = 4.0 * (start[1] - start[0])
        for _ in range(50):
            foot, normal, curvature = self.evaluate_at(phi)
            rel = points - foot
            speed = np.hypot(self.radius(phi), self.radius(phi, 1))
            along = rel[:, 1] * normal[:, 0] - rel[:, 0] * normal[:, 1]
            distance = np.sum(rel * normal, axis=-1)
            bend = np.maximum(1.0 + curvature * distance, 0.1)
            step = np.clip(along / (bend * speed), -limit, limit)
            phi = phi + step
            if np.max(np.abs(step), initial=0.0) < 1e-15:
                break
        foot, normal, curvature = self.evaluate_at(phi)
        return np.sum((points - foot) * normal, axis=-1), normal, curvature

    def least_curvature(self) -> float:
        """Smallest curvature of sampled outline points, negative if concave [1/m]."""
        phi = np.concatenate([self._nearest[0], self._breaks()])
        return float(self.evaluate_at(phi)[2].min())


@dataclass(frozen=True, kw_only=True, eq=False)
class Cosine(Radial):
    """Outline with the radius (a + b)/2 + (a - b)/2 cos(lobes phi)."""

    major: float
    """Largest radius a [m]."""
    minor: float
    """Smallest radius b [m]."""
    lobes: int = 2
    """Number of lobes."""

    @property
    def folds(self) -> int:
        """Order of rotational symmetry, equal to the number of lobes."""
        return self.lobes

    @cached_property
    def rows(self) -> Array:
        """Description for compiled loops; see :attr:`ClosedCurve.rows`."""
        return np.array(
            [[Kind.COSINE, self.major, self.minor, self.lobes, 0.0, 0.0, 0.0]]
        )

    def radius(self, phi: Array, derivative: int = 0) -> Array:
        """Radius [m] or its derivative of order n [m/rad^n].

        Args:
            phi: Polar angles, counter-clockwise from +y [rad].
            derivative: Order n of the derivative, 0 to 2.
        """
        mean, swing = 0.5 * (self.major + self.minor), 0.5 * (self.major - self.minor)
        n, angle = self.lobes, self.lobes * phi
        if derivative == 0:
            return np.asarray(mean + swing * np.cos(angle))
        if derivative == 1:
            return np.asarray(-n * swing * np.sin(angle))
        return np.asarray(-n * n * swing * np.cos(angle))


class TableOutline(Radial):
    """Periodic cubic spline, twice continuously differentiable, through a table."""

    def __init__(self, angle: Sequence[float], radius: Sequence[float]) -> None:
        """Fit the spline.

        Args:
            angle: Polar angles, increasing within one turn [rad].
            radius: Radius at each angle [m].
        """
        from scipy.interpolate import CubicSpline

        first = float(angle[0])
        knots = np.append(angle, first + 2.0 * np.pi)
        values = np.append(radius, radius[0])
        self._first = first
        self._knots = knots
        self._spline = CubicSpline(knots, values, bc_type="periodic")
        stationary = self._spline.derivative().roots(extrapolate=False)
        inside = np.concatenate([knots, stationary[np.isfinite(stationary)]])
        self.major = float(self._spline(inside).max())
        """Largest radius [m]."""

    def _breaks(self) -> Array:
        return np.unique(np.mod(self._knots, 2.0 * np.pi))

    @cached_property
    def rows(self) -> Array:
        """Description for compiled loops; see :attr:`ClosedCurve.rows`."""
        starts = self._knots[:-1]
        kind, rest = np.full_like(starts, Kind.SPLINE), np.zeros_like(starts)
        rows = np.column_stack([kind, starts, self._spline.c.T, rest])
        return np.ascontiguousarray(rows)

    @cached_property
    def folds(self) -> int:
        """Order of rotational symmetry, at most 6.

        Two radii are considered equal if they differ by at most 1e-12 of the largest
        radius.
        """
        phi = np.linspace(0.0, 2.0 * np.pi, 997)
        here = self.radius(phi)
        for n in range(6, 1, -1):
            turned = self.radius(phi + 2.0 * np.pi / n)
            if np.abs(turned - here).max() <= 1e-12 * self.major:
                return n
        return 1

    def radius(self, phi: Array, derivative: int = 0) -> Array:
        """Radius [m] or its derivative of order n [m/rad^n].

        Args:
            phi: Polar angles, counter-clockwise from +y [rad].
            derivative: Order n of the derivative, 0 to 2.
        """
        inside = self._first + np.mod(phi - self._first, 2.0 * np.pi)
        return np.asarray(self._spline(inside, derivative))

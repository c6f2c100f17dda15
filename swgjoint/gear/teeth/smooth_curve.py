"""Smooth curves as pieces of a flank, for generated and conjugate profiles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swgjoint.arrays import frozen_array
from swgjoint.gear.teeth.segments import Bools, Point
from swgjoint.typing import Array

NODES = 33
"""Default number of nodes; involutes and fillets then have errors below 1e-13 m."""
CLOSEST = 1e-6
"""Smallest distance between nodes [m]. Round-off would affect the tangents of closer
nodes too much."""
DENSE = 1025
"""Default number of points from which equally spaced nodes are determined."""
STEPS = 8
"""Largest number of Newton steps to a foot; four are usually sufficient."""

# nodes and weights of Gauss-Legendre quadrature on [0, 1]
_GAUSS = np.polynomial.legendre.leggauss(6)
_GAUSS_X, _GAUSS_W = 0.5 * (_GAUSS[0] + 1.0), 0.5 * _GAUSS[1]


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothCurve:
    """Quintic curve over the arc length with exact values at its nodes.

    At the nodes, points, normals and curvatures are exact. The curve is twice
    continuously differentiable, as the Newton iterations of contact require.
    """

    name: str
    """Name within the chain."""
    stations: Array
    """Arc length at the nodes, starting at zero (n,) [m]."""
    coefficients: Array
    """Coefficients of the polynomial in each interval, from the constant upwards
    (n - 1, 6, 2) [m]. The variable is the arc length from the start of the interval,
    divided by the length of the interval."""
    edge: bool = False
    """Whether the curve starts at an edge instead of a tangent junction."""

    def __post_init__(self) -> None:
        for key in ("stations", "coefficients"):
            object.__setattr__(self, key, frozen_array(getattr(self, key), key))

    @property
    def radius(self) -> float:
        """Zero, because a smooth curve has no single radius [m]."""
        return 0.0

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self.stations[-1])

    @property
    def start(self) -> Point:
        """First point [m]."""
        x, y = self.coefficients[0, 0]
        return float(x), float(y)

    @property
    def end(self) -> Point:
        """Last point [m]."""
        x, y = self.coefficients[-1].sum(axis=0)
        return float(x), float(y)

    def _derivatives(self, s: Array) -> tuple[Array, Array, Array]:
        """Points [m] and their first two derivatives along the arc, each (n, 2)."""
        k = np.searchsorted(self.stations[1:-1], s, side="right")
        h = self._steps[k]
        t = (s - self.stations[k]) / h
        # Horner's scheme with derivatives, in place and with coordinates as rows; the
        # first steps, in which the derivatives are still zero, are omitted
        c = self._rows.take(k, axis=2)
        first = c[5]
        value = first * t + c[4]
        second = 2.0 * first
        first = first * t + value
        value = value * t + c[3]
        for j in (2, 1, 0):
            second *= t
            second += 2.0 * first
            first *= t
            first += value
            value *= t
            value += c[j]
        return value.T, (first / h).T, (second / h**2).T

    def evaluate_at(self, s: Array, side: float) -> tuple[Array, Array, Array]:
        """Points, outward normals and curvatures; see :class:`.segments.Piece`.

        Args:
            s: Arc lengths from the start of the curve (n,) [m].
            side: +1 for an external tooth, -1 for an internal tooth.
        """
        points, tangent, bend = self._derivatives(s)
        size = np.hypot(tangent[:, 0], tangent[:, 1])
        normal = side * np.stack([-tangent[:, 1], tangent[:, 0]], -1) / size[:, None]
        return points, normal, -np.sum(bend * normal, axis=-1) / size**2

    @cached_property
    def _steps(self) -> Array:
        return np.diff(self.stations)

    @cached_property
    def _rows(self) -> Array:
        """Coefficients by power and coordinate (6, 2, n - 1)."""
        return np.ascontiguousarray(self.coefficients.transpose(1, 2, 0))

    @cached_property
    def _coarse(self) -> tuple[Array, Array]:
        """Arc lengths [m] and points [m] of every fourth node and the last one.

        The search for a foot starts at one of them.
        """
        index = np.unique(np.append(np.arange(0, len(self.stations), 4), -1))
        s = self.stations[index % len(self.stations)]
        return np.sort(s), self._derivatives(np.sort(s))[0]

    def project(self, points: Array, side: float) -> tuple[Array, Array, Array, Bools]:
        """Distances of points from the curve along its normal.

        Newton's method finds the foot of each perpendicular, starting at the nearest
        coarse node.

        Args:
            points: Points of shape (n, 2) [m].
            side: +1 for an external tooth, -1 for an internal tooth.

        Returns:
            See :meth:`.segments.Piece.project`.
        """
        coarse_s, coarse = self._coarse
        # squared distances without the term that is the same for all nodes
        near = np.sum(coarse**2, axis=-1) - 2.0 * points @ coarse.T
        s = coarse_s[np.argmin(near, axis=1)]
        moving = np.arange(len(s))
        for _ in range(STEPS):
            foot, tangent, bend = self._derivatives(s[moving])
            rel = foot - points[moving]
            slope = rel[:, 0] * tangent[:, 0] + rel[:, 1] * tangent[:, 1]
            # beyond the centre of curvature, the distance has no minimum
            gain = 1.0 + rel[:, 0] * bend[:, 0] + rel[:, 1] * bend[:, 1]
            old = s[moving]
            new = np.clip(old - slope / np.maximum(gain, 0.2), 0.0, self.length)
            s[moving] = new
            # after a step of a nanometre, the next one is below round-off
            moving = moving[np.abs(new - old) > 1e-9]
            if not moving.size:
                break
        foot, normal, curvature = self.evaluate_at(s, side)
        rel = points - foot
        distance = np.sum(rel * normal, axis=-1)
        # beyond the ends, the remaining vector has a tangential component
        tangent = side * np.stack([normal[:, 1], -normal[:, 0]], axis=-1)
        along = np.abs(np.sum(rel * tangent, axis=-1))
        inside = along <= 1e-9 * self.length
        return distance, normal, curvature, inside


def smooth_curve(
    name: str,
    trace: Callable[[Array], tuple[Array, Array]],
    first: float,
    last: float,
    side: float,
    *,
    nodes: int = NODES,
    dense: int = DENSE,
    edge: bool = False,
) -> SmoothCurve:
    """Curve through points and outward normals as functions of a smooth parameter.

    Args:
        name: Name of the piece.
        trace: Points (n, 2) [m] and outward unit normals (n, 2) at parameters (n,).
        first: Parameter at the tip end.
        last: Parameter at the root end.
        side: +1 for an external tooth, -1 for an internal tooth.
        nodes: Largest number of nodes, equally spaced along the curve.
        dense: Number of points from which the positions of the nodes are determined.
        edge: Whether the curve starts at an edge instead of a tangent junction.
    """
    from scipy.interpolate import make_interp_spline

    # nodes at equal arc lengths, independently of the parameter
    steps = np.linspace(first, last, dense)
    chord = np.hypot(*np.diff(trace(steps)[0], axis=0).T)
    walked = np.concatenate([[0.0], np.cumsum(chord)])
    nodes = max(9, min(nodes, int(walked[-1] / CLOSEST)))
    share = np.linspace(0.0, walked[-1], nodes)
    points, normals = trace(np.interp(share, walked, steps))
    # arc length by quadrature of the speed of a quintic spline over the chord length
    chord = np.hypot(*np.diff(points, axis=0).T)
    u = np.concatenate([[0.0], np.cumsum(chord)])
    spline = make_interp_spline(u, points, k=5)
    inner = (u[:-1, None] + chord[:, None] * _GAUSS_X).ravel()
    speed = np.linalg.norm(spline(inner, 1), axis=-1).reshape(-1, _GAUSS_X.size)
    stations = np.concatenate([[0.0], np.cumsum(speed @ _GAUSS_W * chord)])
    # along the arc, the normal rotates by -side times the curvature
    turn = np.unwrap(np.arctan2(normals[:, 1], normals[:, 0]))
    rate = make_interp_spline(u, turn, k=5)(u, 1)
    curvature = -side * rate / np.linalg.norm(spline(u, 1), axis=-1)
    return from_nodes(name, stations, points, normals, curvature, side, edge=edge)


def from_nodes(
    name: str,
    stations: Array,
    points: Array,
    normals: Array,
    curvature: Array,
    side: float,
    *,
    edge: bool = False,
) -> SmoothCurve:
    """Quintic Hermite curve through points, outward normals and curvatures.

    Args:
        name: Name of the piece.
        stations: Arc length at the nodes, starting at zero (n,) [m].
        points: Nodes (n, 2) [m].
        normals: Outward unit normals at the nodes (n, 2).
        curvature: Curvatures at the nodes, positive where the steel is convex (n,)
            [1/m].
        side: +1 for an external tooth, -1 for an internal tooth.
        edge: Whether the curve starts at an edge instead of a tangent junction.
    """
    h = np.diff(stations)[:, None]
    tangent = side * np.stack([normals[:, 1], -normals[:, 0]], axis=-1)
    bend = -curvature[:, None] * normals
    p0, p1 = points[:-1], points[1:]
    d0, d1 = tangent[:-1] * h, tangent[1:] * h
    b0, b1 = 0.5 * bend[:-1] * h**2, 0.5 * bend[1:] * h**2
    a = p1 - p0 - d0 - b0
    b = d1 - d0 - 2.0 * b0
    c = 2.0 * (b1 - b0)
    coefficients = np.stack(
        [
            p0,
            d0,
            b0,
            10.0 * a - 4.0 * b + 0.5 * c,
            -15.0 * a + 7.0 * b - c,
            6.0 * a - 3.0 * b + 0.5 * c,
        ],
        axis=1,
    )
    return SmoothCurve(
        name=name, stations=stations, coefficients=coefficients, edge=edge
    )

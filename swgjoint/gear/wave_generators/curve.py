"""Interface of wave-generator outlines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.typing import Array


class Kind(IntEnum):
    """Kinds of rows that describe an outline to compiled loops, see chain.h."""

    ELLIPSE = 0
    SIMPLIFIED = 1
    ARC = 2
    LINE = 3
    PARABOLA = 4
    COSINE = 5
    SPLINE = 6


class ClosedCurve(ABC):
    """Closed convex outline around the axis of rotation, with the major axis along +y.

    The arc length is counted counter-clockwise from the point on the +y axis.
    """

    major: float
    """Largest radius [m]."""

    @property
    @abstractmethod
    def perimeter(self) -> float:
        """Length of the closed outline [m]."""

    @property
    def folds(self) -> int:
        """Order n of rotational symmetry: a turn by 2 pi/n leaves the outline as is."""
        return 2

    @property
    def rows(self) -> Array | None:
        """Description for compiled loops (n, 7); None if they cannot evaluate it.

        A row starts with its :class:`Kind` and continues with lengths [m], curvatures
        [1/m] and angles [rad]: semi-axes a and b of an ellipse, semi-major axis and
        radius of the simplified outline, the fields of a piece of a chain, largest and
        smallest radius and number of lobes of a cosine, or the first angle of an
        interval of a spline and its coefficients, cubic first. The rest of the row is
        zero.
        """
        return None

    @abstractmethod
    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Points, normals and curvatures of the outline at given arc lengths.

        Args:
            s: Arc lengths (n,) [m], counter-clockwise from +y and over any number of
                turns.

        Returns:
            Points (n, 2) [m]; outward unit normals (n, 2); curvatures (n,) [1/m],
            positive where the outline is convex.
        """

    @abstractmethod
    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distance of points from the outline, with normal and curvature.

        Args:
            points: Points of shape (n, 2) [m].

        Returns:
            Distances (n,) [m], positive outside; outward unit normals (n, 2) and
            curvatures (n,) [1/m] of the outline at the nearest point, positive where
            the outline is convex.
        """

    def _within(self, s: ArrayLike) -> Array:
        """Arc lengths reduced to the first turn [m]."""
        return np.asarray(np.mod(np.asarray(s, dtype=float), self.perimeter))

    def outline(self, count: int) -> Array:
        """Points of the outline at equal steps of arc length (count, 2) [m].

        The last point repeats the first.
        """
        return self.evaluate(np.linspace(0.0, self.perimeter, count))[0]

    def outlines(self, count: int) -> list[Array]:
        """Closed curves for drawing or cutting, each of shape (count, 2) [m]."""
        return [self.outline(count)]

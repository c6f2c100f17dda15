"""What every outline of a wave generator offers."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.typing import Array


class ClosedCurve(ABC):
    """Closed convex outline about the axis, major axis along +y, SI.

    Arc length runs counter-clockwise from the point on the +y axis.
    """

    major: float
    """Largest radius [m]."""

    @property
    @abstractmethod
    def perimeter(self) -> float:
        """Length of the closed outline [m]."""

    @property
    def folds(self) -> int:
        """Turns by 2 pi/folds map the outline onto itself."""
        return 2

    @abstractmethod
    def evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        """Outline at arc length s from +y, counter-clockwise, any s (periodic) [m].

        Returns:
            Points (n, 2) [m]; outward unit normals (n, 2); curvatures (n,) [1/m],
            positive where the outline is convex.
        """

    @abstractmethod
    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Distance, outward unit normal and outline curvature.

        Args:
            points: Shape (n, 2) [m].

        Returns:
            Distances (n,) [m], positive outside; normals (n, 2); curvatures of the
            outline at the foot (n,) [1/m], positive for a convex outline.
        """

    def _within(self, s: ArrayLike) -> Array:
        """The same arc length within the first turn."""
        return np.asarray(np.mod(np.asarray(s, dtype=float), self.perimeter))

    def outline(self, count: int) -> Array:
        """Closed outline at equal steps of arc length. Shape (count, 2) [m]."""
        return self.evaluate(np.linspace(0.0, self.perimeter, count))[0]

    def outlines(self, count: int) -> list[Array]:
        """Closed curves to draw or to cut, ``count`` points each."""
        return [self.outline(count)]

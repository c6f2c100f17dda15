"""State of the hysteresis elements of a drive and their torque after a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.kernels import kernels
from swgjoint.maps.hysteresis import Jenkin, vary_with_load
from swgjoint.typing import Array, Index


@dataclass(frozen=True, kw_only=True, eq=False)
class Sliders:
    """Parameters and state of the Jenkin elements of a drive; immutable.

    The elastic torque of the drive, an argument of the methods, affects only elements
    whose yield torque depends on the load.
    """

    stiffness: Array
    """Stiffness k [N·m/rad]. Shape (n,)."""
    reach: Array
    """Yield torsion f/k without load [rad]. Shape (n,)."""
    rest: Array
    """Torsion r at which each element is currently relaxed [rad]. Shape (n,)."""
    elements: tuple[Jenkin, ...] = ()
    """The elements, if their yield torques depend on the load; otherwise empty."""

    @classmethod
    def relax(cls, elements: Sequence[Jenkin], torsion: float = 0.0) -> Sliders:
        """State in which all elements are relaxed at a torsion.

        Args:
            elements: Jenkin elements of the drive.
            torsion: Torsion at which they carry no torque [rad].
        """
        return cls(
            stiffness=np.array([e.stiffness for e in elements], dtype=float),
            reach=np.array([e.yield_torsion for e in elements], dtype=float),
            rest=np.full(len(elements), torsion, dtype=float),
            elements=tuple(elements) if vary_with_load(elements) else (),
        )

    def move_to(self, torsion: float, elastic: float = 0.0) -> Sliders:
        """State after a monotone path to a torsion.

        Args:
            torsion: Torsion at the end [rad].
            elastic: Elastic torque there [N·m].
        """
        reach, _ = self._yield(elastic)
        rest = np.clip(self.rest, torsion - reach, torsion + reach)
        return replace(self, rest=rest)

    def torque(self, torsion: ArrayLike, elastic: ArrayLike = 0.0) -> Array:
        """Total torque after a monotone path to each torsion [N·m].

        Args:
            torsion: Torsions, each reached along a monotone path [rad].
            elastic: Elastic torque T at each of them [N·m].
        """
        stretch, _, _ = self._stretch(torsion, elastic)
        return np.asarray(stretch @ self.stiffness)

    def tangent(
        self,
        torsion: ArrayLike,
        elastic: ArrayLike = 0.0,
        stiffness: ArrayLike = 0.0,
    ) -> Array:
        """Derivative of the total torque by the torsion [N·m/rad].

        Args:
            torsion: Torsion, reached along a monotone path [rad].
            elastic: Elastic torque T there [N·m].
            stiffness: Stiffness dT/dx there [N·m/rad].
        """
        return self.torque_and_tangent(torsion, elastic, stiffness)[1]

    def torque_and_tangent(
        self, torsion: ArrayLike, elastic: ArrayLike, stiffness: ArrayLike
    ) -> tuple[Array, Array]:
        """Results of :meth:`torque` and :meth:`tangent`.

        Args:
            torsion: Torsions, each reached along a monotone path [rad].
            elastic: Elastic torque T at each of them [N·m].
            stiffness: Stiffness dT/dx there [N·m/rad].
        """
        stretch, reach, slopes = self._stretch(torsion, elastic)
        torque = np.asarray(stretch @ self.stiffness)
        sticks = np.abs(stretch) < reach
        total = np.asarray(sticks @ self.stiffness)
        if slopes is None:
            return torque, total
        # a slipping element follows its yield torque
        follows = np.sum(np.where(sticks, 0.0, np.sign(stretch)) * slopes, axis=-1)
        rate = np.sign(elastic) * np.asarray(stiffness)
        return torque, np.asarray(total + follows * rate)

    def energy(self, torsion: ArrayLike, elastic: ArrayLike = 0.0) -> Array:
        """Strain energy of the springs after a monotone path to each torsion [J].

        Args:
            torsion: Torsions, each reached along a monotone path [rad].
            elastic: Elastic torque T at each of them [N·m].
        """
        stretch, _, _ = self._stretch(torsion, elastic)
        return np.asarray(0.5 * stretch**2 @ self.stiffness)

    def _stretch(
        self, torsion: ArrayLike, elastic: ArrayLike
    ) -> tuple[Array, Array, Array | None]:
        """Stretch of each element after a monotone path, and the result of _yield."""
        reach, slopes = self._yield(elastic)
        x = np.asarray(torsion, float)[..., None]
        return np.clip(x - self.rest, -reach, reach), reach, slopes

    def _yield(self, elastic: ArrayLike) -> tuple[Array, Array | None]:
        """Yield torsion and slope of the yield torque of each element (..., n).

        The slope is None, and the yield torsion has the shape (n,), if no yield torque
        depends on the load.
        """
        if not self.elements:
            return self.reach, None
        if (native := kernels()) is not None:
            load = np.ascontiguousarray(elastic, dtype=float)
            reach, slopes = np.empty((2, load.size, len(self.elements)))
            native.yield_torsions(
                *self._curves, self.stiffness, load.reshape(-1), reach, slopes
            )
            shape = (*np.shape(elastic), -1)
            return reach.reshape(shape), slopes.reshape(shape)
        return (
            np.stack([element.reach(elastic) for element in self.elements], -1),
            np.stack([element.yield_slopes(elastic) for element in self.elements], -1),
        )

    @cached_property
    def _curves(self) -> tuple[Index, Array, Array]:
        """First point of each element, and elastic and yield torque of all points."""
        curves = [((0.0, e.yield_torque), *e.yield_curve) for e in self.elements]
        first = np.cumsum([0, *map(len, curves)], dtype=np.int64)
        at, yields = np.array([point for curve in curves for point in curve]).T.copy()
        return first, at, yields

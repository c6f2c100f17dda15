r"""Hysteresis of a drive: parallel Jenkin (Maxwell-slip) elements along the torsion.

An element is a spring k in series with a slider that yields at a torque f. With r the
torsion at which its spring is relaxed,

.. math:: q = k (\Delta - r), \qquad r \in [\Delta - f/k, \Delta + f/k],

and r changes only when an end of that interval moves past it. In increments:
:math:`q \leftarrow \mathrm{clip}(q + k\,d\Delta, \pm f)`. After a monotone path, r
depends only on the initial r and the final torsion.

The element is passive: the work :math:`q\,d\Delta` is the change of :math:`q^2/2k` plus
f times the slip :math:`|dr|`, which is never negative. A steady cycle of amplitude
X > f/k dissipates :math:`4 f (X - f/k)`. In parallel with a spring K the loop is
:math:`2 f/K` wide at zero torque if the torsion between the tip and zero torque exceeds
2 f/k.

Source:
    Iwan (1966), "A distributed-element model for hysteresis and its steady-state
    dynamic response", J. Appl. Mech. 33, 893-900.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError
from swgjoint.typing import Array

MAX_ELEMENTS = 64
"""Largest number of elements, more than a measured loop can distinguish."""


@dataclass(frozen=True, kw_only=True)
class Jenkin:
    """A spring in series with a slider: hysteresis that dissipates."""

    stiffness: float
    """Stiffness while the element sticks [N·m/rad]."""
    yield_torque: float
    """Torque at which the element slips [N·m]."""

    def __post_init__(self) -> None:
        for key, unit in (("stiffness", "N·m/rad"), ("yield_torque", "N·m")):
            value = getattr(self, key)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            # far above the values of any drive; products do not overflow
            if not (number and isfinite(value) and 1e-60 < value < 1e60):
                raise InputError(
                    f"hysteresis {key} {value!s:.40} {unit}; accepted: a finite number"
                    " > 0"
                )

    @property
    def yield_torsion(self) -> float:
        """Torsion from rest to slip, f/k [rad]."""
        return self.yield_torque / self.stiffness


@dataclass(frozen=True, kw_only=True, eq=False)
class Sliders:
    """Parameters and state of the Jenkin elements of a drive; immutable."""

    stiffness: Array
    """Stiffness k [N·m/rad]. Shape (n,)."""
    reach: Array
    """Yield torsion f/k [rad]. Shape (n,)."""
    rest: Array
    """Torsion r at which each element is currently relaxed [rad]. Shape (n,)."""

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
        )

    def move_to(self, torsion: float) -> Sliders:
        """State after a monotone path to a torsion [rad]."""
        rest = np.clip(self.rest, torsion - self.reach, torsion + self.reach)
        return Sliders(stiffness=self.stiffness, reach=self.reach, rest=rest)

    def torque(self, torsion: ArrayLike) -> Array:
        """Total torque after a monotone path to each torsion [N·m]."""
        return np.asarray(self._stretch(torsion) @ self.stiffness)

    def tangent(self, torsion: ArrayLike) -> Array:
        """Total stiffness of the elements that stick at each torsion [N·m/rad]."""
        sticks = np.abs(self._stretch(torsion)) < self.reach
        return np.asarray(sticks @ self.stiffness)

    def energy(self, torsion: ArrayLike) -> Array:
        """Strain energy of the springs after a monotone path to each torsion [J]."""
        return np.asarray(0.5 * self._stretch(torsion) ** 2 @ self.stiffness)

    def _stretch(self, torsion: ArrayLike) -> Array:
        """Stretch of each element after a monotone path to each torsion (..., n)."""
        x = np.asarray(torsion, float)[..., None]
        return np.asarray(np.clip(x - self.rest, -self.reach, self.reach))


def play_hysteresis(elements: Sequence[Jenkin], torsion: Array) -> Array:
    """Total torque of the elements along a torsion history [N·m]. Shape (n,).

    The elements start relaxed at zero torsion, as after a reset of the simulation
    engine.

    Args:
        elements: Jenkin elements of the drive.
        torsion: History of the torsion [rad]. Shape (n,).
    """
    total = np.zeros_like(torsion, dtype=float)
    for element in elements:
        total += element.stiffness * stretches(torsion, element.yield_torsion)
    return total


def stretches(torsion: Array, reach: float) -> Array:
    """Stretch x - r of one element along a torsion history x [rad]. Shape (n,).

    The element starts relaxed at zero torsion.

    Args:
        torsion: History of the torsion [rad]. Shape (n,).
        reach: Stretch at which the slider of the element slips [rad].
    """
    stretch, rest = np.empty(len(torsion)), 0.0
    for k, x in enumerate(np.asarray(torsion, float).tolist()):
        rest = min(max(rest, x - reach), x + reach)
        stretch[k] = x - rest
    return stretch

r"""Friction of a drive in motion: wave-generator bearing, seals and rim bending.

It opposes beta, the rotation of the wave generator relative to the flexspline (theta -
psi with the circular spline fixed, theta with the flexspline fixed). Beta turns the
bearing and bends the rim. The model is an elasto-plastic element (a bristle of
stiffness sigma and damping sigma_1 in series with a slider) and a viscous term. With
the relative speed nu:

.. math::
    F = \sigma z + \sigma_1 \dot z + \eta\,\nu, \quad |z| \le f/\sigma, \quad
    f = f_b + f_c + (f_s - f_c)\,e^{-(\nu/\nu_s)^2} + c\,|T/i|

f_b is the bending friction, f_c the Coulomb and f_s the static friction, nu_s the
Stribeck speed, and c the factor of the friction that grows with the output torque T.
The stretch z of the bristle follows beta up to its reach f/sigma, where the slider
slips.

The LuGre model is not used because its bristle yields slightly at any stretch. It
therefore drifts under a load that oscillates below f_s, and it is passive only for
:math:`\eta \ge \sigma_1 (f_s - f_c)/f_c` at constant load (Barabanov and Ortega 2000).
In the present model the power :math:`F\nu` is the rate of change of
:math:`\sigma z^2/2` plus :math:`\sigma z (\nu - \dot z) + \sigma_1 \dot z \nu +
\eta\nu^2`. No term of this sum is negative, however f >= 0 varies. The slider, of speed
:math:`\nu - \dot z`, moves only in the direction in which the bristle pulls it, also
when a shrinking reach makes it slip. The damping sigma_1 acts only while the bristle
sticks, so that :math:`\dot z = \nu`. The model is therefore unconditionally passive. At
rest below f it is a spring without creep.

Source:
    Dupont, Hayward, Armstrong, Altpeter (2002), "Single state elastoplastic friction
    models", IEEE Trans. Autom. Control 47, 787-792, for the class of models; Canudas de
    Wit et al. (1995), IEEE Trans. Autom. Control 40, 419-425, for the Stribeck curve;
    Barabanov, Ortega (2000), "Necessary and sufficient conditions for passivity of the
    LuGre friction model", IEEE Trans. Autom. Control 45, 830-832.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swgjoint.errors import InputError
from swgjoint.typing import Array

_UNITS = {
    "coulomb": "N·m",
    "static": "N·m",
    "bending": "N·m",
    "viscous": "N·m·s/rad",
    "load": "",
    "stribeck_speed": "rad/s",
    "stiffness": "N·m/rad",
    "damping": "N·m·s/rad",
}
_POSITIVE = ("stribeck_speed", "stiffness")
_ROUND_OFF = 1e-9
_LARGEST = 1e30  # far above the values of any drive; products do not overflow


@dataclass(frozen=True, kw_only=True)
class Friction:
    """Friction that opposes the rotation of the wave generator in the flexspline."""

    stiffness: float
    """Bristle stiffness sigma before slip [N·m/rad], > 0."""
    coulomb: float = 0.0
    """Coulomb friction f_c without load [N·m]."""
    static: float = 0.0
    """Static friction f_s without load [N·m], at least f_c."""
    stribeck_speed: float = 1.0
    """Stribeck speed nu_s, where the excess f_s - f_c has fallen to 1/e [rad/s]."""
    viscous: float = 0.0
    """Viscous friction eta [N·m·s/rad]."""
    load: float = 0.0
    """Load factor c, friction per |T/i| [-]; back-driving is impossible if c >= 1."""
    bending: float = 0.0
    """Bending friction f_b: energy that rim bending dissipates per radian [N·m]."""
    damping: float = 0.0
    """Bristle damping sigma_1 [N·m·s/rad]."""
    source: str = "given"
    """Source of the values, and which of them are assumed."""

    def __post_init__(self) -> None:
        for key, unit in _UNITS.items():
            value = getattr(self, key)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            low = 1e-30 if key in _POSITIVE else 0.0
            if not (number and isfinite(value) and low <= value <= _LARGEST):
                accepted = "> 0" if key in _POSITIVE else ">= 0"
                raise InputError(
                    f"friction {key} {value!s:.40} {unit}; accepted: a finite number"
                    f" {accepted}"
                )
        if self.static < self.coulomb:
            raise InputError(
                f"friction static {self.static:g} N·m; accepted: at least coulomb"
                f" {self.coulomb:g} N·m"
            )

    def yield_torque(self, speed: ArrayLike, input_torque: ArrayLike) -> Array:
        """Friction torque f at which the bristle slips [N·m].

        Args:
            speed: Relative speed nu [rad/s].
            input_torque: Elastic torque on the input, T/i [N·m].
        """
        x = np.asarray(speed, float) / self.stribeck_speed
        more = (self.static - self.coulomb) * np.exp(-(x**2))
        return np.asarray(
            self.bending + self.coulomb + more + self.load * np.abs(input_torque)
        )

    def torque(
        self,
        rotation: float,
        speed: float,
        input_torque: float,
        *,
        slipped: bool = False,
    ) -> float:
        """Friction torque F after a monotone rotation from the relaxed bristle [N·m].

        Args:
            rotation: Rotation beta from the position of the relaxed bristle [rad].
            speed: Relative speed nu [rad/s].
            input_torque: Elastic torque on the input, T/i [N·m].
            slipped: Whether the bristle slipped in the time step that led here. It then
                slips on while it moves the same way, even if its yield torque has grown
                since the middle of the step.
        """
        reach = float(self.yield_torque(speed, input_torque)) / self.stiffness
        stretch = min(max(rotation, -reach), reach)
        # at its reach the bristle slips, even if round-off leaves it just inside
        slips = slipped or abs(rotation) >= (1.0 - _ROUND_OFF) * reach
        creep = 0.0 if slips and rotation * speed > 0.0 else self.damping * speed
        return self.stiffness * stretch + creep + self.viscous * speed

    def steady(self, speed: float, input_torque: float) -> float:
        """Friction torque F at a constant speed nu that is not zero [N·m].

        Args:
            speed: Relative speed nu [rad/s].
            input_torque: Elastic torque on the input, T/i [N·m].
        """
        slip = float(self.yield_torque(speed, input_torque))
        return float(np.copysign(slip, speed)) + self.viscous * speed


class FrictionCourse:
    """Friction whose parameters change along a history, as the temperature does."""

    def __init__(self, laws: Sequence[Friction], index: NDArray[np.intp]) -> None:
        """Take the parameters of every sample from one of the laws.

        Args:
            laws: Friction laws.
            index: Law of each sample. Shape (n,).
        """

        def course(key: str) -> Array:
            return np.array([float(getattr(law, key)) for law in laws])[index]

        self.stiffness, self.damping = course("stiffness"), course("damping")
        self.viscous, self._load = course("viscous"), course("load")
        self._coulomb, self._static = course("coulomb"), course("static")
        self._bending, self._stribeck = course("bending"), course("stribeck_speed")

    def yield_torque(self, speed: ArrayLike, input_torque: ArrayLike) -> Array:
        """Torque at which the bristle slips, see :meth:`Friction.yield_torque` [N·m].

        Args:
            speed: Relative speed nu [rad/s]. Shape (n,).
            input_torque: Elastic torque on the input, T/i [N·m]. Shape (n,).
        """
        x = np.asarray(speed, float) / self._stribeck
        more = (self._static - self._coulomb) * np.exp(-(x**2))
        return np.asarray(
            self._bending + self._coulomb + more + self._load * np.abs(input_torque)
        )


def continue_friction(
    friction: Friction | FrictionCourse,
    rotation: Array,
    speed: Array,
    input_torque: Array,
    rest: float | None = None,
) -> tuple[Array, float]:
    """Friction torque F along a history, and where its bristle was relaxed.

    Args:
        friction: Friction parameters.
        rotation: Relative rotation beta [rad]. Shape (n,).
        speed: Relative speed nu [rad/s]. Shape (n,).
        input_torque: Elastic torque on the input, T/i [N·m]. Shape (n,).
        rest: Rotation at which the bristle is relaxed at the start [rad]; None if that
            is the first one.

    Returns:
        Friction torques [N·m], shape (n,), and the rotation at which the bristle was
        relaxed before the last sample [rad], with which a history may continue there.
    """
    reach = friction.yield_torque(speed, input_torque) / friction.stiffness
    stretch, slips = play_bristle(rotation, reach, rest)
    creep = np.where(slips, 0.0, friction.damping * np.asarray(speed))
    torque = friction.stiffness * stretch + creep + friction.viscous * speed
    return np.asarray(torque), float((rotation - stretch)[-2:][0])


def play_bristle(
    rotation: Array, reach: Array, rest: float | None = None
) -> tuple[Array, NDArray[np.bool_]]:
    """Bristle stretch z along a history [rad] and whether it slips. Shapes (n,).

    Args:
        rotation: Relative rotation beta [rad]. Shape (n,).
        reach: Largest stretch at each sample [rad]. Shape (n,).
        rest: Rotation at which the bristle is relaxed at the start [rad]; None if that
            is the first one.
    """
    stretch, slips = np.empty(len(rotation)), np.zeros(len(rotation), dtype=bool)
    if rest is None:
        rest = float(rotation[0]) if len(rotation) else 0.0
    for k, (x, r) in enumerate(zip(rotation.tolist(), reach.tolist(), strict=True)):
        slips[k] = abs(x - rest) > r
        rest = min(max(rest, x - r), x + r)
        stretch[k] = x - rest
    return stretch, slips

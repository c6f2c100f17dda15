r"""Kinematic error of a turning joint, estimated from its motor encoder.

At constant speed the kinematic error has waves of the orders n of the wave-generator
angle :math:`\alpha`. With complex amplitudes X of the parts
:math:`\mathrm{Re}(X e^{jn\alpha})` at :math:`\omega = n \dot\alpha`, the balances of
rotor and link and the drive, as a spring behind its kinematic error e, give

.. math:: U - (k_p + j\omega k_d - J\omega^2)\,\Theta = T/i + \bar T\,jnE, \quad
    -I \omega^2 \Psi = T, \quad T = K\,(\Theta/i + E - \Psi)

and thus E from the deviation :math:`\Theta` of the motor angle from its reference and
from the added motor torque U; :math:`\bar T` is the mean torque of the drive, which
acts on the motor through the slope of the error. Neither the action nor the phases of
a specimen enter the result. Both signals are decomposed recursively by the
least-mean-square rule, which is a notch filter for every order (Widrow et al. 1975).

Source:
    Widrow et al. (1975), "Adaptive noise cancelling: principles and applications",
    Proc. IEEE 63, 1692-1716.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swgjoint.control.error_compensation import ORDERS
from swgjoint.envs.loop import MotorLoop
from swgjoint.typing import Array

ADAPTATION = 0.3
"""Time constant with which amplitudes follow [s]. It is longer than the period of the
slowest wave, so that a compensation by the estimate is stable although the inertia of
the link is not known exactly."""
FASTEST = 0.2
"""Largest share of an error that one reading corrects; the rule needs less than 2 over
the number of waves [-]."""


class KinematicErrorEstimate:
    """Estimates for the only joint of n episodes."""

    def __init__(
        self,
        count: int,
        *,
        loop: MotorLoop,
        rotor_inertia: float,
        link_inertia: float,
        stiffness: float,
        slopes: tuple[float, float],
        slowest: float,
        period: float,
        delay: float,
    ) -> None:
        """Prepare the estimates.

        Args:
            count: Number of episodes.
            loop: Motor loop.
            rotor_inertia: Inertia of the rotor [kg·m²].
            link_inertia: Nominal inertia of the link [kg·m²].
            stiffness: Nominal stiffness of the drive [N·m/rad].
            slopes: Derivatives of the wave-generator angle by the angles of motor and
                link [-].
            slowest: Smallest steady speed of the link [rad/s]. The balances of slower
                motions are those at this speed.
            period: Control period [s].
            delay: Age of a reading [s].
        """
        self._gains = float(loop.stiffness[0]), float(loop.damping[0])
        self._ratio = ratio = float(loop.ratio[0])
        self._rotor, self._link = rotor_inertia, link_inertia
        self._stiffness, self._period, self._delay = stiffness, period, delay
        self._by_motor = slopes[0]
        self._by_angle = slopes[0] + slopes[1] / ratio
        self._slowest = slowest * abs(self._by_angle * ratio)
        self._share = min(period / ADAPTATION, FASTEST)
        # per signal: mean, then cosine and sine amplitude of every order
        self._weights = np.zeros((2, 1 + 2 * len(ORDERS), count))
        self._parts = np.zeros((2 * len(ORDERS), count))

    def forget(self, rows: NDArray[np.intp]) -> None:
        """Begin again in some episodes."""
        self._weights = self._weights.copy()
        self._weights[:, :, rows] = 0.0
        self._parts = self._parts.copy()
        self._parts[:, rows] = 0.0

    def update(
        self,
        *,
        angle: Array,
        deviation: Array,
        speed: Array,
        load: Array,
        torque: Array,
    ) -> None:
        """Take the readings of one instant. Shapes (n,).

        Args:
            angle: Measured motor angle [rad].
            deviation: Measured motor angle minus its reference [rad].
            speed: Speed of the reference at the link [rad/s].
            load: Torque of the drive in the reference motion [N·m].
            torque: Added motor torque over the last period [N·m].
        """
        alpha = self._by_angle * angle
        rate = self._by_angle * self._ratio * speed
        middle = rate * (self._delay - 0.5 * self._period)
        motor = self._decompose(0, deviation, alpha)
        added = self._decompose(1, torque, alpha + middle)
        now = alpha + rate * self._delay
        sign = np.where(rate < 0.0, -1.0, 1.0)
        least = np.maximum(np.abs(rate), self._slowest) * sign
        (k_p, k_d), parts = self._gains, []
        for order, (a, b), (c, d) in zip(ORDERS, motor, added, strict=True):
            omega = order * least
            square = omega * omega
            # (a - jb): amplitude of the deviation; (c - jd): of the torque
            dynamic, damping = k_p - self._rotor * square, omega * k_d
            compliance = 1.0 / self._stiffness - 1.0 / (self._link * square)
            compliance = self._ratio * compliance
            x = compliance * (c - (dynamic * a + damping * b)) - a / self._ratio
            y = compliance * (-d - (damping * a - dynamic * b)) + b / self._ratio
            # divide by 1 + jz, for the torque through the slope of the error
            z = compliance * load * (order * self._by_motor)
            size = 1.0 + z * z
            real, imaginary = (x + z * y) / size, (y - z * x) / size
            cos, sin = np.cos(order * now), np.sin(order * now)
            value = real * cos - imaginary * sin
            slope = -omega * (real * sin + imaginary * cos)
            parts += [value, slope]
        self._parts = np.stack(parts)

    def columns(self) -> list[Array]:
        """Estimate [rad] and its rate [rad/s] for each order. Shapes (n, 1)."""
        return [one[:, None] for one in self._parts]

    def _decompose(
        self, signal: int, value: Array, phase: Array
    ) -> list[tuple[Array, Array]]:
        """Cosine and sine amplitude of every order of a signal. Shapes (n,)."""
        waves = [np.ones_like(phase)]
        for order in ORDERS:
            waves += [np.cos(order * phase), np.sin(order * phase)]
        weights, missing = self._weights[signal], value
        for weight, wave in zip(weights, waves, strict=True):
            missing = missing - weight * wave
        for k, wave in enumerate(waves):
            # the mean square of a sine is half that of the constant
            weights[k] += self._share * (2.0 if k else 1.0) * missing * wave
        return [(weights[k], weights[k + 1]) for k in range(1, len(weights), 2)]

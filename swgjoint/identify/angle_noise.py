"""Bias of the identified rotor inertia by noise of the motor angle.

The accelerations are second differences of window means, in which the noise of an
encoder grows with the inverse square of the window. A least-squares fit attributes less
torque to a regressor that contains noise, so that the inertia becomes too small.

Source:
    Fuller (1987), "Measurement error models", ch. 1: attenuation of a slope.
"""

from __future__ import annotations

import numpy as np

from swgjoint.identify.least_squares import covariance_of, rms
from swgjoint.identify.log import ACCELERATION_STENCIL
from swgjoint.identify.model import Model
from swgjoint.typing import Array

_ORDER = 6  # differences of the means that leave their noise and none of the motion
_TO_DEVIATION = 0.6745  # median of the absolute values of a unit normal distribution


def inertia_attenuation(model: Model, information: Array, residual: Array) -> float:
    """Part of the rotor inertia that noise of the motor angle hides [-].

    Zero if the inertia is not estimated. The noise of the window means is assumed to be
    white, and is estimated from their sixth differences.

    Args:
        model: The fitted model.
        information: Product of the weighted Jacobian and its transpose.
        residual: Measured minus modelled motor torque [N·m]. Shape (n,).
    """
    names = [parameter.name for parameter in model.unknowns]
    if "rotor_inertia" not in names:
        return 0.0
    at = names.index("rotor_inertia")
    # of the acceleration, what other parameters cannot explain determines the inertia
    variance = rms(residual) ** 2 / covariance_of(information, 1.0)[at, at]
    binomial = np.poly1d([1.0, -1.0]) ** _ORDER
    differences = np.diff(model.samples.motor_angle, _ORDER)
    deviation = float(np.median(np.abs(differences))) / _TO_DEVIATION
    angle_variance = deviation**2 / float(binomial.coef @ binomial.coef)
    noise = angle_variance * float(ACCELERATION_STENCIL @ ACCELERATION_STENCIL)
    return float(residual.size * noise / model.step**4 / variance)

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
from swgjoint.identify.log import ACCELERATION_STENCIL, BenchLog
from swgjoint.identify.model import Model
from swgjoint.typing import Array

_ORDER = 6  # differences that leave noise and hardly any motion
_TO_DEVIATION = 0.6745  # median of the absolute values of a unit normal distribution


def inertia_attenuation(
    log: BenchLog, model: Model, information: Array, residual: Array
) -> float:
    """Part of the rotor inertia that noise of the motor angle hides [-].

    Zero if the inertia is not estimated.

    Args:
        log: The log, with the same number of samples in every window.
        model: The fitted model.
        information: Product of the weighted Jacobian and its transpose.
        residual: Measured minus modelled motor torque [N·m]. Shape (n,).
    """
    names = [parameter.name for parameter in model.unknowns]
    if "rotor_inertia" not in names:
        return 0.0
    at = names.index("rotor_inertia")
    # the part of the acceleration that no other parameter explains tells the inertia
    variance = rms(residual) ** 2 / covariance_of(information, 1.0)[at, at]
    noise = _variance(log, model) * float(ACCELERATION_STENCIL @ ACCELERATION_STENCIL)
    return float(residual.size * noise / model.step**4 / variance)


def _variance(log: BenchLog, model: Model) -> float:
    """Variance of the noise in the window means of the motor angle [rad²].

    The noise is assumed to be white. Fast motion looks like noise of the means, hardly
    like noise of the samples; the smaller estimate counts.
    """
    means = model.samples.motor_angle
    of_samples = _noise(log.motor_angle) * means.size / log.motor_angle.size
    return min(_noise(means), of_samples)


def _noise(angle: Array) -> float:
    """Variance of white noise on an even motion, from its sixth differences [rad²]."""
    binomial = (np.poly1d([1.0, -1.0]) ** _ORDER).coef
    deviation = float(np.median(np.abs(np.diff(angle, _ORDER)))) / _TO_DEVIATION
    return deviation**2 / float(binomial @ binomial)

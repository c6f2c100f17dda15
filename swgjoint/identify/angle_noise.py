"""Shift of the identified parameters by noise of the angles.

Encoder noise moves the slider of the hysteresis element, and its second differences
enter the accelerations, so that the fitted inertia is too small. Both shifts grow with
the variance of the noise, and confidence intervals from a covariance do not include
them. To estimate the shifts, noise of the same variance is added to the log, and one
Gauss-Newton step gives the resulting change of the parameters. The mean of this change
for the noise and for its opposite contains the shift but no random error.

Source:
    Cook and Stefanski (1994), "Simulation-extrapolation estimation in parametric
    measurement error models", Journal of the American Statistical Association 89, 1314.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from swgjoint.identify.least_squares import newton_step
from swgjoint.identify.log import BenchLog
from swgjoint.identify.model import Model
from swgjoint.typing import Array

_ORDER = 6  # order of differences in which almost no motion is left
_TO_DEVIATION = 0.6745  # median of the absolute values of a unit normal distribution
_ANGLES = ("motor_angle", "link_angle")


def shifts_by_noise(
    log: BenchLog, model: Model, values: Array, residuals: Mapping[str, Array]
) -> dict[str, float]:
    """Shift of each parameter by noise of the angles, by name and in its unit.

    Args:
        log: The log, with the same number of samples in every window.
        model: The fitted model.
        values: Its parameters.
        residuals: Measured minus modelled torque by channel [N·m].
    """
    rng = np.random.default_rng(0)
    noise = {
        key: np.sqrt(_variance(getattr(log, key), getattr(model.samples, key)))
        * rng.standard_normal(log.time.size)
        for key in _ANGLES
    }
    steps = []
    for sign in (1.0, -1.0):
        noisy = {key: getattr(log, key) + sign * noise[key] for key in _ANGLES}
        again = _model_of(replace(log, **noisy), model)
        if len(again.unknowns) != values.size:  # the log barely determines a parameter
            return {}
        steps.append(newton_step(again, values, residuals))
    shifts = np.mean(steps, axis=0)
    return {p.name: float(x) for p, x in zip(model.unknowns, shifts, strict=True)}


def _model_of(log: BenchLog, model: Model) -> Model:
    """The model of a log that differs from that of another model in its angles."""
    samples = replace(
        model.samples,
        motor_angle=model.samples.mean(log.motor_angle),
        link_angle=model.samples.mean(log.link_angle),
    )
    return Model.from_log(
        log,
        samples,
        layout=model.layout,
        teeth=model.teeth,
        ratings=model.ratings,
        corners=None,
        spring=model.spring,
        rotor_inertia=model.rotor_inertia,
        orders=[(int(p), int(q)) for p, q in model.orders],
        hysteresis=model.hysteresis,
        skew=model.skew,
    )


def _variance(samples: Array, means: Array) -> float:
    """Variance of white noise in the samples of an angle [rad²].

    Fast motion increases the estimate from window means, and slow motion over few
    encoder counts the one from samples. The smaller of both is used.

    Args:
        samples: The angle [rad]. Shape (n_samples,).
        means: Its window means [rad]. Shape (n,).
    """
    return min(_noise(samples), _noise(means) * samples.size / means.size)


def _noise(angle: Array) -> float:
    """Variance of white noise on a smooth motion, from its sixth differences [rad²]."""
    binomial = (np.poly1d([1.0, -1.0]) ** _ORDER).coef
    deviation = float(np.median(np.abs(np.diff(angle, _ORDER)))) / _TO_DEVIATION
    return deviation**2 / float(binomial @ binomial)

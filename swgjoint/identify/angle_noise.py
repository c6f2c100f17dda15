"""Shift of the identified parameters by noise of the angles.

Noise of the encoders moves the slider of the hysteresis element, and second differences
turn it into accelerations, to which a fit then attributes too small an inertia. Both
grow with the variance of the noise, and intervals from a covariance contain neither.
They are estimated as what the same noise does to the parameters once more, by one step
of Gauss and Newton. The mean for noise and its opposite leaves the shift alone.

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

_ORDER = 6  # differences that leave noise and hardly any motion
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
        if len(again.unknowns) != values.size:  # at the edge of what the log tells
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

    Fast motion looks like noise of the window means, and slow motion over few counts
    of an encoder like noise of the samples; the smaller estimate counts.

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

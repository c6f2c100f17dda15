"""Transmission accuracy, estimated from errors at a few angles of an output turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from swgjoint.gear.design.design import Design
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.typing import Array
from swgjoint.units import arcmin

ORDERS = tuple(pq for k in range(2, 13, 2) for pq in ((k, 0), (0, k)))
"""Orders (p, q) of p alpha + q beta that are fitted and separated from the rest of the
error. They are even because two lobes cancel the odd orders of either member."""
HIGHEST = 12
"""Largest of these orders."""
REST = 2.0
"""Assumed contribution of the rest to each peak, in multiples of its rms [-].

In trials the rest had 30 orders and was as strong as in thin-ring computations. The
peak to peak of the samples was 0.77 times that of a dense evaluation.
"""
MIDDLE, SPREAD = 0.95, 0.07
"""Mean and standard deviation of the middle of the bracket in these trials, divided by
the peak to peak of a dense evaluation [-]."""


def fit_orders(theta: Array, error: Array, design: Design) -> dict[float, float]:
    """Amplitudes of the low orders, fitted by least squares as in :func:`peaks` [rad].

    Args:
        theta: Random input angles over one output turn [rad]. Shape (n,).
        error: Transmission error at these angles [rad]. Shape (n,).
        design: The drive.

    Returns:
        Amplitude by order [cycles per input turn].
    """
    n = np.array(ORDERS) @ np.array(angle_coefficients(design.drive.layout))
    order = n @ np.array([1.0, 1.0 / design.ratio])
    phases = np.outer(theta, order)
    waves = np.hstack([np.ones((theta.size, 1)), np.cos(phases), np.sin(phases)])
    weights = np.linalg.lstsq(waves, error, rcond=None)[0][1:].reshape(2, -1)
    return dict(zip(np.abs(order).tolist(), np.hypot(*weights).tolist(), strict=True))


def peaks(theta: Array, error: Array, design: Design) -> tuple[float, float]:
    """Peak to peak of the low orders over an output turn, and rms of the rest [rad].

    A few angles miss the peaks of an error that repeats only after an output turn. The
    low orders are therefore fitted by least squares and evaluated densely. The rest has
    no dominant order and is described by its rms.

    Args:
        theta: Random input angles over one output turn [rad]. Shape (n,).
        error: Transmission error at these angles [rad]. Shape (n,).
        design: The drive.
    """
    n = np.array(ORDERS) @ np.array(angle_coefficients(design.drive.layout))

    def waves(theta: Array) -> Array:
        """Constant, cosines and sines of the orders at input angles."""
        phases = np.stack([theta, theta / design.ratio], axis=-1) @ n.T.astype(float)
        ones = np.ones((theta.size, 1))
        return np.hstack([ones, np.cos(phases), np.sin(phases)])

    seen = waves(theta)
    weights = np.linalg.lstsq(seen, error, rcond=None)[0]
    rest = error - seen @ weights
    turns = abs(design.ratio)
    dense = np.linspace(0.0, 2.0 * np.pi * turns, round(10 * HIGHEST * turns))
    low = float(np.ptp(waves(dense) @ weights))
    return low, float(np.sqrt(rest @ rest / (rest.size - weights.size)))


def accuracy_bracket(found: Mapping[str, Any], design: Design) -> tuple[float, float]:
    """Lower and upper estimate of the peak to peak over an output turn [arcmin].

    The lower estimate is the peak to peak of the low orders, or that of the samples if
    the latter is larger. The upper one is the peak to peak of the low orders plus the
    contribution of the rest, and at least the lower one.

    Args:
        found: Samples, with the keys ``input_angles_rad`` and ``error_rad``.
        design: The drive.
    """
    theta, error = (np.array(found[key]) for key in ("input_angles_rad", "error_rad"))
    low, rest = peaks(theta, error, design)
    sure = max(low, float(np.ptp(error)))
    return sure / arcmin, max(sure, low + 2.0 * REST * rest) / arcmin

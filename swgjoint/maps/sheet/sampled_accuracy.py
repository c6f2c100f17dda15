"""Transmission accuracy from errors at a few angles of an output turn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from swgjoint.gear.design.design import Design
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.typing import Array
from swgjoint.units import arcmin

ORDERS = tuple(pq for k in range(2, 13, 2) for pq in ((k, 0), (0, k)))
"""Orders (p, q) of p alpha + q beta that are separated from the rest of the error. Two
lobes cancel the odd orders of the errors of either member."""
HIGHEST = 12
"""Highest of these orders."""
REST = 2.0
"""Largest contribution of the rest to either peak, in multiples of its rms. In trials
with a rest of 30 orders, as strong as in ring computations, the middle of the bracket
is 0.95 times the dense peak to peak, with a standard deviation of 0.07. The largest
difference of the same samples is 0.77 times it."""


def peaks(theta: Array, error: Array, design: Design) -> tuple[float, float]:
    """Peak to peak of the low orders over an output turn, and rms of the rest [rad].

    A few angles miss the peaks of an error that repeats only after an output turn. The
    low orders are therefore fitted by least squares and evaluated densely. No order
    dominates the rest, so its rms is returned.

    Args:
        theta: Random input angles over one output turn [rad]. Shape (n,).
        error: Error at these angles [rad]. Shape (n,).
        design: The drive.
    """
    n = np.array(ORDERS) @ np.array(angle_coefficients(design.drive.layout))

    def waves(theta: Array) -> Array:
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

    The lower one is the peak to peak of the low orders, or that of the samples if it is
    larger. The upper one adds the largest contribution of the rest.

    Args:
        found: Samples with ``input_angles_rad`` and ``error_rad``.
        design: The drive.
    """
    theta, error = (np.array(found[key]) for key in ("input_angles_rad", "error_rad"))
    low, rest = peaks(theta, error, design)
    sure = max(low, float(np.ptp(error)))
    return sure / arcmin, max(sure, low + 2.0 * REST * rest) / arcmin

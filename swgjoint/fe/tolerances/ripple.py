"""Ripple of a drive with tooth errors, which its pattern of perfect teeth adds to."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.fe.common.torque_choice import Ripple
from swgjoint.maps.fit.tolerance_modes import relative_amplitudes
from swgjoint.maps.samples import ToleranceSamples
from swgjoint.typing import Array

SHARE = 0.2
"""Fraction of the peak-to-peak values with tooth errors by which errors of the pattern
of perfect teeth are divided, if the pattern itself has less [-]. The goals of its
sampling, 4 % at most, then keep these errors below 0.8 % of the ripple with tooth
errors. In size-25-100-bought, the largest error of the superposition is 1.6 to 23 % of
the input torque and 0.4 to 9 % of the output error."""


def ripple_with_errors(tolerances: ToleranceSamples, pitches_per_turn: int) -> Ripple:
    """Peak-to-peak values with tooth errors, times :data:`SHARE`.

    Args:
        tolerances: Samples over the cycle of the teeth.
        pitches_per_turn: Number of pitches per input turn.
    """
    _, (moment, error) = relative_amplitudes(tolerances, pitches_per_turn)
    heights = []
    for height in (error, moment):
        # the input torque is not known within a clearance
        known = np.isfinite(height)
        heights.append((tolerances.torque[known], SHARE * height[known]))

    def ripple(torque: ArrayLike) -> Array:
        at = np.asarray(torque, float)
        return np.array([np.interp(at, *height) for height in heights])

    return ripple

"""Ripple of a drive with tooth errors, which its pattern of perfect teeth adds to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.maps.fit.tolerance_modes import relative_amplitudes
from swgjoint.maps.samples import ToleranceSamples
from swgjoint.typing import Array

SHARE = 0.2
"""Fraction of the peak-to-peak values with tooth errors by which errors of the pattern
of perfect teeth are divided, if the pattern itself has less [-]. The goals of its
sampling, 4 % at most, then keep these errors below 0.8 % of the ripple with tooth
errors. In size-25-100-bought, the largest error of the superposition is 1.6 to 23 % of
the input torque and 0.4 to 9 % of the output error."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TabulatedRipple:
    """Peak-to-peak values between torques, a :data:`Ripple` that can be stored."""

    error: tuple[Array, Array]
    """Torques [N·m] and peak-to-peak values of the output error [rad], each (n,)."""
    moment: tuple[Array, Array]
    """The same of the input torque [N·m], each (m,)."""

    def __call__(self, torque: ArrayLike) -> Array:
        """Peak-to-peak values at torques [N·m] of any shape (...), (2, ...)."""
        at = np.asarray(torque, float)
        return np.array([np.interp(at, *one) for one in (self.error, self.moment)])


def ripple_with_errors(
    tolerances: ToleranceSamples, pitches_per_turn: int
) -> TabulatedRipple:
    """Peak-to-peak values with tooth errors, times :data:`SHARE`.

    Args:
        tolerances: Samples over the cycle of the teeth.
        pitches_per_turn: Number of pitches per input turn.
    """
    _, (moment, error) = relative_amplitudes(tolerances, pitches_per_turn)
    tables = []
    for height in (error, moment):
        # the input torque is not known within a clearance
        known = np.isfinite(height)
        tables.append((tolerances.torque[known], SHARE * height[known]))
    return TabulatedRipple(error=tables[0], moment=tables[1])

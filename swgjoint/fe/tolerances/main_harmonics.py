r"""Choice of the harmonics of tooth errors that a map keeps.

Random errors of single teeth spread over thousands of weak harmonics. Compared one by
one with the strongest harmonic, all of them are negligible; together they are most of
the ripple of a joint whose link gives way to the slow, strong orders. The harmonics of
every octave of orders are therefore judged together: those left out of an octave have
at most the fraction :data:`SHARE` of its root mean square (rms), in output error and
input torque, at every torque,

.. math:: \sum_{\text{left out}} |c_k|^2 \le s^2 \sum_{\text{octave}} |c_k|^2 .

Speed, inertias and resonance determine how much of an order reaches the torque of a
joint, and a map does not know them. Within an octave, they affect all orders in a
similar way.
"""

from __future__ import annotations

import numpy as np

from swgjoint.maps.fit.tolerance_modes import weakest
from swgjoint.typing import Array, Index

SHARE = 0.31
"""Largest rms of the harmonics left out of an octave, as a fraction of its rms [-].
They lower its rms by 1 - sqrt(1 - 0.31²) = 5 %, as much as other meshes and maps change
a ripple. The superposition itself deviates from full solves by as much: by 27, 16 and
18 % of the rms input torque of size-25-100-bought-coarse at 6, 31 and 88 N·m (229
positions)."""
FAINT = 1e-3
"""Octaves whose rms is below this fraction of that of all orders count as if they had
it [-]: round-off and traces of other orders do not become harmonics."""


def main_harmonics(
    spectrum: Array, torque: Array, orders: Array, *, free: bool
) -> tuple[Index, float]:
    """Numbers of waves of the harmonics that a map keeps, the mean included.

    Args:
        spectrum: Complex amplitudes of output error [rad] and strain energy [J] by
            torque and number of waves, zero first (2, n_torques, n).
        torque: Torques (n_torques,) [N·m].
        orders: Orders per input turn, zero first and increasing (n,).
        free: Whether clearance leaves the input torque without load undetermined.

    Returns:
        Numbers of waves, increasing, and the largest rms over the torques of the output
        error that all other waves add [rad].
    """
    error, energy = spectrum[:, :, 1:]
    order = orders[1:]
    # at a constant torque, the input torque is the derivative of U + T e
    moment = order * (energy + torque[:, None] * error)
    if free:
        moment = moment[torque != 0.0]
    power = np.abs(np.concatenate([error, moment])) ** 2  # (n_rows, n)
    faint = FAINT**2 * power.sum(axis=1)
    left = np.zeros(order.size, dtype=bool)
    octave = np.floor(np.log2(order))
    for number in np.unique(octave):
        inside = np.flatnonzero(octave == number)
        part = power[:, inside]
        whole = np.maximum(np.maximum(part.sum(axis=1), faint), 1e-300)
        amplitudes = np.sqrt(2.0 * part / whole[:, None]).T
        none = np.zeros(inside.size, dtype=bool)
        left[inside] = weakest(amplitudes, none, SHARE)
    kept: Index = np.append(0, 1 + np.flatnonzero(~left))
    others = np.sqrt(0.5 * np.sum(np.abs(error[:, left]) ** 2, axis=1))
    return kept, float(others.max(initial=0.0))

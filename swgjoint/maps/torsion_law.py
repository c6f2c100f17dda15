r"""Potential of a torsional stiffness that is piecewise linear in the torsion.

.. math:: T(\Delta) = \int_0^\Delta k(s)\,ds, \quad V(\Delta) = \int_0^\Delta T(s)\,ds

with k linear between the knots and constant beyond them. The torque and its slope are
continuous, the torque is a parabola on each interval, and it increases everywhere if
all k are positive.
"""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array


def torque_at_knots(knots: Array, stiffness: Array) -> Array:
    """Torque at the knots, where zero torsion has zero torque [N·m]. Shape (n,).

    Args:
        knots: Increasing torsions, zero inside their range [rad]. Shape (n,).
        stiffness: Stiffness at the knots [N·m/rad]. Shape (n,).
    """
    steps = 0.5 * np.diff(knots) * (stiffness[1:] + stiffness[:-1])
    torque = np.concatenate([[0.0], np.cumsum(steps)])
    j, d, bend = _zero(knots, stiffness)
    return np.asarray(torque - (torque[j] + d * (stiffness[j] + 0.5 * d * bend)))


def potential_of_stiffness(
    knots: Array, stiffness: Array, *, n_harmonics: int = 1
) -> tuple[Array, Array]:
    """Coefficients of :class:`~swgjoint.maps.drive_map.DriveMap` for a stiffness.

    Args:
        knots: Increasing torsions, zero inside their range [rad]. Shape (n,).
        stiffness: Stiffness at the knots [N·m/rad]. Shape (n,).
        n_harmonics: Number of harmonics; all except the mean get a zero potential.

    Returns:
        ``potential`` with V(0) = 0 (n_harmonics, 2, n - 1, 5) [J/rad^k] and
        ``end_stiffness`` (n_harmonics, 2, 2) [N·m/rad].
    """
    h = np.diff(knots)
    bend = np.diff(stiffness) / h
    torque = torque_at_knots(knots, stiffness)
    steps = h * (torque[:-1] + h * (0.5 * stiffness[:-1] + h * bend / 6.0))
    energy = np.concatenate([[0.0], np.cumsum(steps)])
    j, d, slope = _zero(knots, stiffness)
    energy -= energy[j] + d * (torque[j] + d * (0.5 * stiffness[j] + d * slope / 6.0))

    potential = np.zeros((n_harmonics, 2, h.size, 5))
    potential[0, 0, :, :4] = np.stack(
        [energy[:-1], torque[:-1], 0.5 * stiffness[:-1], bend / 6.0], axis=-1
    )
    ends = np.zeros((n_harmonics, 2, 2))
    ends[0, 0] = stiffness[[0, -1]]
    return potential, ends


def _zero(knots: Array, stiffness: Array) -> tuple[int, float, float]:
    """Interval of zero torsion, distance of zero from its first knot, and its dk/dx."""
    j = int(np.clip(np.searchsorted(knots, 0.0) - 1, 0, knots.size - 2))
    bend = (stiffness[j + 1] - stiffness[j]) / (knots[j + 1] - knots[j])
    return j, -float(knots[j]), float(bend)

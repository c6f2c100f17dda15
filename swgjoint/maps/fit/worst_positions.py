"""Positions at which a map is likely to deviate most from the finite elements.

A map is smooth over torsion and angle. Contacts that change cause corners of the output
error, and jumps of the curvature of the complementary potential, at few angles and
torques. Equilibria at regular positions miss most of them. Local interpolation of the
same samples over the angle follows the corners. The map is doubtful where it differs
from this interpolation.
"""

from __future__ import annotations

import numpy as np

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.sample_curves import (
    curves_at,
    input_torque_at,
    output_error_at,
)
from swgjoint.maps.potential import Potential
from swgjoint.maps.samples import MapSamples
from swgjoint.typing import Array

EXTRA = 4
"""Number of additional torques of one sign for each of the two quantities."""
APART = 0.03
"""Smallest distance between additional torques, relative to the repeated peak torque
[-]."""
LEAST = 0.01
"""Smallest additional torque relative to the repeated peak torque [-]."""
FINE = 4
"""Number of angles that are compared per step between solved angles."""


def worst_positions(drive: Potential, samples: MapSamples) -> list[tuple[float, float]]:
    """Torques and angles at which a map is likely to be least accurate.

    They are chosen at every validation torque and at :data:`EXTRA` other torques for
    each quantity, namely those at which the map and the local interpolation differ most
    in relation to the peak to peak over the angle. At each torque there is one angle
    for the output error and one for the input torque.

    Args:
        drive: Map of the samples.
        samples: Samples without tooth errors.

    Returns:
        Output torque [N·m] and input angle [rad] of each position. No angle is sampled.
    """
    assert samples.unseen is not None
    peak, (low, high) = samples.ratings.repeated_peak, drive.torque_range
    seen = np.unique(samples.unseen.torque)
    seen = seen[(seen != 0.0) & (seen > low) & (seen < high)]
    theta, seen_doubts = _doubts(drive, samples, seen)
    positions = [
        (float(torque), float(theta[row.argmax()]))
        for doubt in seen_doubts
        for torque, row in zip(seen, doubt, strict=True)
    ]
    between = 0.5 * (samples.torque[1:] + samples.torque[:-1])
    for sign in np.unique(np.sign(seen)):
        part = sign * between / peak
        torques = between[(part > LEAST) & (part < 1.0) & (between < high)]
        torques = torques[torques > low]
        _, doubts = _doubts(drive, samples, torques)
        for j in _largest_apart(torques / peak, doubts):
            positions += [
                (float(torques[j]), float(theta[d[j].argmax()])) for d in doubts
            ]
    return sorted(set(positions))


def _largest_apart(parts: Array, doubts: tuple[Array, Array]) -> list[int]:
    """Indices of the torques with the largest differences of either quantity.

    Args:
        parts: Torques relative to the repeated peak torque (n,) [-].
        doubts: Differences of the two quantities, each (n, n_angles) [-].
    """
    chosen: list[int] = []
    for doubt in doubts:
        largest = doubt.max(axis=1)
        for _ in range(EXTRA):
            near = np.abs(parts[:, None] - parts[chosen]) < APART
            free = np.flatnonzero(~near.any(axis=1))
            if not free.size:
                break
            chosen.append(int(free[largest[free].argmax()]))
    return chosen


def _doubts(
    drive: Potential, samples: MapSamples, torques: Array
) -> tuple[Array, tuple[Array, Array]]:
    """Differences between a map and local interpolation of its samples.

    Args:
        drive: The map.
        samples: Its samples.
        torques: Torques inside the range of the samples (n,) [N·m].

    Returns:
        Angles (n_angles,) [rad], and the magnitudes of the differences of output error
        and input torque relative to their peak to peak, each (n, n_angles) [-].
    """
    own = samples.input_angle[samples.solved_angles]
    period = samples.input_angle.size * (samples.input_angle[1] - own[0])
    step = np.diff(np.append(own, own[0] + period))
    theta = (own[:, None] + step[:, None] * (np.arange(FINE) + 0.5) / FINE).ravel()
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    offset = float(samples.output_error[zero].mean())
    output, moment = [], []
    for torque, e, g in zip(torques, *curves_at(samples, torques), strict=True):
        psi = output_angle(drive, theta, np.full(theta.size, torque))
        on_input, on_output = drive.forces(theta, psi)
        local = output_error_at(samples, e, theta)
        apart = psi - theta / drive.ratio - (local - offset)
        output.append(np.abs(apart) / np.ptp(local))
        local = input_torque_at(samples, torque, g, theta)
        apart = -on_input - (on_output - torque) / drive.ratio - local
        moment.append(np.abs(apart) / np.ptp(local))
    return theta, (np.array(output), np.array(moment))

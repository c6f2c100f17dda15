"""Positions at which a map is likely to deviate most from the finite elements.

A map is smooth over torsion and angle. Contacts that change cause corners of the output
error, and jumps of the curvature of the complementary potential, at few angles and
torques. Equilibria at regular positions miss most of them. Local interpolation of the
same samples over the angle follows the corners at the samples, and the load curves
predict those between them (see :mod:`swgjoint.maps.fit.contact_corners`). The map is
doubtful where it differs from this interpolation, and where the load curves between the
sampled torques are uncertain themselves.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.fit.contact_corners import ContactCorners
from swgjoint.maps.fit.sample_curves import (
    curves_at,
    input_torque_at,
    output_error_at,
    smooth_output_error_at,
)
from swgjoint.maps.potential import Potential
from swgjoint.maps.samples import MapSamples
from swgjoint.typing import Array

EXTRA = 32
"""Number of additional positions of one sign for each of the two quantities."""
APART = (0.03, 0.1)
"""Smallest distance of torques that are not about the same, relative to the repeated
peak torque and to the torque itself, whichever is less [-]."""
UNCERTAIN = 16
"""Number of additional positions of one sign where the load curves are least certain.
"""
AT_TORQUE = 4
"""Largest number of additional positions of each quantity at about the same torque."""
LEAST = 0.01
"""Smallest additional torque relative to the repeated peak torque [-]."""
FINE = 4
"""Number of angles that are compared per step between solved angles."""
PLACES = (0.5, 0.1, 0.3, 0.7, 0.9)
"""Places between two torques of the samples that are compared, the usual one first."""

Corners = Mapping[float, ContactCorners]
"""Contact changes between the sampled angles, by sign of the torque."""


def worst_positions(
    drive: Potential, samples: MapSamples, corners: Corners | None = None
) -> list[tuple[float, float]]:
    """Torques and angles at which a map is likely to be least accurate.

    At every validation torque there is one angle for the output error and one for the
    input torque. :data:`EXTRA` other positions for each quantity are those at which the
    map and the local interpolation differ most in relation to the peak to peak over the
    angle, and :data:`UNCERTAIN` are those at which the load curves are least certain.

    Args:
        drive: Map of the samples.
        samples: Samples without tooth errors.
        corners: Predicted contact changes between the sampled angles; None without any.

    Returns:
        Output torque [N·m] and input angle [rad] of each position. None was sampled.
    """
    assert samples.unseen is not None
    corners = {} if corners is None else corners
    peak, (low, high) = samples.ratings.repeated_peak, drive.torque_range
    seen = np.unique(samples.unseen.torque)
    seen = seen[(seen != 0.0) & (seen > low) & (seen < high)]
    theta = _fine_angles(samples)

    def worst_near(quantity: int, torque: float, angle: float) -> tuple[float, float]:
        """Position near a fine angle, where a contact changes if that is worse."""
        sign, step = float(np.sign(torque)), FINE * (theta[1] - theta[0])
        if sign not in corners:
            return torque, angle
        tried = corners[sign].places(abs(torque))
        tried = np.append(angle, tried[np.abs(tried - angle) < 0.5 * step])
        if tried.size > 1:
            doubt = _doubts(drive, samples, np.array([torque]), corners, tried)
            angle = float(tried[doubt[quantity][0].argmax()])
        return torque, angle

    positions = [
        worst_near(k, float(torque), float(theta[row.argmax()]))
        for k, doubt in enumerate(_doubts(drive, samples, seen, corners, theta))
        for torque, row in zip(seen, doubt, strict=True)
    ]
    between = _between_torques(samples, theta, corners)
    for sign in np.unique(np.sign(seen)):
        part = sign * between / peak
        torques = between[(part > LEAST) & (part < 1.0) & (between < high)]
        torques = torques[torques > low]
        doubts = _doubts(drive, samples, torques, corners, theta)
        for quantity, doubt in enumerate(doubts):
            positions += [
                worst_near(quantity, float(torques[j]), float(theta[k]))
                for j, k in _largest_apart(torques / peak, doubt)
            ]
        if sign in corners:
            places = corners[sign].uncertain * [sign, 1.0, 1.0]
            part = sign * places[:, 0] / peak
            inside = (places[:, 0] > low) & (places[:, 0] < high)
            places = places[(part > LEAST) & (part < 1.0) & inside]
            positions += _least_certain(samples, places)
    return sorted(set(positions))


def _least_certain(samples: MapSamples, uncertain: Array) -> list[tuple[float, float]]:
    """Positions at which the load curves between the torques are least certain.

    The map and the local interpolation over the angle share the errors of these curves.

    Args:
        samples: The samples.
        uncertain: Torque [N·m], angle [rad] and estimated error of the output error
            [rad] of one position in each interval (k, 3).
    """
    error, _ = curves_at(samples, uncertain[:, 0])
    part = uncertain[:, 2] / np.ptp(error, axis=1)
    worst = uncertain[part.argsort()[-UNCERTAIN:]]
    return [(float(torque), float(angle)) for torque, angle, _ in worst]


def _between_torques(samples: MapSamples, theta: Array, corners: Corners) -> Array:
    """Torques between those of the samples, where predicted corners matter most.

    Two contacts may change within one step of the angle at few torques only. In every
    interval one torque is chosen for the input torque, and in those with the largest
    corners another one for the output error.
    """
    low, high = samples.torque[:-1], samples.torque[1:]
    tried = low + np.array(PLACES)[:, None] * (high - low)  # (n_places, n)
    error, potential = curves_at(samples, tried.ravel())
    heights = np.ptp(error, axis=1), np.ptp(np.diff(potential, axis=1), axis=1)
    missed = np.zeros((2, tried.size))
    for sign, of_sign in corners.items():
        for k in np.flatnonzero(tried.ravel() * sign > 0.0):
            both = of_sign.spline_errors(abs(float(tried.flat[k])), theta)
            missed[:, k] = [np.abs(one).max() for one in both]
    of_error, of_moment = (missed / heights).reshape(2, *tried.shape)
    j = np.arange(low.size)
    worst = of_error.max(axis=0).argsort()[-2 * EXTRA :]
    chosen = [tried[of_moment.argmax(axis=0), j]]
    chosen.append(tried[of_error.argmax(axis=0), j][worst])
    return np.unique(np.concatenate(chosen))


def _largest_apart(parts: Array, doubt: Array) -> list[tuple[int, int]]:
    """Indices of the torques and angles with the largest differences.

    Args:
        parts: Torques relative to the repeated peak torque (n,) [-].
        doubt: Differences of one quantity (n, n_angles) [-].
    """
    chosen: list[tuple[int, int]] = []
    left = doubt.copy()
    angles, count = np.arange(doubt.shape[1]), doubt.shape[1]
    apart = np.minimum(APART[0], APART[1] * np.abs(parts))
    same = np.abs(parts - parts[:, None]) < apart
    for _ in range(EXTRA):
        j, k = np.unravel_index(left.argmax(), left.shape)
        if left[j, k] < 0.0:
            break
        chosen.append((int(j), int(k)))
        beside = np.abs((angles - k + count // 2) % count - count // 2)
        left[np.ix_(same[j], beside <= FINE)] = -1.0
        shared = same[[i for i, _ in chosen]].sum(axis=0)
        left[shared >= AT_TORQUE] = -1.0
    return chosen


def _fine_angles(samples: MapSamples) -> Array:
    """:data:`FINE` angles in each step between solved angles [rad]."""
    own = samples.input_angle[samples.solved_angles]
    period = samples.input_angle.size * (samples.input_angle[1] - own[0])
    step = np.diff(np.append(own, own[0] + period))
    parts = (np.arange(FINE) + 0.5) / FINE
    return np.asarray((own[:, None] + step[:, None] * parts).ravel())


def _doubts(
    drive: Potential,
    samples: MapSamples,
    torques: Array,
    corners: Corners,
    theta: Array,
) -> tuple[Array, Array]:
    """Differences between a map and local interpolation of its samples.

    Args:
        drive: The map.
        samples: Its samples.
        torques: Torques inside the range of the samples (n,) [N·m].
        corners: Predicted contact changes between the sampled angles.
        theta: Input angles within one period (n_angles,) [rad].

    Returns:
        Magnitudes of the differences of output error and input torque, relative to the
        peak to peak over these angles, each (n, n_angles) [-].
    """
    zero = int(np.flatnonzero(samples.torque == 0.0)[0])
    offset = float(samples.output_error[zero].mean())
    output, moment = [], []
    for torque, e, g in zip(torques, *curves_at(samples, torques), strict=True):
        psi = output_angle(drive, theta, np.full(theta.size, torque))
        on_input, on_output = drive.forces(theta, psi)
        local = output_error_at(samples, e, theta)
        height, of_map = np.ptp(local), psi - theta / drive.ratio + offset
        apart = np.abs(of_map - local)
        local = input_torque_at(samples, torque, g, theta)
        missed = -on_input - (on_output - torque) / drive.ratio - local
        sign = float(np.sign(torque))
        if sign in corners:
            # splines round the predicted corners, too
            of_error, of_moment = corners[sign].spline_errors(abs(torque), theta)
            local_error = smooth_output_error_at(samples, e, theta) - sign * of_error
            apart = np.maximum(apart, np.abs(of_map - local_error))
            missed += of_moment
        output.append(apart / height)
        moment.append(np.abs(missed) / np.ptp(local))
    return np.array(output), np.array(moment)

"""Samples of a map between their torques and between their angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import Akima1DInterpolator, CubicHermiteSpline, CubicSpline

from swgjoint.gear.kinematics import ratio
from swgjoint.maps.samples import MapSamples
from swgjoint.typing import Array, Index

_REACH = 5
"""Number of samples by which a period is continued at both ends."""


def curves_at(samples: MapSamples, torques: ArrayLike) -> tuple[Array, Array]:
    """Samples at other torques, by their slopes de/dT = -C and dG/dT = e.

    Args:
        samples: The samples; C is their compliance.
        torques: Torques inside their range (n,) [N·m].

    Returns:
        Output error e [rad] and complementary potential G = U + T e [J], each (n,
        n_angles).
    """
    torque, error = samples.torque, samples.output_error
    potential = samples.energy + torque[:, None] * error
    return (
        np.asarray(CubicHermiteSpline(torque, error, -samples.compliance)(torques)),
        np.asarray(CubicHermiteSpline(torque, potential, error)(torques)),
    )


def output_error_at(samples: MapSamples, error: Array, theta: ArrayLike) -> Array:
    """Output error between the sampled angles, by local interpolation.

    It follows corners of the output error, which an interpolation by harmonics rounds.

    Args:
        samples: The samples.
        error: Output error at their angles (n_angles,) [rad].
        theta: Input angles within one period (n,) [rad].
    """
    place, around = _continued(samples)
    return np.asarray(Akima1DInterpolator(place, error[around])(theta))


def smooth_output_error_at(
    samples: MapSamples, error: Array, theta: ArrayLike
) -> Array:
    """Output error between the sampled angles by a cubic spline, which rounds corners.

    Args:
        samples: The samples.
        error: Output error at their angles (n_angles,) [rad].
        theta: Input angles within one period (n,) [rad].
    """
    place, around = _continued(samples)
    return np.asarray(CubicSpline(place, error[around])(theta))


def input_torque_at(
    samples: MapSamples, torque: float, potential: Array, theta: ArrayLike
) -> Array:
    """Input torque dG/dtheta + T/i at any angle, by a cubic spline (n,) [N·m].

    Args:
        samples: The samples.
        torque: Output torque T [N·m].
        potential: Complementary potential G at their angles (n_angles,) [J].
        theta: Input angles within one period (n,) [rad].
    """
    place, around = _continued(samples)
    slope = CubicSpline(place, potential[around])(theta, 1)
    teeth = samples.teeth_flexspline, samples.teeth_circular_spline
    return np.asarray(slope + torque / ratio(samples.layout, *teeth))


def _continued(samples: MapSamples) -> tuple[Array, Index]:
    """Solved angles [rad] beyond both ends of a period, and the samples repeated."""
    count = samples.input_angle.size
    # a single angle has neither corners nor a slope
    step = float(np.diff(samples.input_angle).mean()) if count > 1 else 1.0
    assert samples.solved_angles is not None
    own = np.flatnonzero(samples.solved_angles)
    around = np.arange(-_REACH, own.size + _REACH + 1)
    turns, at = np.divmod(around, own.size)
    return np.asarray(step * (own[at] + count * turns)), own[at]

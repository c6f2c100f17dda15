"""Output angle of a map at a given input angle and torque."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.maps.potential import Potential
from swgjoint.maps.sliders import Sliders
from swgjoint.maps.sums import law_sums
from swgjoint.typing import Array

CHUNK = 2**14
"""Number of angles times harmonics evaluated at once; these arrays fit in the cache."""
FREE = 1e-5
"""Torque in the middle of a clearance below which an unloaded output stays there, as a
fraction of the rated torque [-].

In the layouts with another member fixed than the circular spline, harmonics of the
energy in the clearance act on the output: 1.2e-6 of the rated torque on a drive of 60
and 62 teeth. This is less than any friction."""
SOFT = 1e-3
"""Largest stiffness in a clearance, relative to the rated torque per torsion between
the outermost knots [-]. It is about 1e-9 where the output is free, and 0.02 where a map
with manufacturing errors holds it."""
_NEWTON = 12
_BISECTIONS = 400


def output_angle(
    drive: Potential,
    theta: ArrayLike,
    torque: ArrayLike,
    sliders: Sliders | None = None,
) -> Array:
    """Output angle psi [rad] at which the drive exerts a torque on the output.

    Newton's method starts from the mean torsion curve; bisection solves the points
    where it does not converge. For an unloaded output with clearance, the middle of the
    clearance (e0) is returned. The result has the shape of the broadcast arguments.

    Args:
        drive: The map.
        theta: Input angles [rad].
        torque: Torque T on the output [N·m], of a shape that broadcasts with ``theta``.
        sliders: State of the hysteresis elements, from which each point is reached
            along a monotone torsion path. None ignores hysteresis.

    Raises:
        ComputationError: If the map reaches a torque at no output angle.
    """
    theta, torque = np.broadcast_arrays(
        np.asarray(theta, float), np.asarray(torque, float)
    )
    flat_theta, flat_torque = theta.ravel(), torque.ravel()
    # torsion of the mean curve as a function of torque, for the initial guess
    knots = drive.torsion_knots
    x = np.linspace(2.0 * knots[0], 2.0 * knots[-1], 801)
    curve = drive.coefficients(x, 1, count=1)[:, 0, 0], x
    size = max(1, CHUNK // len(drive.orders))
    parts = [
        _solve(
            drive, curve, flat_theta[k : k + size], flat_torque[k : k + size], sliders
        )
        for k in range(0, flat_theta.size, size)
    ]
    return np.concatenate(parts).reshape(theta.shape)


def stays_free(drive: Potential, torque: Array, stiffness: Array) -> Array:
    """Where an unloaded output stays in a clearance in spite of a small torque.

    Args:
        drive: The map.
        torque: Torque T on the output [N·m].
        stiffness: Stiffness there [N·m/rad]; same shape.
    """
    rated, span = drive.ratings.rated_torque, np.ptp(drive.torsion_knots)
    return np.asarray(
        (np.abs(torque) <= FREE * rated) & (np.abs(stiffness) <= SOFT * rated / span)
    )


def move_sliders(
    drive: Potential, sliders: Sliders, theta: float, psi: float
) -> Sliders:
    """State of the hysteresis elements after a monotone path to given angles.

    Args:
        drive: The map.
        sliders: State at the start of the path.
        theta: Input angle at its end [rad].
        psi: Output angle at its end [rad].
    """
    x = float(drive.torsion(theta, psi))
    return sliders.move_to(x, float(drive.torque(x, theta, psi)))


def _solve(
    drive: Potential,
    curve: tuple[Array, Array],
    theta: Array,
    torque: Array,
    sliders: Sliders | None,
) -> Array:
    """Output angles of one chunk [rad]; ``curve`` is torque and torsion of the mean."""
    ideal = theta / drive.ratio
    # the points of a loop have one input angle
    same = slice(1) if (theta == theta[0]).all() else slice(None)
    e0, _, _ = drive.error_at(drive.phases(theta[same], ideal[same]))
    twist = np.where(torque == 0.0, 0.0, np.interp(torque, *curve))
    psi = ideal + e0 - twist
    span = float(drive.torsion_knots[-1] - drive.torsion_knots[0])
    # round-off of psi, far below the resolution of any sensor
    settled = 8.0 * np.finfo(float).eps * np.maximum(np.abs(ideal), span)
    open_ = np.arange(theta.size)
    for _ in range(_NEWTON):
        here = psi[open_]
        f, slope = _torque(drive, theta[open_], here, sliders)
        f = f - torque[open_]
        if sliders is None:  # hysteresis elements hold the output
            free = (torque[open_] == 0.0) & stays_free(drive, f, slope)
            f = np.where(free, 0.0, f)
        # the torque decreases with psi, so an excess torque requires a positive step
        step = np.where(f == 0.0, 0.0, f / np.where(slope > 0.0, slope, np.nan))
        step = np.clip(step, -span, span)
        psi[open_] = here + step
        open_ = open_[~(np.abs(step) <= settled[open_])]
        if not open_.size:
            return psi
    start = (ideal + e0 - twist)[open_]
    psi[open_] = _bisect(
        drive, theta[open_], torque[open_], start, 0.01 * span, sliders
    )
    return psi


def _torque(
    drive: Potential,
    theta: Array,
    psi: Array,
    sliders: Sliders | None,
    *,
    tangent: bool = True,
) -> tuple[Array, Array]:
    """Torque T on the output [N·m] and the stiffness at fixed phases [N·m/rad].

    Without ``tangent`` the second array is empty.
    """
    turns = bool(drive.angle_orders[:, 1].any())
    found = law_sums(
        drive, theta, psi, stiffness=tangent, by_phase=turns, error_first=True
    )
    x, torque, stiffness = found.torsion, found.torque, found.stiffness
    if sliders is not None and tangent:
        slip, slope = sliders.torque_and_tangent(x, torque, stiffness)
        torque, stiffness = torque + slip, stiffness + slope
    elif sliders is not None:
        torque = torque + sliders.torque(x, torque)
    total = torque * (1.0 - found.error_by_psi)
    return total - found.by_psi if turns else total, stiffness


def _bisect(
    drive: Potential,
    theta: Array,
    torque: Array,
    start: Array,
    width: float,
    sliders: Sliders | None,
) -> Array:
    """Output angle by bisection to round-off, where stiffness vanishes or jumps."""

    def excess(psi: Array) -> Array:
        """Torque of the drive minus the given torque [N·m]."""
        return _torque(drive, theta, psi, sliders, tangent=False)[0] - torque

    ends = []
    for sign in (-1.0, 1.0):
        end, wide = start + sign * width, np.full(start.size, width)
        while (out := sign * excess(end) > 0.0).any():
            if wide.max() > 1e9 * width:
                raise ComputationError(
                    f"map {drive.name!r} does not reach a torque of"
                    f" {float(torque[out][0]):g} N·m"
                )
            wide[out] *= 2.0
            end = np.where(out, end + sign * wide, end)
        ends.append(end)
    low, high = ends
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if not ((low < middle) & (middle < high)).any():
            break
        above = excess(middle) > 0.0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.asarray(0.5 * (low + high))

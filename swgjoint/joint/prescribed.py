r"""Level ``kinematic``: a rigid drive whose output is off by the kinematic error.

The gear is the constraint :math:`\psi = \theta/i + e_0(\theta, \psi)`; psi is the
coordinate, theta follows. To first order in e0 the link then obeys

.. math:: (M + i^2 J)\,\ddot\psi = i\tau + f + i^2 J\,\ddot e_0,

M and f inertia and force of the arm, tau the motor torque: the rotor sees
:math:`\ddot\theta = i(\ddot\psi - \ddot e_0)`. So the model is the rigid one, and e0 of
the commanded motor motion enters through the inputs: a motor loop on theta is a loop on
:math:`i(\psi - e_0)`, and :math:`i J\,\ddot e_0` adds to the motor torque.

Neglected: the change of the ratio in the torque, :math:`i\,|\partial_\theta e_0|` of it
(:func:`ratio_variation`, about 1 % at tooth order), and e0 at the actual instead of the
commanded motor angle, :math:`n |\theta - \theta_r|` in phase at order n.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array


def kinematic_part(drive: DriveMap) -> DriveMap:
    """The map without the harmonics that carry no kinematic error."""
    return drive.with_harmonics(np.hypot(*drive.kinematic_error.T) > 0.0)


def ratio_variation(drive: DriveMap) -> float:
    """Bound of the relative change of the ratio by e0 [-]."""
    n_theta, n_psi = np.abs(drive.angle_orders.T)
    e = np.hypot(*drive.kinematic_error.T)
    return float(np.sum((abs(drive.ratio) * n_theta + n_psi) * e))


def error_of_motor(drive: DriveMap, theta: ArrayLike) -> Array:
    """e0 at motor angles, the output where it then is [rad]. Shape of theta.

    Args:
        drive: The map.
        theta: Motor angles of any shape [rad].
    """
    theta = np.asarray(theta, float)
    e0, psi = np.zeros_like(theta), theta / drive.ratio
    # e0 moves psi by an arc minute, so each round shrinks the error by n_psi e0
    for _ in range(60):
        last = e0
        e0 = drive.error_at(drive.phases(theta, psi + e0))[0]
        if np.abs(e0 - last).max(initial=0.0) < 1e-16:
            break
    return np.asarray(e0)


def motor_of_link(drive: DriveMap, psi: ArrayLike) -> Array:
    """Motor angle at which the output stands at psi [rad]. Shape of psi.

    Args:
        drive: The map.
        psi: Link angles of any shape [rad].

    Raises:
        ComputationError: If the error is so steep that several motor angles fit.
    """
    psi = np.asarray(psi, float)
    theta = drive.ratio * psi
    for _ in range(60):
        e0, slope, _ = drive.error_at(drive.phases(theta, psi))
        step = (theta / drive.ratio + e0 - psi) / (1.0 / drive.ratio + slope)
        theta = theta - step
        # round-off of the angle, and of e0 times the ratio
        if (np.abs(step) <= 1e-13 * (1.0 + np.abs(theta))).all():
            return np.asarray(theta)
    raise ComputationError(
        f"map {drive.name!r}: no single motor angle belongs to a link angle; the ratio"
        f" varies by up to {100.0 * ratio_variation(drive):.3g} %, needed: below 100 %"
    )

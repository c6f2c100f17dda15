r"""Level ``kinematic``: a rigid drive whose output deviates by the kinematic error.

The gear is the constraint :math:`\psi = \theta/i + e_0(\theta, \psi)`; psi is the
coordinate and determines theta. To first order in e0 the equation of the link is

.. math:: (M + i^2 J)\,\ddot\psi = i\tau + f + i^2 J\,\ddot e_0,

where M and f are inertia and force of the arm and tau is the motor torque. The rotor
accelerates by :math:`\ddot\theta = i(\ddot\psi - \ddot e_0)`. The model is therefore
the rigid one, and e0 of the commanded motor motion enters through the inputs: a motor
loop on theta becomes a loop on :math:`i(\psi - e_0)`, and :math:`i J\,\ddot e_0` is
added to the motor torque.

Two effects are neglected. The first is the variation of the ratio in the torque, whose
relative size is :math:`i\,|\partial_\theta e_0|` (:func:`ratio_variation`, about 1 % at
tooth order). The second is the difference between e0 at the actual and at the commanded
motor angle, which is a phase of :math:`n |\theta - \theta_r|` at order n.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import ComputationError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.typing import Array


def kinematic_part(drive: DriveMap) -> DriveMap:
    """The map with only those harmonics that have a kinematic error."""
    return drive.with_harmonics(np.hypot(*drive.kinematic_error.T) > 0.0)


def ratio_variation(drive: DriveMap) -> float:
    """Upper bound of the relative variation of the ratio due to e0 [-]."""
    n_theta, n_psi = np.abs(drive.angle_orders.T)
    e = np.hypot(*drive.kinematic_error.T)
    return float(np.sum((abs(drive.ratio) * n_theta + n_psi) * e))


def error_of_motor(drive: DriveMap, theta: ArrayLike) -> Array:
    """Error e0 at motor angles with psi = theta/i + e0, in the shape of theta [rad].

    Args:
        drive: The map.
        theta: Motor angles of any shape [rad].
    """
    theta = np.asarray(theta, float)
    e0, psi = np.zeros_like(theta), theta / drive.ratio
    # each iteration reduces the error by the slope of e0 by psi, which is small
    for _ in range(60):
        last = e0
        e0 = drive.error_at(drive.phases(theta, psi + e0))[0]
        if np.abs(e0 - last).max(initial=0.0) < 1e-16:
            break
    return np.asarray(e0)


def motor_of_link(drive: DriveMap, psi: ArrayLike) -> Array:
    """Motor angles at which the output angle is psi, in the shape of psi [rad].

    Args:
        drive: The map.
        psi: Link angles of any shape [rad].

    Raises:
        ComputationError: If Newton's method does not converge, because e0 is so steep
            that several motor angles fit one psi.
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
        f"map {drive.name!r}: a link angle has no unique motor angle; the ratio varies"
        f" by up to {100.0 * ratio_variation(drive):.3g} %, accepted: below 100 %"
    )

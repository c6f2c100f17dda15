r"""Removal of the weakest harmonics of a map, with bounds on the effect.

At given phases and inside the sampled torsion, a harmonic k with kinematic error
:math:`e_k` and potential :math:`A_k, B_k` changes the results by at most

.. math::
    |\delta e_0| \le |e_k|, \quad
    |\delta \partial_\Delta V| \le t_k = \max_\Delta |(A_k', B_k')|, \quad
    |\delta\psi|_T \le |e_k| + t_k / c,

where the last bound applies at a given torque and input angle, and c is the lowest
stiffness at any phases: a torque change t changes the torsion by at most t/c. For
several harmonics the bounds are added. Maxima are taken over the Bernstein coefficients
of the polynomials, which enclose their values.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from swgjoint.errors import InputError
from swgjoint.maps.phase_bounds import bernstein_coefficients, stiffness_range
from swgjoint.typing import Array
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.maps.potential import Potential

    Map = TypeVar("Map", bound=Potential)


def pruned_map(drive: Map, tolerance: float) -> Map:
    """A copy without the weakest harmonics; ``info["pruned"]`` states the bounds.

    If the map was pruned before, the lists of harmonics are joined and the tolerances
    and bounds are added, since the deviation from the original map is at most the sum.

    Args:
        drive: The map.
        tolerance: Tolerance of the output angle at a given torque and input angle
            [rad]. Harmonics are dropped, the weakest first, while the sum of their
            bounds does not exceed it.

    Raises:
        InputError: If the tolerance is not positive, or if the harmonics may reduce the
            stiffness to zero, so that the angle has no bound.
    """
    if not 0.0 < tolerance < np.inf:
        raise InputError(f"tolerance {tolerance / arcmin:g} arcmin; accepted: > 0")
    error, torque = np.hypot(*drive.kinematic_error.T), torque_amplitudes(drive)
    lowest, highest = stiffness_range(drive)
    if lowest <= 0.0:
        raise InputError(
            f"map {drive.name!r}: its harmonics may reduce the stiffness to"
            f" {lowest:.3g} N·m/rad, so that the angle has no bound; accepted:"
            " a map whose harmonics together change the stiffness by less than its mean"
            " at every torsion; use it without a tolerance, or at a level without"
            " harmonics (rigid, linear, native)"
        )
    angle = error + torque / lowest
    angle[0] = np.inf  # the mean is kept
    weakest = np.argsort(angle, kind="stable")
    gone = weakest[np.cumsum(angle[weakest]) <= tolerance]
    keep = np.ones(angle.size, dtype=bool)
    keep[gone] = False
    of_error, of_torque = float(error[gone].sum()), float(torque[gone].sum())
    note = {
        "tolerance_arcmin": tolerance / arcmin,
        "dropped": [[int(p), int(q)] for p, q in drive.orders[~keep]],
        "output_angle_bound_arcmin": float(angle[gone].sum()) / arcmin,
        "kinematic_error_bound_arcmin": of_error / arcmin,
        # at given input and output angles the error also changes the torsion
        "torque_bound_Nm": of_torque + highest * of_error,
    }
    before = drive.info.get("pruned", {})
    note = {key: before[key] + one if before else one for key, one in note.items()}
    note["harmonics"] = int(keep.sum()) - 1
    return replace(drive.with_harmonics(keep), info={**drive.info, "pruned": note})


def torque_amplitudes(drive: Potential) -> Array:
    """Upper bound of the torque of each harmonic inside the knots [N·m].

    Shape (n_harmonics,).
    """
    points = bernstein_coefficients(drive, 1)
    return np.asarray(np.hypot(points[:, 0], points[:, 1]).max(axis=(1, 2)))

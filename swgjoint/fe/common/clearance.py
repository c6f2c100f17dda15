"""Rows of a map across a clearance in which the unloaded output is free."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

FAINT = 1e-8
"""Torque at the ends of a clearance as a fraction of the torque that takes it up [-].
It is greater than zero so that the stiffness inside the clearance is not zero."""


def across_clearance(
    rest: Array, taken_up: Array, torque: float, faint: float = FAINT
) -> tuple[float, Array]:
    r"""Point at which the teeth begin to hold an output that is free without torque.

    From the middle of the clearance to this point the torque rises to the fraction
    ``faint`` of the torque T that takes up the clearance. There the stiffness
    begins to grow, and it reaches K under T after a further rotation
    :math:`\ell = 3 T / 2 K`. A linear spring would reach T after a rotation of T/K and
    store the energy :math:`T^2 / 2 K`; the growing stiffness stores nearly the same
    energy over :math:`\ell`.

    Args:
        rest: Output error [rad], energy [J], compliance [rad/(N·m)] and input torque
            [N·m] in the middle of the clearance (4, n).
        taken_up: The same quantities under ``torque`` (4, n).
        torque: Small torque T that takes up the clearance, of either sign [N·m].
        faint: Torque at the point as a fraction of T [-].

    Returns:
        Torque at the point [N·m] and the four quantities there (4, n).
    """
    begin = faint * torque
    apart = taken_up[0] - rest[0]  # against the sign of the torque
    way = np.clip(1.0 - 1.5 * torque * taken_up[2] / -apart, 0.1, 1.0)
    onset = rest.copy()
    onset[0] += way * apart
    onset[1] -= 0.5 * begin * way * apart
    onset[2] = -way * apart / begin
    onset[3] += faint * (taken_up[3] - rest[3])
    return begin, onset

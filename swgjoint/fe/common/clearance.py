"""Rows of a map across a clearance in which the output is free without torque."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

FAINT = 1e-8
"""Torque at the ends of a clearance as a fraction of the torque that takes it up [-];
it is not zero, so that no stiffness is zero."""


def across_clearance(
    rest: Array, taken_up: Array, torque: float
) -> tuple[float, Array]:
    r"""Point at which the teeth begin to hold an output that is free without torque.

    From the middle of the clearance the torque rises to the fraction :data:`FAINT` of
    the torque T that takes up the clearance. There the stiffness begins to grow; it
    reaches K under T after a further rotation :math:`\ell = 3 T / 2 K`. A linear spring
    would begin T/K before and store the energy :math:`T^2 / 2 K`; the growing stiffness
    stores nearly the same energy over :math:`\ell`.

    Args:
        rest: Output error, energy, compliance and input torque in the middle (4, n).
        taken_up: Output error, energy, compliance and input torque under ``torque``
            (4, n).
        torque: Small torque T that takes up the clearance [N·m].

    Returns:
        Torque [N·m] and table (4, n) of that point.
    """
    begin = FAINT * torque
    apart = taken_up[0] - rest[0]  # against the sign of the torque
    way = np.clip(1.0 - 1.5 * torque * taken_up[2] / -apart, 0.1, 1.0)
    onset = rest.copy()
    onset[0] += way * apart
    onset[1] -= 0.5 * begin * way * apart
    onset[2] = -way * apart / begin
    onset[3] += FAINT * (taken_up[3] - rest[3])
    return begin, onset

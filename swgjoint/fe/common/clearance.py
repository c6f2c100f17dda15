"""Rows of a map across a clearance that leaves the output free without torque."""

from __future__ import annotations

import numpy as np

from swgjoint.typing import Array

FAINT = 1e-8
"""Part of the torque that takes up a clearance, that acts at its ends: no stiffness is
zero."""


def across_clearance(
    rest: Array, taken_up: Array, torque: float
) -> tuple[float, Array]:
    r"""Where the teeth begin to hold an output that is free without torque.

    From the middle of the clearance the torque rises to the :data:`FAINT` part of the
    one that takes it up; there the stiffness begins to grow, to K under that torque at
    :math:`\ell = 3 T / 2 K`. A linear spring would begin at T/K with the energy
    :math:`T^2 / 2 K`; a stiffness that grows steadily stores nearly that on this way.

    Args:
        rest: Output error, energy, compliance and input torque in the middle (4, n).
        taken_up: The same under ``torque`` (4, n).
        torque: A small one [N·m].

    Returns:
        Torque [N·m] and table (4, n) of the begin.
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

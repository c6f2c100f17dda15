"""Play of the teeth of a deflected flexspline: the free rotation of the output."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, about_z
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.typing import Array

REACH = 0.5
"""Largest gap of teeth that count [modules]; without such a gap the teeth pass each
other."""
FLAT = 0.1
"""Lever arm over the pitch radius below which a contact belongs to neither side [-]."""
TURNS = 12
"""Largest number of rotations until a tooth touches."""
TOUCHES = 1e-10
"""Rotation below which a tooth touches [rad]."""


def play(
    model: SolidSectorModel, frame: SolidFrames, load: Array, ratio: float
) -> float:
    r"""Rotation of the output between the contacts of its two directions [rad].

    The deflected flexspline is rotated as a whole until a tooth touches. This rotates
    the lobes as well. For fixed lobes the rotation of the output is :math:`1 - 1/i`
    times as large.

    Args:
        model: Model of half of the drive or of the whole drive.
        frame: Frames of its toothed segments without tooth contact.
        load: Forces at their loaded degrees of freedom (N, n_b) [N].
        ratio: Signed ratio i [-].

    Returns:
        Play [rad]; negative if flanks overlap, infinite if no flanks are close, NaN if
        teeth overlap that no rotation can separate.
    """
    profile = model.strip.profile
    reach = REACH * 2.0 * profile.pitch_radius / profile.teeth
    flat = FLAT * profile.pitch_radius
    still = np.zeros(
        (model.teeth.circular_spline_teeth, model.teeth.circular_spline_dofs)
    )
    sides = []
    for sign in (1.0, -1.0):
        angle = 0.0
        for _ in range(TURNS):
            turned = replace(frame, turn=about_z(np.array(angle)) @ frame.turn)
            rows = model.teeth.find(turned, load, still, reach, None, thorough=True)
            gap, arm = rows.contacts.gap, sign * rows.arm
            if (gap[np.abs(arm) < flat] < 0.0).any():
                return nan
            closing = arm < -flat
            if not closing.any():
                return inf
            step = float(np.min(gap[closing] / -arm[closing]))
            angle += sign * step
            if abs(step) < TOUCHES:
                break
        sides.append(sign * angle)
    return sum(sides) * (1.0 - 1.0 / ratio)

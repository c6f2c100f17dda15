"""Tooth play of a deflected flexspline: the free rotation of the output."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, about_z
from swgjoint.fe.solid.sector_model import SolidSectorModel
from swgjoint.typing import Array

REACH = 0.5
"""Largest gap that is considered [modules]. If no gap closes within this reach, the
teeth can pass each other."""
FLAT = 0.1
"""Ratio of lever arm to pitch radius below which a contact does not limit the rotation
in either direction [-]."""
TURNS = 12
"""Largest number of rotations towards the contact of one direction."""
TOUCHES = 1e-10
"""Rotation below which a tooth counts as touching [rad]."""


def play(
    model: SolidSectorModel, frame: SolidFrames, load: Array, ratio: float
) -> float:
    r"""Free rotation of the output between tooth contact in both directions.

    The deflected flexspline is rotated as a rigid body, first forward and then
    backward, until a tooth touches. This also rotates the lobes. With fixed lobes the
    rotation of the output is :math:`1 - 1/i` times as large.

    Args:
        model: Model of half of the drive or of the whole drive.
        frame: Frames of its toothed segments without tooth contact.
        load: Forces at the loaded degrees of freedom of these segments (N, n_b) [N].
        ratio: Signed gear ratio i [-].

    Returns:
        Play [rad]. It is negative if flanks overlap, infinite if no flanks are within
        reach, and NaN if teeth overlap that no rotation can separate.
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
            # a rotation closes the gaps with a negative arm; the first one limits it
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

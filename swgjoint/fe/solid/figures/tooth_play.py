"""Play of the teeth of a deflected flexspline: how far the output turns freely."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np

from swgjoint.fe.solid.corotation import SolidFrames, about_z
from swgjoint.fe.solid.ring import SolidRing
from swgjoint.typing import Array

REACH = 0.5
"""Gaps of teeth that count [modules]; without any the teeth pass each other."""
FLAT = 0.1
"""Lever over the pitch radius below which a contact has no side."""
TURNS = 12
"""Rotations at most until a tooth touches."""
TOUCHES = 1e-10
"""Rotation that counts as none [rad]."""


def play(ring: SolidRing, frame: SolidFrames, load: Array, ratio: float) -> float:
    r"""Rotation of the output between the contacts of its two directions [rad].

    The deflected flexspline turns as a whole until a tooth touches. That turns the
    lobes, too; for lobes that stand the ratio i makes it :math:`1 - 1/i` times as much.

    Args:
        ring: Half or all of the drive.
        frame: Frames of its toothed segments, no tooth in contact.
        load: At their loaded degrees of freedom (N, n_b) [N].
        ratio: Signed i.

    Returns:
        Negative where flanks overlap, inf where none are near; NaN where teeth overlap
        that no rotation can part.
    """
    profile = ring.strip.profile
    reach = REACH * 2.0 * profile.pitch_radius / profile.teeth
    flat = FLAT * profile.pitch_radius
    still = np.zeros((ring.teeth.ring_teeth, ring.teeth.ring_dofs))
    sides = []
    for sign in (1.0, -1.0):
        angle = 0.0
        for _ in range(TURNS):
            turned = replace(frame, turn=about_z(np.array(angle)) @ frame.turn)
            rows = ring.teeth.find(turned, load, still, reach, None, thorough=True)
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

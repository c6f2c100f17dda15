"""Torque of hysteresis elements along a history of the torsion."""

from __future__ import annotations

import numpy as np

from swgjoint.maps.hysteresis import stretches


def play_hysteresis(elements, torsion, elastic=0.0):
    """Total torque of the elements along a torsion history [N·m]. Shape (n,).

    The elements start relaxed at zero torsion, as after a reset of the simulation
    engine.

    Args:
        elements: Jenkin elements of the drive.
        torsion: History of the torsion [rad]. Shape (n,).
        elastic: History of the elastic torque [N·m]. Shape (n,), or one value.
    """
    total = np.zeros_like(torsion, dtype=float)
    for element in elements:
        total += element.stiffness * stretches(torsion, element.reach(elastic))
    return total

"""Drives of a run that cause a line of a torque spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swgjoint.sim.figures.ripple_validity import HARMONIC_LEVELS

if TYPE_CHECKING:
    from swgjoint.sim.run import Run


def drive_order(run: Run, j: int, order: float) -> float | None:
    """Order of the joint's own drive to which a spectral line belongs.

    Other lines are vibrations of the arm, products of two orders, and orders of other
    joints that reach this one through the arm.

    Args:
        run: The run.
        j: Index of the joint.
        order: Order of the line per input turn.

    Returns:
        Order per input turn; None for lines that are not of the drive.
    """
    attached = run.assembly.transmissions[j].attached
    if attached.level not in HARMONIC_LEVELS or not attached.kept_orders:
        return None
    near = min(attached.kept_orders, key=lambda kept: abs(kept - order))
    turns = np.ptp(run.motor_position[run.steady, j]) / (2.0 * np.pi)
    return near if abs(near - order) <= 0.5 / turns else None


def sharing_joints(run: Run, j: int, order: float) -> list[str]:
    """Other joints whose drives cause a line at the same frequency.

    Their ripple reaches this joint through the arm, and the window of the figures
    cannot tell it from that of the joint's own drive.

    Args:
        run: The run.
        j: Index of the joint.
        order: Order of the line per input turn of the joint.
    """
    turns = np.ptp(run.motor_position[run.steady], axis=0) / (2.0 * np.pi)
    here, names = order * turns[j], []
    for k, transmission in enumerate(run.assembly.transmissions):
        attached = transmission.attached
        if k == j or attached.level not in HARMONIC_LEVELS:
            continue
        waves = np.array(attached.kept_orders) * turns[k]
        if (np.abs(waves - here) <= 0.5).any():
            names.append(run.joints[k])
    return names

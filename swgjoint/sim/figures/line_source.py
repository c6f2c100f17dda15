"""Drives of a run that cause a line of a torque spectrum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swgjoint.joint.drive import JointDrive, input_orders
from swgjoint.sim.figures.orders import lowest_order
from swgjoint.sim.figures.ripple_validity import HARMONIC_LEVELS, SHARE
from swgjoint.typing import Array
from swgjoint.units import arcmin

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


def order_strength(attached: JointDrive) -> Array:
    """Strength of every harmonic of a drive as simulated [rad]. Shape (n_harmonics,).

    It is the amplitude in the kinematic error plus the amplitude in the output torque
    at rated torque, divided by the stiffness. The first harmonic is the mean.

    Args:
        attached: The drive.
    """
    drive = attached.drive
    torsion = drive.mean_torsion(drive.ratings.rated_torque)
    torque = np.hypot(*drive.coefficients(torsion, 1).T)
    return np.asarray(np.hypot(*drive.kinematic_error.T) + torque / attached.stiffness)


def error_ripple(run: Run, joints: Mapping[str, Any]) -> float | None:
    """Twice the strongest transmission-error line at an order of the drive [arcmin].

    Most of the total peak-to-peak value is torsion that follows the load. A joint whose
    input turns too little for the strongest order of its drive does not count.

    Args:
        run: The run.
        joints: Figures of the joints to consider.

    Returns:
        The value; zero if no drive has harmonics, None if no joint counts.
    """
    lines: list[float] = []
    short = False
    for j, name in enumerate(run.joints):
        if name not in joints:
            continue
        if _is_short(run, j):
            short = True
            continue
        lines += [
            2.0 * float(line["amplitude_arcmin"])
            for line in joints[name]["transmission_error_orders"]
            if drive_order(run, j, line["order"]) is not None
        ]
    return max(lines, default=None if short else 0.0)


def error_may_exceed(run: Run, joints: Mapping[str, Any]) -> bool:
    """Whether orders that the step leaves out may raise the largest transmission error.

    The amplitudes of these orders are estimated as for the ripple, see
    :mod:`swgjoint.sim.figures.ripple_validity`, and added to the error of their joint.

    Args:
        run: The run.
        joints: Figures of the joints to consider.
    """
    found = {name: of["transmission_error_arcmin"]["pp"] for name, of in joints.items()}
    largest = max(found.values())
    for name, transmission in zip(run.joints, run.assembly.transmissions, strict=True):
        attached = transmission.attached
        left = 2.0 * sum(
            one.error + one.torque / attached.stiffness for one in attached.unresolved
        )
        whole = found.get(name, 0.0) + left / arcmin
        if name in joints and left > 0.0 and whole > (1.0 + SHARE) * largest:
            return True
    return False


def _is_short(run: Run, j: int) -> bool:
    """Whether a record cannot have a line at the strongest order of its drive."""
    attached = run.assembly.transmissions[j].attached
    if attached.level not in HARMONIC_LEVELS or not attached.kept_orders:
        return False
    order = input_orders(attached.drive)
    waves = order >= lowest_order(np.inf)  # slower ones belong to any record's trend
    strongest = order[(order_strength(attached) * waves).argmax()]
    turns = float(np.ptp(run.motor_position[run.steady, j]) / (2.0 * np.pi))
    return bool(waves.any() and strongest < lowest_order(turns))

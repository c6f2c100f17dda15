"""Time step that resolves the torque ripple of all drives of a run."""

from __future__ import annotations

import numpy as np

from swgjoint.drives.references import find_drive, numbers_map
from swgjoint.gear.design.design import Design
from swgjoint.joint.drive import input_orders
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.figures.ripple_validity import SHARE
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.scene.scene import Scene

STEPS = (1e-3, 5e-4, 2.5e-4, 2e-4, 1e-4, 5e-5)
"""Candidate time steps, longest first [s]."""
PHASE_STEP = 0.25
"""Largest phase advance of the highest relevant order per step [rad]. It is half of
:data:`swgjoint.sim.figures.verdict.PHASE_STEP`, so that the amplitude of this order is
accurate to a few percent."""
TOOTH_ORDERS = 2
"""Highest resolved multiple of the tooth order for a design that has no map yet."""


def resolving_step(scene: Scene, arm: RigidArm) -> float:
    """Largest of :data:`STEPS` that resolves the torque ripple of every drive [s].

    If none does, the function returns the smallest step, and the run reports the orders
    that it leaves out.

    Args:
        scene: Scene of the arm. Its own step only sets the time grid on which the top
            speeds of the joints are determined.
        arm: The arm.
    """
    speed = trajectory_of(scene, arm).top_speed
    needed = STEPS[0]
    for name, top in zip(arm.joints, speed, strict=True):
        section = scene.joint_settings(name)
        if section.level not in (None, "kinematic", "full"):
            continue
        if section.numbers is not None:
            source: DriveMap | Design = numbers_map(section.numbers)
        elif section.drive is not None:
            source = find_drive(section.drive)
        else:
            continue
        rate = needed_order(source) * abs(source.ratio) * float(top)
        if rate > 0.0:
            needed = min(needed, PHASE_STEP / rate)
    return next((step for step in STEPS if step <= needed), STEPS[-1])


def needed_order(source: DriveMap | Design) -> float:
    """Highest order per input turn that contributes to the torque ripple.

    An order contributes if its torque, as :mod:`swgjoint.sim.figures.ripple_validity`
    estimates it, is at least
    :data:`~swgjoint.sim.figures.ripple_validity.SHARE` of the largest such torque. The
    estimate is too large for low orders and would dominate a sum, so the criterion is
    relative to the largest torque instead. For a design, whose map is not computed yet,
    the result is :data:`TOOTH_ORDERS` times the tooth order.

    Args:
        source: Map or design of the drive.

    Returns:
        Order per input turn; zero if the map has no harmonics.
    """
    if isinstance(source, Design):
        return float(TOOTH_ORDERS * source.periodicity)
    torsion = source.mean_torsion(source.ratings.rated_torque)
    torque = np.hypot(*source.coefficients(torsion, 1).T)
    torque = torque + source.mean_stiffness * np.hypot(*source.kinematic_error.T)
    orders, torque = input_orders(source)[1:], torque[1:]
    matters = torque >= SHARE * torque.max(initial=0.0)
    return float(orders[matters & (torque > 0.0)].max(initial=0.0))

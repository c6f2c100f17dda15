"""Checks of motions and links before a simulation starts."""

from __future__ import annotations

import numpy as np

from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.typing import Array
from swgjoint.units import deg, mm

FASTEST = 1e10
"""Largest acceleration of a link by the repeated peak torque of its drive that the
engine accepts [rad/s²]."""


def check_ranges(arm: RigidArm, trajectory: Trajectory, *, where: str) -> None:
    """Reject a motion that leaves the range of a joint, where limits would push back.

    Args:
        arm: The arm.
        trajectory: The commanded motion.
        where: Start of the message.

    Raises:
        InputError: If the motion leaves a range; one line per joint states angle and
            range.
    """
    model, path = arm.model, trajectory.position
    lines = []
    for j, name in enumerate(arm.joints):
        low, high = model.jnt_range[j]
        angles = path[:, j]
        beyond = np.maximum(low - angles, angles - high)
        worst = int(beyond.argmax())
        if not model.jnt_limited[j] or beyond[worst] <= 1e-9:
            continue
        # report the ends first, because the user stated them
        for k, verb in ((0, "starts at"), (-1, "ends at"), (worst, "reaches")):
            if beyond[k] > 1e-9:
                lines.append(
                    f"{where}: trajectory: {name} {verb} {angles[k] / deg:.6g} deg;"
                    f" accepted: {low / deg:.6g} to {high / deg:.6g} deg, its range in"
                    f" {arm.path}"
                )
                break
    if lines:
        raise InputError("\n".join(lines))


def check_link(attached: JointDrive, arm: RigidArm, *, where: str) -> None:
    """Reject a link that is too light for its drive.

    Args:
        attached: The drive of the joint.
        arm: The arm.
        where: Start of the message.

    Raises:
        InputError: If the link is too light; the message names link, inertia and mass.
    """
    torque, inertia = attached.drive.ratings.repeated_peak, attached.link_inertia
    if attached.rotor is None or torque <= FASTEST * inertia:
        return
    model = arm.model
    body = model.body(int(model.joint(attached.joint).bodyid[0]))
    fastest = torque / inertia if inertia else np.inf
    raise InputError(
        f"{where}: joint {attached.joint!r}: link {body.name!r} has {inertia:.2g} kg·m²"
        f" about the joint (its own mass: {body.mass[0]:.2g} kg), so the peak torque"
        f" {torque:.3g} N·m of drive {attached.drive.name!r} would accelerate it by"
        f" {fastest:.1g} rad/s²; accepted: more than"
        f" {torque / FASTEST:.1g} kg·m², that is, a realistic inertia in {arm.path}, or"
        " a joint without a drive"
    )


def touching_bodies(arm: RigidArm, position: Array) -> str:
    """Deepest contacts between bodies in a pose, as text for a message.

    Args:
        arm: The arm.
        position: Joint angles [rad]. Shape (n_joints,).

    Returns:
        Up to three pairs of bodies with their penetration; empty without contacts.
    """
    pairs = arm.contacts(position[None])[:3]
    return ", ".join(f"{a!r} and {b!r} by {depth / mm:.2g} mm" for a, b, depth in pairs)

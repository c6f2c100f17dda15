"""What is wrong with a motion or a link, said before anything is solved."""

from __future__ import annotations

import numpy as np

from swgjoint.errors import InputError
from swgjoint.joint.drive import JointDrive
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.typing import Array
from swgjoint.units import deg, mm

FASTEST = 1e10
"""Acceleration of a link by the largest torque that the engine still carries [rad/s²].
"""


def check_ranges(arm: RigidArm, trajectory: Trajectory, *, where: str) -> None:
    """Refuse a motion that leaves the range of a joint: its limit would push.

    Args:
        arm: The arm.
        trajectory: The commanded motion.
        where: Begins the message.

    Raises:
        InputError: Names joint, angle and range; one line per joint.
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
        # the ends of a motion are what its user gave
        for k, does in ((0, "starts at"), (-1, "ends at"), (worst, "gets to")):
            if beyond[k] > 1e-9:
                lines.append(
                    f"{where}: trajectory: {name} {does} {angles[k] / deg:.6g} deg;"
                    f" accepted: {low / deg:.6g} to {high / deg:.6g} deg, its range in"
                    f" {arm.path}"
                )
                break
    if lines:
        raise InputError("\n".join(lines))


def check_link(attached: JointDrive, arm: RigidArm, *, where: str) -> None:
    """Refuse a link that is too light for its drive.

    Args:
        attached: The drive in the joint.
        arm: The arm.
        where: Begins the message.

    Raises:
        InputError: Names link, inertia and mass.
    """
    torque, inertia = attached.drive.ratings.repeated_peak, attached.link_inertia
    if attached.rotor is None or torque <= FASTEST * inertia:
        return
    model = arm.model
    body = model.body(int(model.joint(attached.joint).bodyid[0]))
    fastest = torque / inertia if inertia else np.inf
    raise InputError(
        f"{where}: joint {attached.joint!r}: link {body.name!r} has {inertia:.2g} kg·m²"
        f" about the joint (its own mass: {body.mass[0]:.2g} kg), which"
        f" {torque:.3g} N·m of drive {attached.drive.name} accelerate by"
        f" {fastest:.1g} rad/s²; needed: more than"
        f" {torque / FASTEST:.1g} kg·m², so an inertia in {arm.path} that a real link"
        " has, or a joint that is not driven"
    )


def touching_bodies(arm: RigidArm, position: Array) -> str:
    """Bodies that press each other in a pose, as part of a message; empty if none.

    Args:
        arm: The arm.
        position: [rad]. Shape (n_joints,).
    """
    pairs = arm.contacts(position[None])[:3]
    return ", ".join(f"{a!r} and {b!r} by {depth / mm:.2g} mm" for a, b, depth in pairs)

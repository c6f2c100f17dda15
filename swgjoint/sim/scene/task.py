"""The task of a scene: what an external controller knows before the motion starts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from swgjoint.drives.sections import MotorLimits
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.controller import KnownArm, KnownJoints, ReadingAge, Task
from swgjoint.sim.sampled_loop import control_period


def task_of(
    assembly: Assembly,
    known_drives: Mapping[str, DriveMap] | None = None,
    known_arm: KnownArm | None = None,
) -> Task:
    """The commanded motion at the control instants, and nominal data of the joints.

    The link torque comes from the controller's model of the arm. It includes weight,
    inertia and the constant load. By default the nominal drives are the simulated ones,
    see :attr:`~swgjoint.sim.figures.transmission.Transmission.told`. They lack the
    effects that their level does not model or the scene disables, and the orders that
    the step cannot resolve.

    Args:
        assembly: The compiled scene.
        known_drives: Drive maps in the controller's model, by joint; other joints use
            the default.
        known_arm: Arm in the controller's model; None uses the arm of the scene,
            without its payload if the payload is not known.

    Returns:
        The task with all arrays sampled once per control period.

    Raises:
        InputError: If ``known_drives`` names an unknown joint, or if ``known_arm`` has
            other joints than the scene.
    """
    known = dict(known_drives or {})
    unknown = sorted(set(known) - set(assembly.joints))
    if unknown:
        raise InputError(
            f"known_drives: no joint {unknown[0]!r}; accepted:"
            f" {', '.join(assembly.joints)}"
        )
    period, every = control_period(assembly)
    path = assembly.trajectory.every(every)
    arm, link_inertia = known_arm or assembly.known_arm, assembly.link_inertia
    if known_arm is not None:
        if known_arm.joints != assembly.joints:
            raise InputError(
                f"known_arm with joints {', '.join(known_arm.joints)}; accepted:"
                f" {', '.join(assembly.joints)}"
            )
        link_inertia = known_arm.inertia(path.position[0])
    if arm is assembly.arm:
        link_torque = assembly.link_torque[::every]
    else:
        motion = path.position, path.velocity, path.acceleration
        link_torque = assembly.load + arm.torques(*motion)
    return Task(
        period=period,
        position=path.position,
        velocity=path.velocity,
        acceleration=path.acceleration,
        link_torque=link_torque,
        reading_age=_reading_age(assembly),
        joints=KnownJoints(
            names=assembly.joints,
            drives=tuple(known.get(t.joint, t.told) for t in assembly.transmissions),
            rotor_inertia=assembly.rotor_inertia,
            link_inertia=link_inertia,
            damping=np.array([t.attached.damping for t in assembly.transmissions]),
            torque_limit=np.array([_limit(one) for one in assembly.loops.limits]),
        ),
    )


def _reading_age(assembly: Assembly) -> ReadingAge:
    """Delays that the scene states for its sensors; zero without sensors."""
    sensors = assembly.scene.sensors
    if sensors is None:
        return ReadingAge()
    each = {"motor": sensors.motor, "link": sensors.link, "torque": sensors.torque}
    return ReadingAge(**{key: one.delay_s for key, one in each.items() if one})


def _limit(limits: MotorLimits | None) -> float:
    """Largest torque of a motor at any speed [N·m]; inf without limits."""
    if limits is None:
        return np.inf
    bounds = (limits.torque, limits.stall_torque_Nm)
    return min((b for b in bounds if b is not None), default=np.inf)

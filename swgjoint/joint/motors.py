"""Actuators of a model's file, moved from a joint to the rotor of its drive."""

from __future__ import annotations

import warnings
from typing import Any

import mujoco
import numpy as np

from swgjoint.joint.obstacles import actuators_on
from swgjoint.joint.place import Place


def clear_armature(spec: mujoco.MjSpec, joint: str) -> None:
    """Let the rotor of the drive be the only one; actuators may bring theirs."""
    for actuator in actuators_on(spec, joint).values():
        actuator.armature = 0.0


def move_to_rotor(
    spec: mujoco.MjSpec, place: Place, rotor: Any, *, ratio: float, reflected: float
) -> None:
    r"""Let the actuators of a joint turn its rotor, in the units of the joint.

    The gear g of an actuator becomes g/i, so that its length is
    :math:`g\,\theta/i`, what an encoder of the motor tells of the link, and its force
    f turns the rotor with g f/i: a drive without losses gives the link g f. Control
    inputs, ranges and gains keep their meaning and their units. The limit of the
    joint's actuator torque goes along.

    What the compiler would take from the joint is written out: the range of
    ``inheritrange``, and the damping of ``dampratio`` for the inertia of rotor and
    link on a rigid drive.

    Args:
        spec: Model to edit.
        place: Of the joint.
        rotor: Hinge of the rotor.
        ratio: Of the drive, signed.
        reflected: Inertia of the rotor at the joint, i²J [kg·m²].
    """
    joint, model = place.joint, place.model
    found = actuators_on(spec, joint.name)
    for k, actuator in found.items():
        if actuator.inheritrange > 0.0:
            actuator.inheritrange = 0.0
            actuator.ctrlrange = model.actuator_ctrlrange[model.actuator_ctrladr[k]]
            actuator.actrange = model.actuator_actrange[k]
        damping = float(model.actuator_biasprm[k, 2])
        if actuator.biasprm[2] > 0.0 > damping:  # a damping ratio to the compiler
            now = place.free_inertia - place.armature + reflected
            actuator.biasprm[2] = damping * np.sqrt(now / place.free_inertia)
        # the engine reflects all three by the square of the gear
        actuator.damping = actuator.damping / np.abs(ratio) ** np.arange(3.0)
        actuator.gear[0] /= ratio
        actuator.target = rotor.name
    if model.jnt_actfrclimited[place.index]:
        limits = model.jnt_actfrcrange[place.index] / ratio
        rotor.actfrclimited = mujoco.mjtLimited.mjLIMITED_TRUE
        rotor.actfrcrange = np.sort(limits)
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    if found:
        _warn_of_sensors(spec, joint.name)


def _warn_of_sensors(spec: mujoco.MjSpec, joint: str) -> None:
    for sensor in spec.sensors:
        on_joint = sensor.type == mujoco.mjtSensor.mjSENS_JOINTACTFRC
        if on_joint and sensor.objname == joint:
            warnings.warn(
                f"sensor {sensor.name!r} reads the torque of actuators at joint"
                f" {joint!r}, where none acts any more; use an actuatorfrc sensor or"
                " JointDrive.observe",
                stacklevel=4,
            )

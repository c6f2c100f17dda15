"""Move the actuators of a model from a joint to the rotor of its drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from swgjoint.joint.place import DrivePlace


def clear_armature(place: DrivePlace) -> None:
    """Remove the armature of a joint's actuators; the rotor replaces it."""
    for actuator in place.actuators.values():
        actuator.armature = 0.0


def move_to_rotor(
    place: DrivePlace,
    rotor: Any,
    *,
    ratio: float,
    reflected: float,
    free: tuple[float, float] | None,
    measured: set[str],
) -> None:
    r"""Move the actuators of a joint to its rotor and keep the units of the joint.

    The gear g of an actuator becomes g/i. Its length is then :math:`g\,\theta/i`, the
    link angle as measured by the motor's encoder, and its force f turns the rotor with
    g f/i, which a lossless drive turns into g f at the link. Control inputs, ranges and
    gains keep their meaning and units. The limit of the joint's actuator torque moves
    to the rotor as well.

    Values that the compiler would derive from the joint are written explicitly. These
    are the ranges that ``inheritrange`` sets and the damping that ``dampratio`` sets;
    that damping is computed for the inertia of rotor and link with a rigid drive.
    Sensors of the joint's actuator torque move as well, see
    :func:`torque_is_actuators`.

    Args:
        place: Position, actuators and sensors of the joint.
        rotor: Hinge of the rotor.
        ratio: Signed ratio of the drive [-].
        reflected: Rotor inertia reflected to the link, i²J [kg·m²].
        free: Inertias from :func:`swgjoint.joint.place.free_inertias` [kg·m²]; None if
            no actuator of the joint states a damping ratio.
        measured: Names of the actuators whose force a sensor of the file reads.
    """
    joint, model = place.joint, place.model
    exact = torque_is_actuators(place, measured)
    for k, actuator in place.actuators.items():
        if actuator.inheritrange > 0.0:
            actuator.inheritrange = 0.0
            actuator.ctrlrange = model.actuator_ctrlrange[model.actuator_ctrladr[k]]
            actuator.actrange = model.actuator_actrange[k]
        damping = float(model.actuator_biasprm[k, 2])
        if actuator.biasprm[2] > 0.0 > damping:  # the compiler reads a damping ratio
            assert free is not None
            actuator.biasprm[2] = damping * np.sqrt((free[1] + reflected) / free[0])
        # the engine multiplies all three coefficients by the square of the gear
        actuator.damping = actuator.damping / np.abs(ratio) ** np.arange(3.0)
        actuator.gear[0] /= ratio
        actuator.target = rotor.name
    limited = bool(model.jnt_actfrclimited[place.index])
    if limited:
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    if exact:
        [(k, actuator)] = place.actuators.items()
        actuator.name = actuator.name or rotor.name
        if limited:
            actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            actuator.forcerange = _common_range(place, k)
    elif limited:
        rotor.actfrclimited = mujoco.mjtLimited.mjLIMITED_TRUE
        rotor.actfrcrange = np.sort(model.jnt_actfrcrange[place.index] / ratio)
    for sensor in place.sensors if place.actuators else ():
        if exact:
            sensor.type = mujoco.mjtSensor.mjSENS_ACTUATORFRC
            sensor.objtype = mujoco.mjtObj.mjOBJ_ACTUATOR
            sensor.objname = actuator.name
        else:
            sensor.objname = rotor.name


def torque_is_actuators(place: DrivePlace, measured: set[str]) -> bool:
    """Whether sensors of the joint's actuator torque can read an actuator instead.

    This is possible for a single actuator of gear 1, whose force equals the torque. A
    limit of the joint's actuator torque then becomes a limit of that force, unless
    another sensor reads the force without that limit.

    Args:
        place: Position, actuators and sensors of the joint.
        measured: Names of the actuators whose force a sensor of the file reads.
    """
    if not place.sensors or len(place.actuators) != 1:
        return False
    [(k, actuator)] = place.actuators.items()
    model = place.model
    if model.actuator_gear[k, 0] != 1.0:
        return False
    if not model.jnt_actfrclimited[place.index]:
        return True
    low, high = _common_range(place, k)
    return actuator.name not in measured and bool(low < high)


def _common_range(place: DrivePlace, k: int) -> Any:
    """Intersection of the force ranges of an actuator and its joint [N·m]."""
    model = place.model
    joint = model.jnt_actfrcrange[place.index]
    if not model.actuator_forcelimited[k]:
        return joint.copy()
    low, high = model.actuator_forcerange[k]
    return np.array([max(low, joint[0]), min(high, joint[1])])


def misread_sensors(
    places: Mapping[str, DrivePlace], measured: set[str]
) -> dict[str, str]:
    """Sensors of joint torque that will read the torque at the rotor.

    Args:
        places: Joints by name.
        measured: Names of the actuators whose force a sensor of the file reads.

    Returns:
        Joint name by sensor name.
    """
    return {
        sensor.name or f"of joint {name}": name
        for name, place in places.items()
        if place.actuators and not torque_is_actuators(place, measured)
        for sensor in place.sensors
    }

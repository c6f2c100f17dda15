r"""Whether the control loop of a scene is unstable about a posture, and at which joint.

A run that diverges does not show whether its time step or its controller is at fault.
The linear model of the scene (:mod:`swgjoint.sim.linearisation`) with the law of the
scene's controller

.. math:: u_k = -K_p\, y_k - K_d\, w_k + K_i\, z_k, \qquad z_{k+1} = z_k - T y_k

has growing modes if the controller is. Here y are the deviations of the angles that the
controller holds, w those of the motor speeds and T is the control period. Delays of
sensors are rounded to control periods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swgjoint.errors import SwgError
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.control import DEFAULT_DAMPING_RATIO, DEFAULT_FREQUENCY
from swgjoint.sim.linearisation import LinearScene, linearise
from swgjoint.sim.own_drives import scene_of_run
from swgjoint.sim.sampled_loop import control_period
from swgjoint.typing import Array

GROWING = 1e-4
"""Smallest growth of a mode in a control period that counts as unstable [-], above the
error of the differences."""
RESOLVED = 0.5
"""Largest phase advance of a mode in a control period [rad] for which the period does
not matter. Faster modes of the engine's own controller are not judged, because the
engine integrates them in another way."""


@dataclass(frozen=True, kw_only=True)
class GrowingMode:
    """The fastest growing mode of a control loop."""

    joint: str
    """Joint with the largest kinetic energy in the mode."""
    frequency: float
    """Frequency [Hz]."""
    doubling: float
    """Time in which its amplitude doubles [s]."""
    sampled: bool
    """Whether it is so fast that the control period matters."""


def explain_divergence(assembly: Assembly) -> str | None:
    """Say that the scene's controller is unstable; None if it is not, or not known.

    Args:
        assembly: The compiled scene of a run that diverged.
    """
    if assembly.controlled_by is not None:
        return None
    try:
        mode = growing_mode(assembly)
    except SwgError:  # such as a posture in which bodies touch
        return None
    if mode is None:
        return None
    section = assembly.scene.controller
    if section.stiffness_Nm_rad is not None:
        key, value = "stiffness_Nm_rad", section.stiffness_Nm_rad
    else:
        key = "natural_frequency_Hz"
        value = section.natural_frequency_Hz or DEFAULT_FREQUENCY
    others, where = [], ""
    if mode.sampled:
        period = control_period(assembly)[0]
        where = f" (the control period is {1e3 * period:g} ms)"
        stated = section.control_period_s is not None
        shorter = "controller.control_period_s" if stated else "simulation.step_s"
        others.append(f"a shorter {shorter}")
    if section.feedback == "link":
        others.append("controller.feedback = motor")
    if section.kind == "pid":
        others.append("a longer controller.integral_time_s")
    if section.stiffness_Nm_rad is None:
        ratio = section.damping_ratio or DEFAULT_DAMPING_RATIO
        others.append(f"another controller.damping_ratio (now {ratio:g})")
    remedies = ", or ".join([f"use a lower controller.{key}", *others])
    return (
        f"the controller is unstable at {mode.joint} with"
        f" controller.{key} = {value:g} and feedback of the {section.feedback} angles:"
        f" a vibration of {mode.frequency:.3g} Hz{where} doubles in"
        f" {mode.doubling:.2g} s; {remedies}"
    )


def growing_mode(assembly: Assembly) -> GrowingMode | None:
    """Fastest growing mode about the start or the end of the motion; None without any.

    Args:
        assembly: The compiled scene, without an external controller.

    Raises:
        SwgError: If no linear model exists.
    """
    scene, drives = scene_of_run(assembly)
    path = assembly.trajectory.position
    for position in (path[0], path[-1]):
        posture = dict(zip(assembly.joints, position.tolist(), strict=True))
        model = linearise(scene, drives=drives, posture=posture)
        values, vectors = np.linalg.eig(closed_loop(assembly, model, position))
        growth = np.abs(values)
        if not assembly.loops.sampled:
            growth = np.where(np.abs(np.angle(values)) > RESOLVED, 0.0, growth)
        worst = int(np.argmax(growth))
        if growth[worst] > 1.0 + GROWING:
            # a real eigenvalue is negative if the sign changes every period
            rate = np.log(complex(values[worst])) / model.period
            return GrowingMode(
                joint=_busiest(assembly, model, vectors[:, worst]),
                frequency=float(np.abs(rate.imag) / (2.0 * np.pi)),
                doubling=float(np.log(2.0) / rate.real),
                sampled=bool(np.abs(rate.imag) * model.period > RESOLVED),
            )
    return None


def closed_loop(assembly: Assembly, model: LinearScene, position: Array) -> Array:
    """Matrix of the scene with its controller over a control period.

    The states are those of the linear model, the integrals, and the readings that
    delayed sensors have yet to deliver.

    Args:
        assembly: The compiled scene.
        model: Its linear model.
        position: Link angles of the posture [rad]. Shape (n_joints,).
    """
    section, loops = assembly.scene.controller, assembly.loops
    joints, n = len(assembly.joints), model.A.shape[0]
    rows = np.arange(joints)
    by_link = section.feedback == "link"
    # motor angles, motor speeds and link angles are the first outputs of the model
    angle = model.C[2 * joints + rows] if by_link else model.C[rows]
    if by_link:
        angle = assembly.ratio[:, None] * angle
    speed = model.C[joints + rows]
    late_angle, late_speed = _delays(assembly, model.period, by_link=by_link)
    stiffness, damping = np.diag(loops.stiffness), np.diag(loops.damping)
    if section.kind == "computed_torque":
        rotors = assembly.rotor_inertia * assembly.ratio**2
        whole = _inertia(assembly, position) + np.diag(rotors)
        # gains per inertia of the joint, times the whole inertia at the motors
        own = rotors + assembly.link_inertia
        scaled = whole / np.outer(assembly.ratio, assembly.ratio)
        stiffness = scaled @ np.diag(loops.stiffness * assembly.ratio**2 / own)
        damping = scaled @ np.diag(loops.damping * assembly.ratio**2 / own)

    depth = max(late_angle, late_speed)
    size = n + joints + 2 * joints * depth
    step = np.zeros((size, size))
    read = np.zeros((2 * joints, size))  # readings of this instant, without delay
    read[:joints, :n], read[joints:, :n] = angle, speed

    def reading(late: int, part: slice) -> Array:
        if late == 0:
            return read[part]
        one = np.zeros((joints, size))
        first = n + joints + 2 * joints * (late - 1) + part.start
        one[:, first : first + joints] = np.eye(joints)
        return one

    held = reading(late_angle, slice(0, joints))
    torque = -stiffness @ held - damping @ reading(
        late_speed, slice(joints, 2 * joints)
    )
    integral = slice(n, n + joints)
    torque[:, integral] += np.diag(loops.integral)
    step[:n, :n] = model.A
    step[:n] += model.B @ torque
    step[integral, integral] = np.eye(joints)
    step[integral] -= model.period * held
    for k in range(depth):  # readings age by one period
        new = slice(n + joints + 2 * joints * k, n + joints + 2 * joints * (k + 1))
        if k == 0:
            step[new] = read
        else:
            step[new, new.start - 2 * joints : new.start] = np.eye(2 * joints)
    return step


def _delays(assembly: Assembly, period: float, *, by_link: bool) -> tuple[int, int]:
    """Ages of the angle and the speed that the controller reads [control periods]."""
    sensors = assembly.scene.sensors
    motor = sensors.motor.delay_s if sensors and sensors.motor else 0.0
    link = sensors.link.delay_s if sensors and sensors.link else 0.0
    return round((link if by_link else motor) / period), round(motor / period)


def _inertia(assembly: Assembly, position: Array) -> Array:
    """Mass matrix of the arm in the controller's model [kg·m²]. Shape (n, n)."""
    n = len(position)
    still = np.tile(position, (n + 1, 1))
    rest = np.zeros_like(still)
    accelerated = np.vstack([np.zeros(n), np.eye(n)])
    torques = assembly.known_arm.torques(still, rest, accelerated)
    return np.asarray((torques[1:] - torques[0]).T)


def _busiest(assembly: Assembly, model: LinearScene, mode: Array) -> str:
    """Joint whose motor and link have the largest kinetic energy in a mode."""
    energy = np.zeros(len(assembly.joints))
    for k, name in enumerate(model.states):
        joint, _, kind = name.rpartition(".")
        if joint in assembly.joints and kind in ("motor_speed", "link_speed"):
            j = assembly.joints.index(joint)
            of_motor = kind == "motor_speed"
            inertia = assembly.rotor_inertia if of_motor else assembly.link_inertia
            energy[j] += float(inertia[j] * np.abs(mode[k]) ** 2)
    return assembly.joints[int(np.argmax(energy))]

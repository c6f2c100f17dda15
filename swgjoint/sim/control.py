"""Motor-side position control: gains, feed-forward, actuators, inputs per step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.sim.scene_sections import Controller, FeedForward
from swgjoint.sim.transmission import Transmission

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly

Array = NDArray[np.float64]

DEFAULT_FREQUENCY = 8.0
"""Natural frequency of the motor control where a scene gives none [Hz]."""
DEFAULT_DAMPING_RATIO = 1.0


def control_gains(section: Controller, inertia: Array) -> tuple[Array, Array]:
    """Motor-side gains on angle [N·m/rad] and speed [N·m·s/rad]. Shapes (n_joints,).

    Args:
        section: The scene's controller.
        inertia: Of motor and link at the motor [kg·m²]. Shape (n_joints,).
    """
    if section.stiffness_Nm_rad is not None and section.damping_Nms_rad is not None:
        one = np.ones_like(inertia)
        return section.stiffness_Nm_rad * one, section.damping_Nms_rad * one
    omega = 2.0 * np.pi * (section.natural_frequency_Hz or DEFAULT_FREQUENCY)
    zeta = section.damping_ratio or DEFAULT_DAMPING_RATIO
    return inertia * omega**2, 2.0 * zeta * omega * inertia


def answer_speed(section: Controller, jump: Array) -> Array:
    r"""Largest speed of the answer to a step, of a rigid drive without limits [rad/s].

    Of the oscillator with the loop's :math:`\omega, \zeta`, whose velocity loop sees no
    step: :math:`A\omega\,e^{-\zeta\varphi/\sin\varphi}` with
    :math:`\cos\varphi = \zeta`, and :math:`A\omega/e` from :math:`\zeta = 1` on. Gains
    that are given outright: those of the default frequency.

    Args:
        section: The scene's controller.
        jump: Of every joint [rad]. Shape (n_joints,).
    """
    omega = 2.0 * np.pi * (section.natural_frequency_Hz or DEFAULT_FREQUENCY)
    zeta = min(section.damping_ratio or DEFAULT_DAMPING_RATIO, 1.0)
    phi = np.arccos(zeta)
    decay = zeta * float(phi / np.sin(phi)) if phi else 1.0
    return np.asarray(np.abs(jump) * omega * np.exp(-decay))


def feedforward(
    kind: FeedForward,
    *,
    weight: Array,
    link_torque: Array,
    acceleration: Array,
    ratio: Array,
    rotor_inertia: Array,
) -> Array:
    """Motor torque of the feed-forward [N·m].

    Args:
        kind: ``none``, ``gravity`` or ``gravity_inertia``.
        weight: Drive torque that carries weight and load. Shape (n, n_joints).
        link_torque: Drive torque on the whole motion. Shape (n, n_joints).
        acceleration: Of the links [rad/s²]. Shape (n, n_joints).
        ratio: Signed ratios. Shape (n_joints,).
        rotor_inertia: [kg·m²]. Shape (n_joints,).
    """
    if kind == "none":
        return np.zeros_like(weight)
    if kind == "gravity":
        return weight / ratio
    return link_torque / ratio + ratio * rotor_inertia * acceleration


def add_actuators(
    spec: mujoco.MjSpec,
    transmissions: Sequence[Transmission],
    stiffness: Array,
    damping: Array,
    load: Array,
) -> None:
    """A motor with its control loop on every joint, and a load where there is one.

    Control inputs in this order: all motors, then the loads that are not zero.

    The loop is the actuator's own affine law, torque = control - kp angle - kd speed,
    because MuJoCo then solves it within the step: a light rotor under a stiff loop
    stays stable where a loop evaluated once per step would not. Without a rotor the
    motor acts on the joint through the gear, so angle and speed are the motor's too.
    """
    for actuator in list(spec.actuators):
        spec.delete(actuator)  # motors of the arm's file would act beside ours
    for t, kp, kd in zip(transmissions, stiffness, damping, strict=True):
        rigid = t.law is None
        motor = spec.add_actuator(
            name=f"{t.joint}_motor",
            target=t.joint if rigid else t.attached.rotor,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        )
        motor.gear[0] = t.ratio if rigid else 1.0
        motor.gainprm[0] = 1.0
        motor.biasprm[:3] = [0.0, -kp, -kd]
    for t, torque in zip(transmissions, load, strict=True):
        if torque:
            against = spec.add_actuator(
                name=f"{t.joint}_load",
                target=t.joint,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
            )
            against.gear[0] = -1.0


def control_inputs(assembly: Assembly) -> Array:
    """Actuator inputs of every step, motors then loads. Shape (n_steps, n_inputs).

    The integrator ``discrete`` evaluates the loop at the end of the step, so the
    reference of that instant goes in; others evaluate it at the start. At level
    ``kinematic`` the angle that the loop sees is off by the prescribed error, and the
    rotor's inertia acts against that error's acceleration; see
    :mod:`swgjoint.joint.prescribed`.
    """
    path, ratio = assembly.trajectory, assembly.ratio
    inputs = (
        assembly.stiffness * ratio * (path.position + assembly.prescribed)
        + assembly.damping * ratio * (path.velocity + assembly.prescribed_rate)
        + assembly.feedforward
    )
    at_end = assembly.scene.simulation.integrator == "discrete"
    steps = inputs[1:] if at_end else inputs[:-1]
    acceleration = np.diff(assembly.prescribed_rate, axis=0) / assembly.step
    steps = steps + assembly.rotor_inertia * ratio * acceleration
    load = assembly.load[assembly.load != 0.0]
    return np.hstack([steps, np.broadcast_to(load, (len(steps), load.size))])


def motor_torque(assembly: Assembly, theta: Array, theta_rate: Array) -> Array:
    """Torque of every motor in the recorded states [N·m]. Shapes (n, n_joints)."""
    path, ratio = assembly.trajectory, assembly.ratio
    return np.asarray(
        assembly.stiffness * (ratio * path.position - theta)
        + assembly.damping * (ratio * path.velocity - theta_rate)
        + assembly.feedforward
    )

"""Motor-side position control: gains and feed-forward."""

from __future__ import annotations

import numpy as np

from swgjoint.sim.scene.sections import ControllerSection, FeedForward
from swgjoint.typing import Array

DEFAULT_FREQUENCY = 8.0
"""Natural frequency of the motor control unless a scene states one [Hz]."""
DEFAULT_DAMPING_RATIO = 1.0
"""Damping ratio of the motor control unless a scene states one."""
INTEGRAL_TIME = 4.0
"""Integral time of a PID loop times its natural frequency in rad/s, dimensionless. The
loop is stable above 1/(2 zeta)."""


def control_gains(section: ControllerSection, inertia: Array) -> tuple[Array, Array]:
    """Motor-side gains on angle [N·m/rad] and speed [N·m·s/rad]. Shapes (n_joints,).

    Args:
        section: The scene's controller.
        inertia: Inertia of motor and link, reduced to the motor [kg·m²]. Shape
            (n_joints,).
    """
    if section.stiffness_Nm_rad is not None and section.damping_Nms_rad is not None:
        one = np.ones_like(inertia)
        return section.stiffness_Nm_rad * one, section.damping_Nms_rad * one
    omega = 2.0 * np.pi * (section.natural_frequency_Hz or DEFAULT_FREQUENCY)
    zeta = section.damping_ratio or DEFAULT_DAMPING_RATIO
    return inertia * omega**2, 2.0 * zeta * omega * inertia


def integral_gain(
    section: ControllerSection, stiffness: Array, inertia: Array
) -> Array:
    """Gain on the integral of the motor angle error [N·m/(rad·s)]. Shape (n_joints,).

    Args:
        section: The scene's controller.
        stiffness: Gain on the motor angle [N·m/rad]. Shape (n_joints,).
        inertia: Inertia of motor and link, reduced to the motor [kg·m²]. Shape
            (n_joints,).
    """
    if section.kind != "pid":
        return np.zeros_like(stiffness)
    if section.integral_time_s is not None:
        return stiffness / section.integral_time_s
    return np.asarray(stiffness * np.sqrt(stiffness / inertia) / INTEGRAL_TIME)


def answer_speed(section: ControllerSection, jump: Array) -> Array:
    r"""Largest joint speed of the step response, rigid drive without limits [rad/s].

    It is that of the oscillator with the loop's :math:`\omega, \zeta`, in which the
    step enters the position loop only:
    :math:`A\omega\,e^{-\zeta\varphi/\sin\varphi}` with :math:`\cos\varphi = \zeta`,
    and :math:`A\omega/e` for :math:`\zeta \ge 1`. If the scene states gains instead of
    a natural frequency, the default frequency is assumed.

    Args:
        section: The scene's controller.
        jump: Height of the step of every joint [rad]. Shape (n_joints,).

    Returns:
        Largest speed of every joint [rad/s]. Shape (n_joints,).
    """
    omega = 2.0 * np.pi * (section.natural_frequency_Hz or DEFAULT_FREQUENCY)
    zeta = min(section.damping_ratio or DEFAULT_DAMPING_RATIO, 1.0)
    phi = np.arccos(zeta)
    decay = zeta * float(phi / np.sin(phi)) if phi else 1.0
    return np.asarray(np.abs(jump) * omega * np.exp(-decay))


def feedforward(
    kind: FeedForward,
    *,
    link_torque: Array,
    acceleration: Array,
    ratio: Array,
    rotor_inertia: Array,
) -> Array:
    """Motor torque of the feed-forward [N·m].

    Args:
        kind: ``none``, ``gravity`` or ``gravity_inertia``.
        link_torque: Drive torque that carries weight and load, for
            ``gravity_inertia`` that of the whole motion [N·m]. Shape (n, n_joints).
        acceleration: Link accelerations [rad/s²]. Shape (n, n_joints).
        ratio: Signed ratios i, output = input / i. Shape (n_joints,).
        rotor_inertia: Rotor inertias about the motor axes [kg·m²]. Shape (n_joints,).

    Returns:
        Motor torques [N·m]. Shape (n, n_joints).
    """
    if kind == "none":
        return np.zeros_like(link_torque)
    if kind == "gravity":
        return link_torque / ratio
    return link_torque / ratio + ratio * rotor_inertia * acceleration

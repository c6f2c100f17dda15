"""Motor-side position control: gains and feed-forward."""

from __future__ import annotations

import numpy as np

from swgjoint.sim.scene.sections import ControllerSection, FeedForward
from swgjoint.typing import Array

DEFAULT_FREQUENCY = 8.0
"""Natural frequency of the position loop unless the scene states one [Hz]."""
DEFAULT_DAMPING_RATIO = 1.0
"""Damping ratio of the position loop unless the scene states one [-]."""
INTEGRAL_TIME = 4.0
"""Integral time of a PID loop, as a multiple of the reciprocal natural frequency in
rad/s [-]. The loop with a rigid drive is stable for values above 1/(2 zeta)."""


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
    r"""Largest joint speed of the step response with a rigid drive and no limits.

    The joint is an oscillator with the loop's natural frequency :math:`\omega` and
    damping ratio :math:`\zeta`. A step of height A in the reference angle, without a
    reference speed, gives the largest speed
    :math:`A\omega\,e^{-\zeta\varphi/\sin\varphi}` with :math:`\cos\varphi = \zeta`. For
    :math:`\zeta > 1` the value at :math:`\zeta = 1`, :math:`A\omega/e`, is an upper
    bound. If the scene states gains instead of a natural frequency, the function uses
    the default natural frequency and damping ratio.

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
        link_torque: Drive torque on the commanded motion [N·m]: that of weight and load
            for ``gravity``, with the inertia of the arm for ``gravity_inertia``. Shape
            (n, n_joints).
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

"""Initial state of a run: the drives carry the load from the first instant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from swgjoint.errors import ComputationError, InputError
from swgjoint.joint.response import responses
from swgjoint.sim.figures.transmission import Transmission
from swgjoint.sim.motion.start_check import touching_bodies
from swgjoint.typing import Array

if TYPE_CHECKING:
    from swgjoint.sim.assembly import Assembly


RTOL = 1e-9
"""Largest accepted torque residual of an equilibrium, relative to the rated torque. The
recording only resolves 1e-6 of the rated torque."""


def start_state(assembly: Assembly) -> tuple[Array, Array]:
    """Positions and velocities at the first instant, free of start-up ringing.

    Every link starts at the angle at which its drive carries weight and load. If a
    joint starts at rest, its motor starts at the angle at which feed-forward torque,
    control loop and drive balance. The loop acts on the angle that it reads, which is
    that of the motor or of the link. The gains of computed torque depend on the pose,
    so with an unknown payload such a joint starts close to its equilibrium but not
    exactly in it.

    If a joint starts in motion, its motor starts on the reference with the reference
    speed. The link starts with the rate at which its equilibrium angle moves, because
    kinematic error makes the link speed vary even at uniform motor speed.

    Returns:
        qpos and qvel of the compiled model.

    Raises:
        InputError: If a drive has no equilibrium because bodies are in contact.
        ComputationError: If a drive has no equilibrium for another reason.
    """
    path, h = assembly.trajectory, assembly.step
    try:
        theta, psi = _balance(assembly, 0.0)
    except ComputationError as exc:
        touching = touching_bodies(assembly.arm, path.position[0])
        if not touching:
            raise
        raise InputError(
            f"{assembly.scene.where}: trajectory.start_deg: bodies penetrate each other"
            f" at the start: {touching}; accepted: a pose without contact, or an"
            f" <exclude> of the pair in {assembly.arm.path}"
        ) from exc
    link_rate = path.velocity[0].copy()
    if link_rate.any():
        # a tenth of a step is short compared with the period of every resolved order
        (_, before), (_, after) = _balance(assembly, -0.1), _balance(assembly, 0.1)
        moving = link_rate != 0.0
        link_rate[moving] = ((after - before) / (0.2 * h))[moving]
    # a prescribed error adds its rate, computed with the difference scheme of the
    # integrator
    stiff = assembly.motor_position < 0
    link_rate[stiff] = (path.velocity[0] + assembly.prescribed_rate[0])[stiff]
    model = assembly.model
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    flexible = assembly.motor_position >= 0
    qpos[assembly.link_position], qvel[assembly.link_velocity] = psi, link_rate
    qpos[assembly.motor_position[flexible]] = theta[flexible]
    motor_rate = path.velocity[0] * assembly.ratio
    qvel[assembly.motor_velocity[flexible]] = motor_rate[flexible]
    if assembly.bearings:
        qpos[assembly.tilt_position] = _tilts(assembly, qpos)
    return qpos, qvel


def set_start(assembly: Assembly, data: mujoco.MjData) -> None:
    """Put a simulation into its initial state, including the state of the plugin.

    The plugin predicts a step from the accelerations that all forces except those of
    the drive caused in the previous step. In equilibrium, these accelerations cancel
    those of the drive, so their initial values follow from the drive torques. With
    zeros instead, the plugin would predict the first step as if the load were released.

    Args:
        assembly: The compiled scene.
        data: Engine data of its model; overwritten.

    Raises:
        InputError: See :func:`start_state`.
        ComputationError: See :func:`start_state`.
    """
    model = assembly.model
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = start_state(assembly)
    mujoco.mj_forward(model, data)
    for j, transmission in enumerate(assembly.transmissions):
        plugin = transmission.attached.plugin
        # hysteresis starts relaxed, so only the elastic law carries the initial load
        for name in transmission.attached.hysteresis:
            tendon = int(model.tendon(name).id)
            rest = int(model.tendon_plasticadr[tendon])
            data.plastic[rest : rest + 2] = data.ten_length[tendon]
        if transmission.law is None or plugin is None:
            continue
        rotor, link = assembly.motor_velocity[j], assembly.link_velocity[j]
        theta = float(data.qpos[assembly.motor_position[j]])
        psi = float(data.qpos[assembly.link_position[j]])
        on_input, on_output = transmission.law.forces(theta, psi)
        instance = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PLUGIN, plugin)
        first = model.plugin_stateadr[instance]
        weight = responses(model, data.qLD, data.qLDiagInv, (rotor, link))
        data.plugin_state[first : first + 2] = -weight * [
            float(on_input),
            float(on_output),
        ]
        torsion = float(transmission.law.torsion(theta, psi))
        elements = len(transmission.attached.elements)
        data.plugin_state[first + 2 : first + 2 + elements] = torsion
    mujoco.mj_forward(model, data)


def _tilts(assembly: Assembly, qpos: Array) -> Array:
    """Tilts of the output bearings under the weight of the arm [rad]. Shape (n_tilts,).

    Args:
        assembly: The compiled scene, with output bearings.
        qpos: Positions of the model, with untilted bearings.
    """
    model, data = assembly.model, mujoco.MjData(assembly.model)
    stiffness = np.repeat([b.tilt_stiffness for b in assembly.bearings.values()], 2)
    tilts = np.zeros(len(stiffness))
    for _ in range(20):  # each pass gains a factor of weight moment over stiffness
        data.qpos[:] = qpos
        data.qpos[assembly.tilt_position] = tilts
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        last, tilts = tilts, -data.qfrc_bias[assembly.tilt_velocity] / stiffness
        if np.abs(tilts - last).max() < 1e-13:
            break
    return np.asarray(tilts)


def _balance(assembly: Assembly, shift: float) -> tuple[Array, Array]:
    """Motor and link angles in equilibrium, ``shift`` steps after the start.

    The weight torques depend on the sag of all joints. A fixed-point iteration solves
    the joints one by one with the weight torques of the previous pose. Because the
    drives are stiff, each pass reduces the error by the ratio of the gradient of the
    weight torque to the torsional stiffness, which is 1e-2 or less.

    Args:
        assembly: The compiled scene.
        shift: Time after the start in engine steps, between -1 and 1.

    Returns:
        Motor and link angles [rad]. Shapes (n_joints,).
    """

    def at(samples: Array) -> Array:
        return np.asarray(samples[0] + shift * (samples[1] - samples[0]))

    arm, ratio = assembly.arm, assembly.ratio
    reference = at(assembly.trajectory.position)
    link_torque, motor_torque = at(assembly.link_torque), at(assembly.feedforward)
    moving = assembly.trajectory.velocity[0] != 0.0
    by_link = assembly.scene.controller.feedback == "link"
    theta, psi = ratio * reference, reference.copy()
    commanded = arm.gravity(reference[None])[0]
    for turn in range(30):
        needed = link_torque + arm.gravity(psi[None])[0] - commanded
        last = psi.copy()
        for j, transmission in enumerate(assembly.transmissions):
            if transmission.law is None:
                error = transmission.attached.prescribed_error(theta[j])
                psi[j] = reference[j] + float(error)
            elif moving[j]:
                psi[j] = link_equilibrium(
                    transmission,
                    theta[j],
                    float(needed[j]),
                    guess=float(psi[j]) if turn else None,
                )
            else:
                # link feedback advances the motor reference by the torsion
                ahead = theta[j] - ratio[j] * psi[j] if by_link else 0.0
                theta[j], psi[j] = joint_equilibrium(
                    transmission,
                    output_torque=float(needed[j]),
                    motor_reference=float(ratio[j] * reference[j] + ahead),
                    motor_torque=float(motor_torque[j]),
                    stiffness=float(assembly.loops.stiffness[j]),
                    guess=(float(theta[j]), float(psi[j])) if turn else None,
                )
        if np.abs(psi - last).max() < 1e-13:
            break
    return theta, psi


def link_equilibrium(
    transmission: Transmission,
    theta: float,
    output_torque: float,
    *,
    guess: float | None = None,
) -> float:
    """Link angle at which a drive with its motor held exerts a torque [rad].

    Args:
        transmission: A drive with a torque law between motor and link.
        theta: Motor angle [rad].
        output_torque: Torque that the drive exerts on the link [N·m].
        guess: Link angle near the solution [rad]; None starts from the mean torsion
            curve.

    Raises:
        ComputationError: If the iteration does not converge.
    """
    law, rated = transmission.law, transmission.drive.ratings.rated_torque
    assert law is not None
    if guess is None:
        error = law.error_at(law.phases(theta, theta / law.ratio))[0]
        guess = theta / law.ratio + float(error) - law.mean_torsion(output_torque)
    psi, softest = guess, 1e-3 * law.mean_stiffness
    for _ in range(50):
        value = float(law.forces(theta, psi)[1]) - output_torque
        if abs(value) <= RTOL * rated:
            return psi
        # the slope of output torque over link angle is about minus the stiffness
        rise = law.forces(theta, psi + 1e-8)[1] - law.forces(theta, psi - 1e-8)[1]
        slope = min(float(rise) / 2e-8, -softest)
        psi -= value / slope
    raise ComputationError(_message(transmission, output_torque, abs(value)))


def joint_equilibrium(
    transmission: Transmission,
    *,
    output_torque: float,
    motor_reference: float,
    motor_torque: float,
    stiffness: float,
    guess: tuple[float, float] | None = None,
) -> tuple[float, float]:
    r"""Motor and link angle at which one drive rests under a torque.

    The angles minimise :math:`V(\theta, \psi) + T\psi - \tau\theta
    + \tfrac12 k_p (\theta - \theta_r)^2` with the elastic energy V, the output torque
    T, the feed-forward torque :math:`\tau` and the loop stiffness :math:`k_p`. With
    cogging there may be several minima; the result is the minimum that a descent from
    the initial guess reaches.

    Args:
        transmission: A drive with a torque law between motor and link.
        output_torque: Torque that the drive exerts on the link [N·m].
        motor_reference: Commanded motor angle [rad].
        motor_torque: Feed-forward torque of the motor [N·m].
        stiffness: Proportional gain of the motor's position loop [N·m/rad].
        guess: Motor and link angle near the solution [rad], for example those at a
            similar torque; None starts from the motor reference.

    Returns:
        Motor and link angle [rad].

    Raises:
        ComputationError: If the descent does not converge.
    """
    law, rated = transmission.law, transmission.drive.ratings.rated_torque
    assert law is not None
    # the unknowns x are motor angle over ratio and link angle; the curvature is then of
    # the order of the torsional stiffness in both
    scale = np.array([law.ratio, 1.0])
    # limit the steps, so that the descent does not skip a minimum of the cogging energy
    longest = 0.1 / max(float(np.abs(law.angle_orders[:, 0]).max()), 1.0)

    def energy(x: Array) -> float:
        theta, psi = scale * x
        off = theta - motor_reference
        stored = law.energy(law.torsion(theta, psi), theta, psi)
        return float(
            stored + output_torque * psi - motor_torque * off + 0.5 * stiffness * off**2
        )

    def gradient(x: Array) -> Array:
        theta, psi = scale * x
        on_input, on_output = law.forces(theta, psi)
        motor = motor_torque + stiffness * (motor_reference - theta)
        return np.asarray(
            scale * np.array([-on_input - motor, output_torque - on_output])
        )

    if guess is None:
        held = link_equilibrium(transmission, motor_reference, output_torque)
        guess = motor_reference, held
    x = np.array(guess) / scale
    step = 1e-9  # for differences of the gradient [rad]; the torsion is about 1e-3 rad
    for _ in range(500):
        value = gradient(x)
        if np.abs(value).max() <= RTOL * rated:
            theta, psi = scale * x
            return float(theta), float(psi)
        bend = np.column_stack(
            [
                (gradient(x + step * unit) - gradient(x - step * unit)) / (2.0 * step)
                for unit in np.eye(2)
            ]
        )
        # with the absolute curvatures, a Newton step descends even where the energy is
        # not convex
        size, axes = np.linalg.eigh(0.5 * (bend + bend.T))
        size = np.maximum(np.abs(size), 1e-9 * np.abs(size).max())
        move = -axes @ ((axes.T @ value) / size)
        move *= min(1.0, longest / max(abs(law.ratio * move[0]), 1e-300))
        here, share = energy(x), 1.0
        # a tolerance, so that round-off of the energy does not stop the last steps
        slack = 1e-13 * (abs(here) + rated)
        while energy(x + share * move) > here + slack and share > 1e-6:
            share *= 0.5
        x = x + share * move
    raise ComputationError(_message(transmission, output_torque, np.abs(value).max()))


def _message(transmission: Transmission, torque: float, left: float) -> str:
    """Message about a drive without equilibrium at an output torque [N·m]."""
    return (
        f"joint {transmission.joint!r}: no equilibrium with {torque:.4g} N·m at the"
        f" output (residual {left:.2g} N·m); start at another pose or lower the load"
    )

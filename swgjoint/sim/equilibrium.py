"""Where a run starts: the drives carry the load from the first instant."""

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
"""Torque residual over the rated torque at which an equilibrium is accepted; the
recording resolves 1e-6 of it."""


def start_state(assembly: Assembly) -> tuple[Array, Array]:
    """Positions and velocities at the first instant, free of start-up ringing.

    The link of every joint lies where the drive carries weight and load. A joint that
    starts at rest has its motor where motor torque, control loop and cogging balance,
    the loop acting on the angle that it reads, the motor's or the link's. Computed
    torque has gains that depend on the pose: with a payload that it does not know it
    starts near its equilibrium, not in it.
    A joint that starts moving has its motor on the reference, turning evenly, and its
    link moves at the rate of its balance along the motion, because with kinematic
    error the link moves unevenly while the motor turns evenly.

    Returns:
        qpos and qvel of the compiled model.

    Raises:
        InputError: If bodies press each other there, so that no drive can hold them.
        ComputationError: If the drives find no balance.
    """
    path, h = assembly.trajectory, assembly.step
    try:
        theta, psi = _balance(assembly, 0.0)
    except ComputationError as exc:
        touching = touching_bodies(assembly.arm, path.position[0])
        if not touching:
            raise
        raise InputError(
            f"{assembly.scene.where}: trajectory.start_deg: bodies press each other"
            f" where the arm starts: {touching}; accepted: a pose in which nothing"
            f" touches, or an <exclude> of the pair in {assembly.arm.path}"
        ) from exc
    link_rate = path.velocity[0].copy()
    if link_rate.any():
        # a tenth of a step: small against the period of every order that a step carries
        (_, before), (_, after) = _balance(assembly, -0.1), _balance(assembly, 0.1)
        moving = link_rate != 0.0
        link_rate[moving] = ((after - before) / (0.2 * h))[moving]
    # a prescribed error moves the link as the integrator's velocities have it
    stiff = assembly.motor_position < 0
    link_rate[stiff] = (path.velocity[0] + assembly.prescribed_rate[0])[stiff]
    model = assembly.model
    qpos, qvel = model.qpos0.copy(), np.zeros(model.nv)
    flexible = assembly.motor_position >= 0
    qpos[assembly.link_position], qvel[assembly.link_velocity] = psi, link_rate
    qpos[assembly.motor_position[flexible]] = theta[flexible]
    motor_rate = path.velocity[0] * assembly.ratio
    qvel[assembly.motor_velocity[flexible]] = motor_rate[flexible]
    return qpos, qvel


def set_start(assembly: Assembly, data: mujoco.MjData) -> None:
    """Put a simulation at its start, with what the plugin remembers of the last step.

    The plugin predicts a step from the accelerations that all but the drive gave in the
    step before; in balance they cancel those of the drive. Without them the first step
    would be predicted as if the load were let go.
    """
    model = assembly.model
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = start_state(assembly)
    mujoco.mj_forward(model, data)
    for j, transmission in enumerate(assembly.transmissions):
        plugin = transmission.attached.plugin
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
        # the balance is that of the spring: hysteresis starts relaxed
        torsion = float(transmission.law.torsion(theta, psi))
        elements = len(transmission.attached.elements)
        data.plugin_state[first + 2 : first + 2 + elements] = torsion
    mujoco.mj_forward(model, data)


def _balance(assembly: Assembly, shift: float) -> tuple[Array, Array]:
    """Motor and link angles in balance, ``shift`` steps after the start. (n_joints,).

    Weight depends on the sag of all joints, the drives are stiff: repeat with the
    weight of the last pose; each round shrinks the error by weight gradient over
    torsional stiffness, 1e-2 or less.
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
                # a loop on the link is one on the motor that is ahead by the wind-up
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
        transmission: A drive with a law between the angles.
        theta: Motor angle [rad].
        output_torque: That the drive exerts on the link [N·m].
        guess: Link angle near the solution [rad]; None: that of the mean curve.
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
        # the output torque falls with the link angle, by about the stiffness
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

    Minimum of :math:`V(\theta, \psi) + T\psi - \tau\theta
    + \tfrac12 k_p (\theta - \theta_r)^2` over both angles, the one that a descent from
    the reference reaches: with cogging there may be several.

    Args:
        transmission: A drive with a law between the angles.
        output_torque: That the drive exerts on the link [N·m].
        motor_reference: Commanded motor angle [rad].
        motor_torque: Of the motor at that angle [N·m].
        stiffness: Of the motor's position loop [N·m/rad].
        guess: Angles near the solution [rad], as of nearly the same torque; None: the
            reference.

    Raises:
        ComputationError: If the descent does not settle.
    """
    law, rated = transmission.law, transmission.drive.ratings.rated_torque
    assert law is not None
    # unknown x = (motor angle)/i and link angle, so that both have the size of K
    scale = np.array([law.ratio, 1.0])
    # no step jumps over a tooth
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
    step = 1e-9  # differences of the gradient: 1e-9 rad against 1e-3 rad of torsion
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
        # downhill also where the energy bends down: a Newton step with |curvature|
        size, axes = np.linalg.eigh(0.5 * (bend + bend.T))
        size = np.maximum(np.abs(size), 1e-9 * np.abs(size).max())
        move = -axes @ ((axes.T @ value) / size)
        move *= min(1.0, longest / max(abs(law.ratio * move[0]), 1e-300))
        here, share = energy(x), 1.0
        # round-off of the energy must not stop the last steps
        slack = 1e-13 * (abs(here) + rated)
        while energy(x + share * move) > here + slack and share > 1e-6:
            share *= 0.5
        x = x + share * move
    raise ComputationError(_message(transmission, output_torque, np.abs(value).max()))


def _message(transmission: Transmission, torque: float, left: float) -> str:
    return (
        f"joint {transmission.joint!r}: no equilibrium with {torque:.4g} N·m at the"
        f" output (left: {left:.2g} N·m); start at another pose or lower the load"
    )

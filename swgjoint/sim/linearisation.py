r"""Linear model of a scene at rest, for the design of controllers.

The model is discrete. Its period is the control period, over which the motor torques
are constant, so that it predicts exactly what a sampled controller meets:

.. math:: x_{k+1} = A x_k + B u_k, \qquad y_k = C x_k

States, inputs and outputs are deviations from an equilibrium, in which the motors
compensate weight and load. The derivatives are central differences of the compiled
scene over a control period, so they include everything that the scene simulates.

Jenkin elements and bristles do not slip in the differences, so they act as springs, as
they do in motions that are small compared with their yield torsion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from swgjoint.drives.references import check_joint_names
from swgjoint.errors import ComputationError, InputError
from swgjoint.flags import check_flags
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.actuators import control_inputs
from swgjoint.sim.assembly import Assembly, assemble
from swgjoint.sim.equilibrium import set_start
from swgjoint.sim.figures.resonance import LOCKED
from swgjoint.sim.motion.start_check import check_ranges
from swgjoint.sim.sampled_loop import control_period
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array

ANGLE = 1e-6
"""Difference of link angles [rad], at which curves of torsion are straight."""
SPEED = 1e-3
"""Difference of link speeds [rad/s]. It must not be much smaller, because the engine's
integrator ``discrete`` does not respond to speeds of about 1e-6 rad/s."""
TORQUE = 1e-3
"""Difference of motor torques relative to rated torque over ratio."""
IMBALANCE = 1e-5
"""Largest accepted torque by which the equilibrium is missed, relative to the rated
torque of the drive; contacts and motor limits exceed it by orders of magnitude."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearScene:
    """Linear model of a scene over one control period, about an equilibrium at rest.

    With n states, m motors and p outputs. The names have the form ``elbow.link_angle``.
    """

    A: Array
    """Matrix of the states. Shape (n, n)."""
    B: Array
    """Matrix of the motor torques. Shape (n, m)."""
    C: Array
    """Matrix of the outputs. Shape (p, n)."""
    states: tuple[str, ...]
    """Names of the states: all angles [rad], then all speeds in the same order [rad/s].
    Each group has motors, links and, with output bearings, tilts."""
    inputs: tuple[str, ...]
    """Names of the inputs, which are the motor torques [N·m]."""
    outputs: tuple[str, ...]
    """Names of the outputs: motor angles [rad], motor speeds [rad/s], link angles
    [rad], output torques of the joints with a rotor [N·m], tool position [m]."""
    period: float
    """Control period [s]."""
    state: Array
    """State in the equilibrium. Shape (n,)."""
    input: Array
    """Motor torques that hold the equilibrium [N·m]. Shape (m,)."""
    output: Array
    """Output in the equilibrium. Shape (p,)."""
    natural_Hz: Array
    """Undamped natural frequencies of motors and links on the mean stiffness of their
    drives and output bearings, in ascending order [Hz]. Shape (n/2,)."""

    @property
    def aliased(self) -> bool:
        """Whether a natural frequency exceeds half the sampling frequency.

        The imaginary parts of its :attr:`poles` are then those of a slower mode. A, B
        and C are not affected.
        """
        return bool(self.natural_Hz[-1] > 0.5 / self.period)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles in continuous time, log(eigenvalue of A)/period [1/s]. Shape (n,).

        The imaginary part of a mode faster than half the sampling frequency is wrong,
        because it cannot be told from that of a slower mode (:attr:`aliased`).
        """
        with np.errstate(divide="ignore"):
            logarithm = np.log(np.linalg.eigvals(self.A).astype(complex))
        return np.asarray(logarithm / self.period)


def linearise(
    scene: Scene | str | Path,
    *,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
    drives: Mapping[str, DriveMap] | None = None,
    posture: Mapping[str, float] | None = None,
    friction: bool = False,
    progress: Progress = silent,
) -> LinearScene:
    """Linear model of a scene whose motors take torques, about an equilibrium at rest.

    The model is discrete with the control period of the scene, and describes exactly
    the motion that :func:`swgjoint.run_scene` simulates with an external controller, as
    long as it is small.

    Args:
        scene: A scene, the path of a scene file, or the name of a bundled scene.
        overrides: New values for dotted keys of the scene, as a mapping or as
            ``key=value`` strings.
        drives: Maps to use for drive references of the scene, by reference.
        posture: Link angles by joint [rad]; other joints are at their start of the
            scene. Links deviate by the torsion that weight and load cause.
        friction: Whether the drives keep their friction. At rest it sticks, so the
            model then only describes motions that are too small for slip.
        progress: Called while maps are built.

    Returns:
        The linear model with the names of its states, inputs and outputs.

    Raises:
        InputError: If the scene, a drive or the posture cannot be used.
        ComputationError: If the motors cannot hold the posture, because bodies touch or
            because of their torque limits.
    """
    check_flags(friction=friction)
    if not isinstance(scene, Scene):
        scene = Scene.load_file(scene, overrides)
    elif overrides:
        scene = scene.with_changes(overrides)
    if not friction:
        scene = scene.with_friction(False)
    moving = assemble(
        scene, drives=drives, controlled_by="linear model", progress=progress
    )
    assembly = _hold(moving, posture or {})
    data = mujoco.MjData(assembly.model)
    torques = _settle(assembly, data)
    order, states = _states(assembly)
    state = np.concatenate([data.qpos, data.qvel])[order]
    A, B = _derivatives(assembly, data, order)
    outputs, slopes, output = _outputs(assembly, data, order)
    return LinearScene(
        A=A,
        B=B,
        C=slopes,
        states=states,
        inputs=tuple(f"{joint}.motor_torque" for joint in assembly.joints),
        outputs=outputs,
        period=control_period(assembly)[0],
        state=state,
        input=torques,
        output=output,
        natural_Hz=_natural_frequencies(assembly, data),
    )


def _hold(assembly: Assembly, posture: Mapping[str, float]) -> Assembly:
    """The scene at rest in a posture, with motors that compensate weight and load."""
    arm, scene, path = assembly.arm, assembly.scene, assembly.trajectory
    check_joint_names(
        {"posture": set(posture)}, arm.joints, where=scene.where, arm=scene.arm
    )
    angles = path.position[0].copy()
    for joint, angle in posture.items():
        angles[arm.joints.index(joint)] = angle
    if not np.isfinite(angles).all():
        raise InputError(f"posture {dict(posture)}; accepted: finite angles [rad]")
    position = np.stack(2 * [angles])
    rest = np.zeros_like(position)
    still = replace(
        path, time=path.time[:2], position=position, velocity=rest, acceleration=rest
    )
    check_ranges(arm, still, where=scene.where)
    needed = assembly.load + arm.gravity(position)
    return replace(
        assembly,
        trajectory=still,
        link_torque=needed,
        feedforward=needed / assembly.ratio,
        prescribed=rest,
        prescribed_rate=rest,
    )


def _settle(assembly: Assembly, data: mujoco.MjData) -> Array:
    """Put a simulation into equilibrium and return its motor torques [N·m].

    One engine step gives bristles the angle at which they are relaxed, and shows
    whether the torques balance. Disturbances of the scene do not act.
    """
    model, motors = assembly.model, len(assembly.joints)
    set_start(assembly, data)
    torques = assembly.feedforward[0].copy()
    for j, transmission in enumerate(assembly.transmissions):
        if transmission.law is not None:
            theta = data.qpos[assembly.motor_position[j]]
            psi = data.qpos[assembly.link_position[j]]
            torques[j] = -float(transmission.law.forces(theta, psi)[0])
    data.ctrl[:] = control_inputs(assembly)[0]
    data.ctrl[:motors] = torques
    data.ctrl[model.nu - len(assembly.disturbances) :] = 0.0
    mujoco.mj_step(model, data)

    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    missed = np.abs(mass @ data.qvel) / assembly.step
    rated = np.array([t.drive.ratings.rated_torque for t in assembly.transmissions])
    at_link = missed[assembly.link_velocity]
    at_motor = np.where(
        assembly.motor_velocity >= 0, missed[assembly.motor_velocity], 0.0
    )
    share = (at_link + np.abs(assembly.ratio) * at_motor) / rated
    worst = int(np.argmax(share))
    if not share[worst] <= IMBALANCE:
        raise ComputationError(
            f"scene {assembly.scene.name!r}: joint {assembly.joints[worst]!r} is not at"
            f" rest in the posture: {share[worst] * rated[worst]:.3g} N·m remain at the"
            " link, because of a contact, a joint limit or a torque limit; choose"
            " another posture"
        )
    return np.asarray(torques)


def _natural_frequencies(assembly: Assembly, data: mujoco.MjData) -> Array:
    """Natural frequencies of motors and links on elastic drives [Hz]. Shape (nv,)."""
    model = assembly.model
    mass, stiffness = np.zeros((2, model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    for j, transmission in enumerate(assembly.transmissions):
        if transmission.level not in LOCKED and assembly.motor_velocity[j] >= 0:
            torsion = np.zeros(model.nv)
            torsion[assembly.motor_velocity[j]] = 1.0 / assembly.ratio[j]
            torsion[assembly.link_velocity[j]] = -1.0
            stiffness += transmission.drive.mean_stiffness * np.outer(torsion, torsion)
    stiffness[model.jnt_dofadr, model.jnt_dofadr] += model.jnt_stiffness
    squares = eigh(stiffness, mass, eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi))


def _states(assembly: Assembly) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Order of the states in (qpos, qvel) of the engine, and their names."""
    model, joints = assembly.model, assembly.joints
    flexible = np.flatnonzero(assembly.motor_velocity >= 0)
    dofs = np.concatenate(
        [
            assembly.motor_velocity[flexible],
            assembly.link_velocity,
            assembly.tilt_velocity,
        ]
    )
    names = [
        *(f"{joints[j]}.motor" for j in flexible),
        *(f"{joint}.link" for joint in joints),
        *(
            model.joint(int(model.dof_jntid[dof])).name
            for dof in assembly.tilt_velocity
        ),
    ]
    assert dofs.size == model.nv == model.nq
    order = np.concatenate([dofs, model.nv + dofs])
    kinds = ("angle", "speed")
    return order, tuple(f"{name}_{kind}" for kind in kinds for name in names)


def _moves(assembly: Assembly) -> Array:
    """Differences of the states, in their order. Shape (n,)."""
    flexible = assembly.motor_velocity >= 0
    others = np.ones(len(assembly.joints) + assembly.tilt_velocity.size)
    sizes = np.concatenate([np.abs(assembly.ratio[flexible]), others])
    return np.concatenate([ANGLE * sizes, SPEED * sizes])


def _derivatives(
    assembly: Assembly, data: mujoco.MjData, order: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Derivatives of the state after a control period by state and motor torques."""
    model, kind = assembly.model, mujoco.mjtState.mjSTATE_INTEGRATION
    _, every = control_period(assembly)
    rated = np.array([t.drive.ratings.rated_torque for t in assembly.transmissions])
    start = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, start, kind)

    def move_to(moved: Array, torque: Array) -> Array:
        mujoco.mj_setState(model, data, start, kind)
        state = np.concatenate([data.qpos, data.qvel])
        state[order] += moved
        data.qpos[:], data.qvel[:] = state[: model.nq], state[model.nq :]
        data.ctrl[: torque.size] += torque
        for _ in range(every):
            mujoco.mj_step(model, data)
        return np.concatenate([data.qpos, data.qvel])[order]

    columns, n = [], order.size
    sizes = np.concatenate([_moves(assembly), TORQUE * rated / np.abs(assembly.ratio)])
    for k, size in enumerate(sizes):
        one = np.zeros(sizes.size)
        one[k] = size
        ahead, back = move_to(one[:n], one[n:]), move_to(-one[:n], -one[n:])
        columns.append((ahead - back) / (2.0 * size))
    mujoco.mj_setState(model, data, start, kind)
    whole = np.column_stack(columns)
    return whole[:, :n], whole[:, n:]


def _outputs(
    assembly: Assembly, data: mujoco.MjData, order: NDArray[np.intp]
) -> tuple[tuple[str, ...], Array, Array]:
    """Names of the outputs, their derivatives by the states, and their values."""
    model, joints = assembly.model, assembly.joints
    flexible = assembly.motor_position >= 0
    names = [
        f"{joint}.{kind}" for kind in ("motor_angle", "motor_speed") for joint in joints
    ]
    names += [f"{joint}.link_angle" for joint in joints]
    names += [f"{joints[j]}.output_torque" for j in np.flatnonzero(flexible)]
    if assembly.arm.tool >= 0:
        names += [f"tool.{axis}" for axis in "xyz"]

    def read(state: Array) -> Array:
        data.qpos[:], data.qvel[:] = state[: model.nq], state[model.nq :]
        mujoco.mj_kinematics(model, data)
        # a motor without a rotor acts on its link
        angle = assembly.ratio * data.qpos[assembly.link_position]
        speed = assembly.ratio * data.qvel[assembly.link_velocity]
        angle[flexible] = data.qpos[assembly.motor_position[flexible]]
        speed[flexible] = data.qvel[assembly.motor_velocity[flexible]]
        parts = [angle, speed, data.qpos[assembly.link_position]]
        parts.append(
            np.array(
                [
                    float(t.attached.observe(model, data).torque)
                    for t in assembly.transmissions
                    if t.law is not None
                ]
            )
        )
        if assembly.arm.tool >= 0:
            parts.append(data.site(assembly.scene.tool_site).xpos)
        return np.concatenate(parts)

    state = np.concatenate([data.qpos, data.qvel])
    columns = []
    for k, size in zip(order, _moves(assembly), strict=True):
        one = np.zeros(state.size)
        one[k] = size
        columns.append((read(state + one) - read(state - one)) / (2.0 * size))
    return tuple(names), np.column_stack(columns), read(state)

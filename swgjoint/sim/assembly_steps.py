"""Single steps of the way from a scene to its compiled model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.gear.bearing.output_bearing import OutputBearing
from swgjoint.joint.tilt import tilt_names
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.actuators import Loops
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.control import control_gains, feedforward, integral_gain
from swgjoint.sim.figures.transmission import Transmission
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.sim.scene.feature_sections import Disturbance, ToolForce
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array


def motor_loops(
    scene: Scene,
    transmissions: Sequence[Transmission],
    sections: Sequence[JointSection],
    link_inertia: Array,
    *,
    sampled: bool,
) -> Loops:
    """Control loops and limits of all motors.

    Args:
        scene: The scene.
        transmissions: Compiled drives, one per joint.
        sections: Joint settings, one per joint.
        link_inertia: Link inertia about every joint [kg·m²]. Shape (n_joints,).
        sampled: Whether the loops run outside the engine.
    """
    section = scene.controller
    ratio = np.array([t.ratio for t in transmissions])
    rotor = np.array([t.rotor_inertia for t in transmissions])
    inertia = rotor + link_inertia / ratio**2  # reduced to the motor
    stiffness, damping = control_gains(section, inertia)
    rated = [t.drive.ratings.rated_torque / abs(t.ratio) for t in transmissions]
    limit = section.integral_limit_Nm
    return Loops(
        stiffness=stiffness,
        damping=damping,
        integral=integral_gain(section, stiffness, inertia),
        integral_limit=np.array(rated) if limit is None else np.full(len(rated), limit),
        limits=tuple(s.motor for s in sections),
        sampled=sampled,
    )


def site_of_force(scene: Scene, arm: RigidArm) -> str:
    """Name of the tool site, on which tool forces act.

    Args:
        scene: The scene.
        arm: Its arm.

    Raises:
        InputError: If the scene has a tool force but the arm has no tool site.
    """
    if arm.tool < 0 and any(isinstance(d, ToolForce) for d in scene.disturbance):
        raise InputError(
            f"{scene.where}: disturbance: tool_force on arm {scene.arm!r}, which has no"
            f" site {scene.tool_site!r}; accepted: the name of a site or body in"
            " tool_site"
        )
    return scene.tool_site


def joints_in_contact(arm: RigidArm, trajectory: Trajectory) -> NDArray[np.bool_]:
    """Whether contacts or joint limits may act on each joint. Shape (n_joints,).

    Args:
        arm: The rigid arm.
        trajectory: Commanded motion of its joints.
    """
    model = arm.model
    collides = bool(model.geom_contype.any() and model.geom_conaffinity.any())
    low, high = model.jnt_range.T
    path, slack = trajectory.position, 1e-3  # torsion of the drives: arc minutes [rad]
    beyond = (path <= low + slack) | (path >= high - slack)
    return np.asarray(collides | (model.jnt_limited.astype(bool) & beyond.any(axis=0)))


def interpolate_samples(values: Array, n: int) -> Array:
    """Refine samples by linear interpolation, n intervals for each one.

    Args:
        values: Samples at the ends of all intervals. Shape (m, n_joints).
        n: Number of intervals that replace each interval.

    Returns:
        Interpolated samples. Shape (n (m - 1) + 1, n_joints).
    """
    if n == 1:
        return values
    part = (np.arange(n) / n)[None, :, None]
    lines = values[:-1, None] * (1.0 - part) + values[1:, None] * part
    return np.vstack([lines.reshape(-1, values.shape[1]), values[-1:]])


def prescribed_errors(
    position: Array,
    transmissions: Sequence[Transmission],
    *,
    step: float,
    discrete: bool,
) -> tuple[Array, Array]:
    """Kinematic error that level ``kinematic`` prescribes on a motion, and its rate.

    Args:
        position: Commanded link angles [rad]. Shape (n, n_joints).
        transmissions: Compiled drives, one per joint.
        step: Interval between two samples [s].
        discrete: Whether the integrator is ``discrete``, which advances positions by
            the velocity at the end of a step. The rate is then a backward difference,
            otherwise a central one.

    Returns:
        Error [rad] and rate [rad/s] at every joint; zero at other levels. Shapes
        (n, n_joints).
    """
    # the rate at the first sample needs one extrapolated sample before it
    path = np.vstack([2.0 * position[:1] - position[1:2], position])
    error = np.column_stack(
        [
            t.attached.prescribed_error(t.ratio * path[:, j])
            for j, t in enumerate(transmissions)
        ]
    )
    rate = np.diff(error, axis=0) / step
    if not discrete:
        rate = np.gradient(error, step, axis=0)[1:]
    return error[1:], rate


def complete_sections(
    scene: Scene, joints: tuple[str, ...]
) -> tuple[JointSection, ...]:
    """Settings of all joints, checked for missing keys.

    Args:
        scene: The scene.
        joints: Names of all driven joints.

    Raises:
        InputError: If a joint has no drive or no rotor inertia; one line per missing
            key.
    """
    sections = tuple(scene.joint_settings(name) for name in joints)
    lines = []
    for name, section in zip(joints, sections, strict=True):
        if not section.has_drive:
            lines.append(
                f"{scene.where}: joints.{name}.drive: missing; accepted: drive,"
                " linear or numbers, here or in [defaults]"
            )
        if section.rotor_inertia_kgm2 is None:
            lines.append(
                f"{scene.where}: joints.{name}.rotor_inertia_kgm2: missing; accepted:"
                " > 0 kg·m² and <= 1 kg·m², here or in [defaults]"
            )
    if lines:
        raise InputError("\n".join(lines))
    return sections


def load_torque(scene: Scene, joint: str, drive: DriveMap) -> float:
    """Constant load torque against a joint [N·m]; zero without a load.

    Args:
        scene: The scene, with its table ``[load]``.
        joint: Name of the joint.
        drive: Drive of the joint; its rated torque scales a relative load.
    """
    load = scene.load.get(joint)
    if load is None:
        return 0.0
    if load.torque_Nm is not None:
        return load.torque_Nm
    return (load.rated_fraction or 0.0) * drive.ratings.rated_torque


def scaled_disturbances(
    scene: Scene, transmissions: Sequence[Transmission]
) -> tuple[Disturbance, ...]:
    """Disturbances of a scene, those relative to a rated torque in N·m.

    Args:
        scene: The scene.
        transmissions: Compiled drives, one per joint.
    """
    rated = {t.joint: t.drive.ratings.rated_torque for t in transmissions}
    return tuple(
        one if isinstance(one, ToolForce) else one.scale_to(rated[one.joint])
        for one in scene.disturbance
    )


def output_bearings(
    scene: Scene, sections: Mapping[str, JointSection]
) -> dict[str, OutputBearing]:
    """Output bearings by joint, for the integrator that can step them.

    Args:
        scene: The scene.
        sections: Settings by joint.

    Raises:
        InputError: If the scene has output bearings but an explicit integrator.
    """
    stated = {name: section.output_bearing for name, section in sections.items()}
    bearings = {name: one.bearing() for name, one in stated.items() if one is not None}
    if bearings and scene.simulation.integrator != "discrete":
        raise InputError(
            f"{scene.where}: simulation.integrator = {scene.simulation.integrator!r}"
            " with an output_bearing; accepted: 'discrete', which steps its stiff tilt"
            " implicitly"
        )
    return bearings


def engine_addresses(
    model: mujoco.MjModel,
    joints: Sequence[str],
    transmissions: Sequence[Transmission],
    bearings: Sequence[str],
) -> dict[str, NDArray[np.intp]]:
    """Addresses of link, motor and tilt coordinates in qpos and qvel.

    Args:
        model: The compiled model.
        joints: Names of the joints.
        transmissions: Their drives.
        bearings: Names of the joints with an output bearing.

    Returns:
        Addresses by name of the attribute of an assembly.
    """
    rotors = [
        None if t.law is None else model.joint(t.attached.rotor) for t in transmissions
    ]
    links = [model.joint(name) for name in joints]
    tilts = [model.joint(name) for joint in bearings for name in tilt_names(joint)]
    return {
        "link_position": np.array([j.qposadr[0] for j in links], dtype=np.intp),
        "link_velocity": np.array([j.dofadr[0] for j in links], dtype=np.intp),
        "motor_position": np.array(
            [-1 if j is None else j.qposadr[0] for j in rotors], dtype=np.intp
        ),
        "motor_velocity": np.array(
            [-1 if j is None else j.dofadr[0] for j in rotors], dtype=np.intp
        ),
        "tilt_position": np.array([j.qposadr[0] for j in tilts], dtype=np.intp),
        "tilt_velocity": np.array([j.dofadr[0] for j in tilts], dtype=np.intp),
    }


def plan_torques(
    scene: Scene,
    arm: RigidArm,
    known_arm: RigidArm,
    trajectory: Trajectory,
    transmissions: Sequence[Transmission],
    load: Array,
    sub_steps: int,
) -> tuple[Array, Array]:
    """Drive torques of the rigid arm and motor torques of the feed-forward [N·m].

    Args:
        scene: The scene.
        arm: Its arm.
        known_arm: The controller's model of the arm.
        trajectory: Commanded motion, one sample per engine step.
        transmissions: Compiled drives, one per joint.
        load: Constant load torque against every joint [N·m]. Shape (n_joints,).
        sub_steps: Engine steps per step of the scene.

    Returns:
        Both torques on the commanded motion. Shapes (n, n_joints).
    """
    # torques of the rigid arm change little within a step, so they are interpolated
    coarse = trajectory.every(sub_steps)
    motion = (coarse.position, coarse.velocity, coarse.acceleration)
    link_torque = load + interpolate_samples(arm.torques(*motion), sub_steps)
    kind = scene.controller.feedforward
    if scene.controller.kind == "computed_torque":
        kind = "gravity_inertia"  # for the start only: the loop computes its own torque
    known_torque = link_torque
    if kind == "gravity":
        known_torque = load + interpolate_samples(
            known_arm.gravity(coarse.position), sub_steps
        )
    elif known_arm is not arm:
        known_torque = load + interpolate_samples(known_arm.torques(*motion), sub_steps)
    return link_torque, feedforward(
        kind,
        link_torque=known_torque,
        acceleration=trajectory.acceleration,
        ratio=np.array([t.ratio for t in transmissions]),
        rotor_inertia=np.array([t.rotor_inertia for t in transmissions]),
    )

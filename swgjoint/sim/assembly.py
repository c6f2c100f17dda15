"""Assembly of a scene into a compiled model: arm, drives, motors and loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.drives.references import check_joint_names, drive_of
from swgjoint.drives.sections import JointSection
from swgjoint.errors import InputError
from swgjoint.gear.bearing.output_bearing import OutputBearing
from swgjoint.joint import plugin
from swgjoint.joint.attach import attach_all
from swgjoint.joint.drive import JointDrive
from swgjoint.joint.fitting import Fitting
from swgjoint.joint.region import check_region
from swgjoint.joint.step_damping import damp_as_asked, is_implicit
from swgjoint.joint.tilt import add_tilt_hinges
from swgjoint.maps.drive_map import DriveMap
from swgjoint.progress import Progress, silent
from swgjoint.sim.actuators import Loops, add_actuators
from swgjoint.sim.arm.payload import arms_of
from swgjoint.sim.arm.rigid_arm import RigidArm, compile_spec
from swgjoint.sim.assembly_steps import (
    complete_sections,
    engine_addresses,
    joints_in_contact,
    load_torque,
    motor_loops,
    output_bearings,
    plan_torques,
    prescribed_errors,
    scaled_disturbances,
    site_of_force,
)
from swgjoint.sim.figures.transmission import Transmission, transmission_of
from swgjoint.sim.gauges import JointGauges, joint_gauges
from swgjoint.sim.motion.commanded import check_motion, trajectory_of
from swgjoint.sim.motion.start_check import check_link, check_ranges
from swgjoint.sim.motion.trajectory import Trajectory
from swgjoint.sim.run_memory import require_run_memory
from swgjoint.sim.scene.feature_sections import Disturbance, ToolForce
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.thermal import reserve_friction
from swgjoint.typing import Array


class _PluginFirst:
    """Part of a pickle; reading it registers the plugin.

    MuJoCo crashes if it steps an unpickled model whose plugin is not registered.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return plugin.load, ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembly:
    """A scene that is ready to run; n counts its engine steps and the start."""

    scene: Scene
    """The scene as it was read."""
    sub_steps: int
    """Engine steps per step of the scene."""
    outside: dict[str, str]
    """Joints that the scene's own step would leave outside their stability region, each
    with the exceeded bounds."""
    arm: RigidArm
    """The arm with its payload."""
    known_arm: RigidArm
    """The controller's model of the arm, which lacks a payload that is not known."""
    model: mujoco.MjModel
    """The compiled model with drives, motors, loads and disturbances."""
    joints: tuple[str, ...]
    """Names of the driven joints, in the order of all arrays."""
    transmissions: tuple[Transmission, ...]
    """Drives as the model contains them, one per joint."""
    trajectory: Trajectory
    """Commanded motion, one sample per engine step."""
    loops: Loops
    """Control loops and limits of all motors."""
    link_inertia: Array
    """Link inertia about every joint at the start, in the controller's model [kg·m²].
    Shape (n_joints,)."""
    load: Array
    """Constant load torque against every joint [N·m]. Shape (n_joints,)."""
    disturbances: tuple[Disturbance, ...]
    """Disturbances of the scene, in the order of their actuators."""
    link_torque: Array
    """Drive torque that the rigid arm and the load require on the commanded motion
    [N·m]. Shape (n, n_joints)."""
    feedforward: Array
    """Motor torque of the feed-forward [N·m]. Shape (n, n_joints)."""
    prescribed: Array
    """Kinematic error on the commanded motion at level ``kinematic``, zero at other
    levels [rad]. Shape (n, n_joints)."""
    prescribed_rate: Array
    """Rate of the prescribed error [rad/s]. Shape (n, n_joints)."""
    controlled_by: str | None
    """Name of the external controller; None if the scene's own controller runs."""
    link_position: NDArray[np.intp]
    """Addresses of the link angles in qpos. Shape (n_joints,)."""
    link_velocity: NDArray[np.intp]
    """Addresses of the link speeds in qvel. Shape (n_joints,)."""
    motor_position: NDArray[np.intp]
    """Addresses of the motor angles in qpos, -1 without a rotor. Shape (n_joints,)."""
    motor_velocity: NDArray[np.intp]
    """Addresses of the motor speeds in qvel, -1 without a rotor. Shape (n_joints,)."""
    bearings: dict[str, OutputBearing]
    """Output bearings that tilt, by joint."""
    gauges: dict[str, JointGauges]
    """Strain gauges on the flexsplines, by joint."""
    tilt_position: NDArray[np.intp]
    """Addresses of the tilt angles in qpos, two for each bearing. Shape (n_tilts,)."""
    tilt_velocity: NDArray[np.intp]
    """Addresses of the tilt speeds in qvel. Shape (n_tilts,)."""

    def __getstate__(self) -> dict[str, Any]:
        """State for pickle, which registers the plugin before it reads the model."""
        return {"": _PluginFirst(), **vars(self)} if self.model.nplugin else vars(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the attributes, see :meth:`__getstate__`."""
        vars(self).update({key: value for key, value in state.items() if key})

    @property
    def step(self) -> float:
        """Time step of the engine [s]."""
        return float(self.model.opt.timestep)

    def without_sub_steps(self) -> Assembly:
        """Copy that keeps only the recorded samples, one per step of the scene."""
        n = self.sub_steps
        return replace(
            self,
            trajectory=self.trajectory.every(n),
            link_torque=self.link_torque[::n],
            feedforward=self.feedforward[::n],
            prescribed=self.prescribed[::n],
            prescribed_rate=self.prescribed_rate[::n],
        )

    @property
    def ratio(self) -> Array:
        """Signed ratios i, output = input / i. Shape (n_joints,)."""
        return np.array([t.ratio for t in self.transmissions])

    @property
    def rotor_inertia(self) -> Array:
        """Rotor inertias about the motor axes [kg·m²]. Shape (n_joints,)."""
        return np.array([t.rotor_inertia for t in self.transmissions])


def assemble(
    scene: Scene,
    *,
    drives: Mapping[str, DriveMap] | None = None,
    controlled_by: str | None = None,
    variable: bool = False,
    top_speed: float = 0.0,
    progress: Progress = silent,
) -> Assembly:
    """Build and compile the model of a scene.

    Args:
        scene: The scene.
        drives: Maps by drive reference; all other drives are loaded or built.
        controlled_by: Name of an external controller, with which the motors take
            torques only; None if the scene's own controller runs.
        variable: Whether drives at level ``full`` can deviate from their maps, see
            :mod:`swgjoint.joint.variation`.
        top_speed: Largest joint speed of other motions that will run [rad/s].
        progress: Called while maps are built and strains under gauges are solved.

    Returns:
        The compiled scene with its commanded motion.

    Raises:
        InputError: If a joint or drive does not exist or cannot be used.
        ComputationError: If the run would not fit in memory, or if a joint remains
            outside its stability region even with the sub-steps that the scene accepts.
            The message then names the exceeded bound and a step that meets it.
    """
    arm, known_arm = arms_of(scene)
    sections = _checked_sections(scene, arm, external=controlled_by is not None)
    require_run_memory(scene, len(arm.joints))
    trajectory = trajectory_of(scene, arm)
    check_ranges(arm, trajectory, where=scene.where)

    if any(section.level == "full" for section in sections):
        plugin.load()  # reports another MuJoCo before maps are built
    # drives keep the harmonics that the scene's own step resolves, so the contents of a
    # run depend on the step that the user chose, not on the number of sub-steps
    spec = _spec_at_step(scene, arm)
    fittings = _fittings(
        dict(zip(arm.joints, sections, strict=True)),
        np.maximum(trajectory.top_speed, top_speed),
        known=dict(drives or {}),
        variable=variable,
        progress=progress,
    )
    attached = attach_all(spec, fittings)
    sub_steps, outside = _stable_sub_steps(scene, arm, trajectory, attached, fittings)
    if sub_steps > 1:
        require_run_memory(scene, len(arm.joints), sub_steps=sub_steps)
        spec.option.timestep = scene.simulation.step_s / sub_steps
        trajectory = trajectory_of(scene, arm, sub_steps=sub_steps)
    if is_implicit(spec):
        attached = damp_as_asked(spec, attached)
    transmissions = tuple(
        transmission_of(attached[name], fittings[name].drive) for name in arm.joints
    )

    reserve_friction(spec, sections, attached)
    bearings = output_bearings(scene, dict(zip(arm.joints, sections, strict=True)))
    add_tilt_hinges(spec, bearings)

    # add motors, loads and disturbances after all drives are attached
    load = np.array([load_torque(scene, t.joint, t.drive) for t in transmissions])
    link_inertia = known_arm.inertia(trajectory.position[0])
    loops = motor_loops(
        scene,
        transmissions,
        sections,
        link_inertia,
        sampled=scene.sampled or controlled_by is not None,
    )
    add_actuators(
        spec,
        transmissions,
        loops,
        load,
        scene.disturbance,
        tool_site=site_of_force(scene, arm),
    )
    model = compile_spec(spec, where=f"scene {scene.name!r}")

    link_torque, motor_torque = plan_torques(
        scene, arm, known_arm, trajectory, transmissions, load, sub_steps
    )
    prescribed, prescribed_rate = prescribed_errors(
        trajectory.position,
        transmissions,
        step=float(model.opt.timestep),
        discrete=scene.simulation.integrator == "discrete",
    )
    return Assembly(
        scene=scene,
        sub_steps=sub_steps,
        outside=outside,
        arm=arm,
        known_arm=known_arm,
        model=model,
        joints=arm.joints,
        transmissions=transmissions,
        trajectory=trajectory,
        loops=loops,
        link_inertia=link_inertia,
        load=load,
        disturbances=scaled_disturbances(scene, transmissions),
        link_torque=link_torque,
        feedforward=motor_torque,
        prescribed=prescribed,
        prescribed_rate=prescribed_rate,
        controlled_by=controlled_by,
        bearings=bearings,
        gauges=joint_gauges(scene.where, sections, transmissions, progress),
        **engine_addresses(model, arm.joints, transmissions, tuple(bearings)),
    )


def _checked_sections(
    scene: Scene, arm: RigidArm, *, external: bool
) -> tuple[JointSection, ...]:
    """Settings of all joints, after a check of the scene against arm and controller."""
    named = scene.trajectory.named_joints
    named["start_deg"] -= set(arm.held)  # held joints may have a start angle, too
    check_joint_names(
        {
            "joints": set(scene.joints),
            "load": set(scene.load),
            "recording.joints": set(scene.recording.joints),
            **{
                f"disturbance[{k}].joint": {d.joint}
                for k, d in enumerate(scene.disturbance)
                if not isinstance(d, ToolForce)
            },
            **{f"trajectory.{k}": v for k, v in named.items()},
        },
        arm.joints,
        where=scene.where,
        arm=scene.arm,
    )
    sections = complete_sections(scene, arm.joints)
    check_motion(scene, {section.level for section in sections})
    if scene.sensors and scene.sensors.torque and not external:
        raise InputError(
            f"{scene.where}: sensors.torque: not used; accepted: with an external"
            " controller, run_scene(..., controller=...)"
        )
    return sections


def _spec_at_step(scene: Scene, arm: RigidArm) -> mujoco.MjSpec:
    """Editable model of the arm with the step and the integrator of the scene."""
    spec = arm.spec()
    spec.option.timestep = scene.simulation.step_s
    spec.option.integrator = getattr(
        mujoco.mjtIntegrator, f"mjINT_{scene.simulation.integrator.upper()}"
    )
    return spec


def _fittings(
    sections: Mapping[str, JointSection],
    top_speed: Array,
    *,
    known: dict[str, DriveMap],
    variable: bool,
    progress: Progress,
) -> dict[str, Fitting]:
    """Drive and settings of every joint; ``top_speed`` has the order of the joints."""
    fittings = {}
    for (name, section), speed in zip(sections.items(), top_speed, strict=True):
        drive = drive_of(section, known=known, joint=name, progress=progress)
        fittings[name] = Fitting(
            drive=drive,
            level=section.level or "full",
            rotor_inertia=section.rotor_inertia_kgm2 or 0.0,
            damping_ratio=section.damping_ratio,
            friction=section.friction is not False,
            rotor=section.rotor or "gyroscopic",
            variable=variable,
            # None for a joint at rest, because any step resolves all its orders
            max_input_speed=float(abs(drive.ratio) * speed) or None,
        )
    return fittings


def _stable_sub_steps(
    scene: Scene,
    arm: RigidArm,
    trajectory: Trajectory,
    attached: Mapping[str, JointDrive],
    fittings: Mapping[str, Fitting],
) -> tuple[int, dict[str, str]]:
    """Number of sub-steps that all joints need, and the bounds exceeded without them.

    Raises:
        InputError: If a link is too light for its drive.
        ComputationError: If a joint needs more sub-steps than the scene accepts.
    """
    sub_steps, outside = 1, {}
    contacts = joints_in_contact(arm, trajectory)
    for name, touches in zip(arm.joints, contacts, strict=True):
        check_link(attached[name], arm, where=scene.where)
        region = check_region(
            attached[name],
            timestep=scene.simulation.step_s,
            max_input_speed=fittings[name].max_input_speed or 0.0,
            contacts=bool(touches),
            integrator=scene.simulation.integrator,
        )
        sub_steps = max(sub_steps, region.require(scene.simulation.max_sub_steps))
        if not region.ok:
            outside[name] = region.exceeded
    return sub_steps, outside

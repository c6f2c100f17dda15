"""The commanded motion of a scene on its time grid."""

from __future__ import annotations

from typing import Any

import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.control import answer_speed
from swgjoint.sim.motion import joint_motions, tool_motions
from swgjoint.sim.motion.inverse_kinematics import ToolKinematics
from swgjoint.sim.motion.trajectory import Trajectory, constant_speed, sweep, time_grid
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.scene.trajectory_sections import (
    ChirpSection,
    Circle,
    ConstantSpeed,
    FromFile,
    Iso9283,
    LineSection,
    SpeedSteps,
    StepSection,
    SweepSection,
    Trapezoid,
)
from swgjoint.typing import Array
from swgjoint.units import deg, mm

HOLDS_ORIENTATION = 6
"""Smallest number of joints with which the tool keeps its orientation by default."""


def trajectory_of(scene: Scene, arm: RigidArm, *, sub_steps: int = 1) -> Trajectory:
    """The commanded motion of all joints of an arm at every engine step.

    Args:
        scene: The scene.
        arm: Its arm.
        sub_steps: Engine steps per step of the scene.

    Raises:
        InputError: If the arm cannot follow the motion, or if no sample of the run
            remains for the metrics.
    """
    with np.errstate(all="ignore"):  # non-finite values are rejected below
        path = _motion_of(scene, arm, sub_steps)
    samples = (path.position, path.velocity, path.acceleration)
    if not all(np.isfinite(part).all() for part in samples):
        values = [
            f"{key} = {value:g}"
            for key, value in scene.trajectory.model_dump().items()
            if isinstance(value, float) and not 1e-12 < abs(value) < 1e12 and value
        ]
        raise InputError(
            f"{scene.where}: trajectory.{', '.join(values) or 'kind'}: the motion is"
            " not finite; accepted: realistic times, speeds and distances"
        )
    if path.steady.stop <= path.steady.start:
        raise InputError(
            f"{scene.where}: simulation.step_s: {scene.simulation.step_s:g} s leaves no"
            " sample in the part of the motion that the metrics use; accepted: a"
            " smaller step or a longer motion"
        )
    return path


def _motion_of(scene: Scene, arm: RigidArm, sub_steps: int) -> Trajectory:
    """Commanded motion of the scene, not yet checked for non-finite values."""
    section, timing = scene.trajectory, scene.simulation
    joints = arm.joints
    start = _angles(section.start_deg, joints)
    grid: dict[str, Any] = {
        "duration": timing.duration_s,
        "step": timing.step_s,
        "sub_steps": sub_steps,
    }
    if isinstance(section, SweepSection):
        end = {**section.start_deg, **section.end_deg}
        return sweep(
            start=start,
            end=_angles(end, joints),
            hold=section.hold_s,
            ramp=section.ramp_s,
            settle=section.settle_s,
            **grid,
        )
    if isinstance(section, ConstantSpeed):
        return constant_speed(
            start=start,
            speed=_angles(section.speed_deg_s, joints),
            settle=section.settle_s,
            **grid,
        )
    time, where = time_grid(**grid), f"{scene.where}: trajectory"
    if isinstance(section, SpeedSteps):
        return joint_motions.speed_steps(
            time,
            start=start,
            joint=joints.index(section.joint),
            speeds=np.array(section.speeds_deg_s) * deg,
            hold=section.hold_s,
            ramp=section.ramp_s,
        )
    if isinstance(section, StepSection):
        jump = _angles(section.step_deg, joints)
        return joint_motions.step(
            time,
            start=start,
            jump=jump,
            at=section.at_s,
            answer_speed=answer_speed(scene.controller, jump),
        )
    if isinstance(section, Trapezoid):
        return joint_motions.trapezoid(
            time,
            start=start,
            end=_angles({**section.start_deg, **section.end_deg}, joints),
            hold=section.hold_s,
            max_speed=section.max_speed_deg_s * deg,
            max_acceleration=section.max_acceleration_deg_s2 * deg,
            where=where,
        )
    if isinstance(section, ChirpSection):
        return joint_motions.chirp(
            time,
            start=start,
            joint=joints.index(section.joint),
            amplitude=section.amplitude_deg * deg,
            first_frequency=section.from_Hz,
            last_frequency=section.to_Hz,
            hold=section.hold_s,
            ramp=section.ramp_s,
        )
    if isinstance(section, FromFile):
        points_time, points = joint_motions.read_points(section.file, joints, start)
        return joint_motions.spline_motion(
            time, points_time=points_time, points=points, hold=section.hold_s
        )
    hold = section.orientation or (
        "hold" if len(joints) >= HOLDS_ORIENTATION else "free"
    )
    kinematics = ToolKinematics(arm, hold_orientation=hold == "hold", where=where)
    return _tool_motion(section, time, kinematics, start)


def _tool_motion(
    section: LineSection | Circle | Iso9283,
    time: Array,
    kinematics: ToolKinematics,
    start: Array,
) -> Trajectory:
    """Commanded motion of the tool on a time grid."""
    if isinstance(section, LineSection):
        return tool_motions.line(
            time,
            kinematics,
            start=start,
            displacement=np.array(section.displacement_mm) * mm,
            cycles=section.cycles,
            hold=section.hold_s,
            ramp=section.ramp_s,
        )
    if isinstance(section, Circle):
        return tool_motions.circle(
            time,
            kinematics,
            start=start,
            radius=section.radius_mm * mm,
            normal=np.array(section.normal),
            towards=np.array(section.towards),
            cycles=section.cycles,
            hold=section.hold_s,
            ramp=section.ramp_s,
        )
    return tool_motions.iso9283(
        time,
        kinematics,
        start=start,
        edge=section.edge_mm * mm,
        plane=section.plane,
        cycles=section.cycles,
        hold=section.hold_s,
        rest=section.rest_s,
    )


def _angles(values: dict[str, float], joints: tuple[str, ...]) -> Array:
    """Joint angles [rad] from a table in degrees; zero for joints without a value."""
    return np.array([values.get(name, 0.0) for name in joints]) * deg


def check_motion(scene: Scene, levels: set[str | None]) -> None:
    """Reject a motion that a level cannot represent.

    Args:
        scene: The scene.
        levels: Levels of all joints.

    Raises:
        InputError: If the motion is a step and a joint has level ``kinematic``.
    """
    if scene.trajectory.kind == "step" and "kinematic" in levels:
        raise InputError(
            f"{scene.where}: trajectory.kind = 'step' at level kinematic, whose"
            " error is prescribed on a continuous commanded motion; accepted: level"
            " rigid, linear, native or full"
        )

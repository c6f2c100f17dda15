"""Scenes of the environments in which an arm tracks a path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swgjoint.drives.references import names_catalogue
from swgjoint.envs.arm.paths import tool_slopes
from swgjoint.envs.arm.settings import ArmSettings
from swgjoint.envs.specimen import load_drive_once
from swgjoint.errors import InputError
from swgjoint.faults import validate
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.arm.scene import is_arm, rigid_arm_of, scene_of_arm
from swgjoint.sim.assembly import Assembly
from swgjoint.sim.control import feedforward
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.scene.feature_sections import Payload
from swgjoint.sim.scene.scene import Scene
from swgjoint.typing import Array

STILL = 1e-9
"""Displacement of the tool per link angle below which it does not move [m/rad]."""


def scene_of(settings: ArmSettings) -> Scene:
    """The scene with level, friction and kinematic error of the settings."""
    name = str(settings.scene)
    if is_arm(name):
        scene = scene_of_arm(name).with_changes({"controller.kind": "pd"})
    else:
        scene = Scene.load_file(name)
    for section in (scene.defaults, *scene.joints.values()):
        if section.output_bearing is not None:
            raise InputError(f"scene {scene.name!r} has output_bearing; accepted: none")
        if section.thermal is not None:
            raise InputError(
                f"scene {scene.name!r} has thermal; accepted: a constant temperature_C"
            )
    scene = scene.with_level(settings.level)  # type: ignore[arg-type]
    scene = scene.with_friction(bool(settings.friction))
    scene = scene.with_kinematic_error(settings.kinematic_error_arcmin)
    if settings.payload_kg is None:
        return scene
    payload, (low, high) = None, settings.payload_bounds
    if high > 0.0:
        stated = {
            "mass_kg": 0.5 * (low + high),
            "centre_mm": settings.payload_centre_mm,
        }
        payload = validate(Payload, stated, where="payload of an environment")
    return scene.with_payload(payload)


def drives_of(scene: Scene) -> dict[str, DriveMap]:
    """Maps that need finite elements or a file, loaded once for all environments.

    Unsuitable scenes are rejected before any map is built.
    """
    sections = [scene.defaults, *scene.joints.values()]
    names = {s.drive for s in sections if s.drive is not None and s.model is None}
    slow = sorted(name for name in names if not names_catalogue(name))
    if slow:
        arm = rigid_arm_of(scene)
        _check_motion(scene, arm, trajectory_of(scene, arm).velocity[0])
    return {name: load_drive_once(name) for name in slow}


def _check_motion(scene: Scene, arm: RigidArm, first: Array) -> None:
    """Reject disturbances, an arm without a tool, and a start that is not at rest."""
    where = f"scene {scene.name!r}"
    if scene.disturbance:
        raise InputError(f"{where} has disturbances; accepted: none")
    if arm.tool < 0:
        raise InputError(
            f"{where}: the arm has no tool site; accepted: an arm with a tool site,"
            " which the reward needs"
        )
    if np.abs(first).max() > 0.0:
        raise InputError(f"{where} starts moving; accepted: a path that starts at rest")


def check_assembly(scene: Scene, assembly: Assembly) -> None:
    """Reject scenes with features that episodes do not support.

    Args:
        scene: The scene.
        assembly: The assembled scene.

    Raises:
        InputError: If the scene has such a feature.
    """
    _check_motion(scene, assembly.arm, assembly.trajectory.velocity[0])
    slopes = tool_slopes(assembly.arm, assembly.trajectory.position[:1])
    if np.abs(slopes).max() < STILL:
        raise InputError(
            f"scene {scene.name!r}: no joint moves the tool from its start; accepted:"
            " an arm whose tool moves, because the reward depends on its position"
        )
    where, loops = f"scene {scene.name!r}", assembly.loops
    if loops.sampled or any(loops.setpoints(j) for j in range(len(assembly.joints))):
        raise InputError(
            f"{where}: controller {scene.controller.kind!r}; accepted: kind pd within"
            " the engine's step, without sensors, control period or motor lines"
        )
    if scene.simulation.integrator != "discrete":
        raise InputError(
            f"{where}: integrator {scene.simulation.integrator!r}; accepted: discrete"
        )


def at_rest(assembly: Assembly) -> Assembly:
    """Copy of an assembled scene that rests in its start pose, for drawn paths."""
    path, load = assembly.trajectory, assembly.load
    still = np.zeros_like(path.position[:2])
    position = path.position[0] + still
    return replace(
        assembly,
        trajectory=replace(
            path,
            time=path.time[:2],
            position=position,
            velocity=still,
            acceleration=still,
        ),
        link_torque=load + assembly.arm.gravity(position),
        feedforward=feedforward(
            assembly.scene.controller.feedforward,
            link_torque=load + assembly.known_arm.gravity(position),
            acceleration=still,
            ratio=assembly.ratio,
            rotor_inertia=assembly.rotor_inertia,
        ),
    )

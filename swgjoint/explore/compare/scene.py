"""The scene of a comparison, and the joints whose drive or level is replaced."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase

from swgjoint.drives.references import find_drive
from swgjoint.drives.sections import LEVELS, JointSection
from swgjoint.errors import InputError
from swgjoint.gear.design.design import Design
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import near_names
from swgjoint.sim.arm.scene import (
    arm_scene,
    assumed_rotor_inertia,
    is_arm,
    rigid_arm_of,
)
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.step_choice import resolving_step

_END = "_joint"
"""Ending of joint names that a pattern may omit."""


def scene_or_arm(
    reference: str, overrides: Iterable[str] = ()
) -> tuple[Scene, tuple[str, ...]]:
    """Load a scene from a file or a bundled name, or create one for an arm.

    Args:
        reference: Scene file, MJCF or URDF file of an arm, or bundled name.
        overrides: ``key=value`` strings that change the scene.

    Returns:
        The scene, and the joints of an arm whose rotor inertia is assumed for their
        drive; a scene states that of its joints.

    Raises:
        InputError: If the reference is neither a scene nor an arm, or if a change is
            invalid.
    """
    overrides = list(overrides)
    if is_arm(reference):
        made = arm_scene(reference, overrides=overrides)
        return made.scene, made.assumed_rotors
    return Scene.load_file(reference, overrides), ()


def resolve_step(
    scene: Scene, arguments: Iterable[str], joints: Sequence[str] = ()
) -> Scene:
    """The scene with a time step that resolves the ripple of every compared drive.

    Args:
        scene: The scene; its own step is kept if it is short enough.
        arguments: Drives and levels that are compared.
        joints: Joints that get them; every driven joint if empty.
    """
    arm = rigid_arm_of(scene)
    steps = [
        resolving_step(with_drive(scene, name, joints), arm)
        for name in arguments
        if name not in LEVELS
    ]
    needed = min(steps, default=scene.simulation.step_s)
    if needed >= scene.simulation.step_s:
        return scene
    return scene.with_changes({"simulation.step_s": needed})


def joints_named(scene: Scene, patterns: Sequence[str]) -> tuple[str, ...]:
    """Joints of the scene's arm that match the patterns, in the order of the arm.

    Args:
        scene: The scene.
        patterns: Names or shell patterns, or several of them separated by commas; the
            ending ``_joint`` may be omitted. Without a pattern, no joint matches.

    Raises:
        InputError: If a pattern matches no joint.
    """
    wanted = [p.strip() for text in patterns for p in text.split(",") if p.strip()]
    if not wanted:
        return ()
    joints = rigid_arm_of(scene).joints
    found = {p: [name for name in joints if _fits(name, p)] for p in wanted}
    faults = []
    for pattern in (p for p in wanted if not found[p]):
        near = near_names(pattern, joints)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        faults.append(
            f"--joints {pattern}: no such joint in arm {scene.arm!r}; {hint}accepted:"
            f" {', '.join(joints)}, or a pattern such as 'wrist_*'"
        )
    if faults:
        raise InputError("\n".join(faults))
    chosen = {name for names in found.values() for name in names}
    return tuple(name for name in joints if name in chosen)


def source_of(argument: str) -> Design | DriveMap | None:
    """The drive that an argument of a comparison names, or None for a level.

    Raises:
        InputError: If the argument names neither; the message suggests a level with a
            similar name.
    """
    if argument in LEVELS:
        return None
    try:
        return find_drive(argument)
    except InputError as error:
        near = get_close_matches(argument, LEVELS, n=1)
        hint = f"; did you mean the level {near[0]}?" if near else ""
        raise InputError(f"{error}{hint}") from None


def _fits(name: str, pattern: str) -> bool:
    return any(fnmatchcase(n, pattern) for n in (name, name.removesuffix(_END)))


def with_drive(
    scene: Scene,
    reference: str,
    joints: Sequence[str] = (),
    assumed_rotors: Sequence[str] = (),
) -> Scene:
    """The scene with another drive in some joints.

    Args:
        scene: The scene.
        reference: Design, map or catalogue drive.
        joints: Joints that get it; every driven joint if empty.
        assumed_rotors: Joints in which the rotor inertia assumed for a drive comes with
            it; the other joints keep the rotor inertia of the scene.
    """

    def changed(section: JointSection) -> JointSection:
        return section.with_drive(reference) if joints or section.has_drive else section

    replaced = _changed(scene, changed, joints)
    rotor = {"rotor_inertia_kgm2": assumed_rotor_inertia(reference)}
    sections = dict(replaced.joints)
    for name in assumed_rotors:
        if name in joints or not joints:
            own = sections.get(name, JointSection())
            sections[name] = own.model_copy(update=rotor)
    return replaced.model_copy(update={"joints": sections})


def with_level(scene: Scene, level: str, joints: Sequence[str] = ()) -> Scene:
    """The scene with another level in some joints.

    Args:
        scene: The scene.
        level: Level of the joint model.
        joints: Joints that get it; every joint if empty.
    """
    return _changed(scene, lambda s: s.model_copy(update={"level": level}), joints)


def _changed(
    scene: Scene,
    change: Callable[[JointSection], JointSection],
    joints: Sequence[str],
) -> Scene:
    sections = dict(scene.joints)
    if joints:
        sections |= {n: change(sections.get(n, JointSection())) for n in joints}
        return scene.model_copy(update={"joints": sections})
    sections = {name: change(section) for name, section in sections.items()}
    return scene.model_copy(
        update={"defaults": change(scene.defaults), "joints": sections}
    )


def drives_of(scene: Scene, joints: Sequence[str]) -> tuple[str, ...]:
    """References of the drives in some joints of a scene, each once.

    Args:
        scene: The scene.
        joints: Names of the joints.
    """
    found = (scene.joint_settings(name).drive for name in joints)
    return tuple(dict.fromkeys(name for name in found if name is not None))

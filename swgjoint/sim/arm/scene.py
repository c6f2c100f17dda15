"""Generation of a scene for any arm: a drive in every hinge, and a slow motion."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swgjoint.drives.rotors import rotor_inertia_of
from swgjoint.errors import InputError
from swgjoint.flags import check_flags
from swgjoint.models_path import bundled_names, is_file
from swgjoint.sim.arm.drive_choice import DriveChoice, choose_drives
from swgjoint.sim.arm.gentle_sweep import (
    StartWarning,
    bent_starts,
    gentle_sweep,
    place_arm,
)
from swgjoint.sim.arm.motions import TOOL_MOTIONS, tables_of
from swgjoint.sim.arm.named_drives import ALL, check_drives, drives_by_joint
from swgjoint.sim.arm.payload import arms_of
from swgjoint.sim.arm.reading import ArmReading, patterns_of
from swgjoint.sim.arm.rigid_arm import RigidArm
from swgjoint.sim.motion.commanded import trajectory_of
from swgjoint.sim.scene.overrides import parse_override
from swgjoint.sim.scene.scene import Scene
from swgjoint.sim.step_choice import resolving_step
from swgjoint.typing import Array
from swgjoint.units import deg

ROTOR_INERTIA = 1e-4
"""Inertia of rotor and wave generator that is assumed for drives outside the catalogue,
as in the scene ``bench`` [kg·m²]."""


@dataclass(frozen=True, kw_only=True)
class ArmScene:
    """A generated scene for an arm."""

    scene: Scene
    """The scene."""
    drive_choice: dict[str, DriveChoice]
    """Drives that were selected by rule, by joint; without joints whose drive the user
    chose."""
    assumed_rotors: tuple[str, ...]
    """Joints whose rotor inertia is the one assumed for their drive, because the user
    stated none."""


def is_arm(reference: str) -> bool:
    """Whether a file or bundled name denotes an arm rather than a scene."""
    if Path(reference).suffix.lower() in (".xml", ".urdf", ".xacro"):
        return True
    return (
        not is_file(reference)
        and reference in bundled_names("arms", ".xml")
        and reference not in bundled_names("scenes", ".toml")
    )


def scene_of_arm(
    reference: str,
    *,
    drive: str | Mapping[str, str] | None = None,
    joints: Iterable[str] = (),
    pose: str | None = None,
    motion: str | None = None,
    balance_inertia: bool = False,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
) -> Scene:
    """Generate a scene for an arm, see :func:`arm_scene`.

    Args:
        reference: Path of an MJCF or URDF file, or the name of a bundled arm.
        drive: Drive of all joints, or drives by joint name or pattern; None selects one
            for each joint.
        joints: Names or patterns of the hinges that move; all if empty.
        pose: Start pose; None chooses one without contact.
        motion: Kind of the trajectory; None uses a sweep.
        balance_inertia: Whether to repair inertias that no rigid body can have.
        overrides: Changes of the scene.

    Returns:
        The scene, without the reasons for the selected drives.

    Raises:
        InputError: If the arm cannot be used.
    """
    return arm_scene(
        reference,
        drive=drive,
        joints=joints,
        pose=pose,
        motion=motion,
        balance_inertia=balance_inertia,
        overrides=overrides,
    ).scene


def arm_scene(
    reference: str,
    *,
    drive: str | Mapping[str, str] | None = None,
    joints: Iterable[str] = (),
    pose: str | None = None,
    motion: str | None = None,
    balance_inertia: bool = False,
    overrides: Mapping[str, Any] | Iterable[str] | None = None,
) -> ArmScene:
    """Generate a scene in which the chosen hinges have drives and move slowly.

    :func:`swgjoint.sim.arm.drive_choice.choose_drives` selects a drive for each joint
    whose drive is not stated. This rule is a starting point; the manufacturer of the
    arm may have chosen other drives. The rotor inertia of a joint follows its drive,
    see :func:`assumed_rotor_inertia`, unless the changes state one.

    Args:
        reference: Path of an MJCF or URDF file, or the name of a bundled arm.
        drive: Drive of all joints: design, map or catalogue name; or drives by joint
            name or pattern, of which the first that matches a joint applies.
        joints: Names or patterns of the hinges that move. A string may contain several,
            separated by commas. If empty, all hinges move. The others are held in the
            start pose.
        pose: Start pose, see :func:`swgjoint.sim.arm.gentle_sweep.place_arm`.
        motion: Kind of the trajectory; ``trajectory.kind`` of the overrides takes
            precedence, and None uses ``sweep``. If the tool cannot follow its motion
            from the start pose, the arm starts with bent joints, unless the user gave a
            start.
        balance_inertia: Whether to repair inertias that no rigid body can have.
        overrides: Changes of the scene, as for :meth:`Scene.load_file`. Unless they
            state ``simulation.step_s``, the step resolves the torque ripple of every
            drive if possible, see :mod:`swgjoint.sim.step_choice`.

    Returns:
        The scene, and the drives that were selected by rule.

    Raises:
        InputError: If the arm cannot be used.
    """
    check_flags(balance_inertia=balance_inertia)
    changes = _as_mapping(overrides)
    drives = {ALL: drive} if isinstance(drive, str) else drive or {}
    common = changes.get("defaults.drive", drives.get(ALL))
    kind = str(changes.get("trajectory.kind", motion or "sweep"))
    reading = ArmReading(
        driven=patterns_of(list(joints)), balance_inertia=balance_inertia
    )
    with warnings.catch_warnings(record=True) as recorded:
        warnings.simplefilter("always")
        arm, start = place_arm(reference, reading=reading, pose=pose)
        start = _started(arm, start, changes)
        by_tool = kind in TOOL_MOTIONS
        end = start if by_tool or kind == "csv" else gentle_sweep(arm, start)[1]
    _say_once(recorded)
    data: dict[str, Any] = {
        "name": _name(arm.path),
        "description": f"{kind.capitalize()} of {arm.path.name}",
        "arm": reference,
        "tool_site": _tool(arm, changes),
        "defaults": {"level": "full"},
        # the integral term prevents a lag due to drive friction
        "controller": {"kind": "pid", "feedforward": "gravity_inertia"},
    }
    if reading.driven:
        data["driven"] = list(reading.driven)
    if arm.reading.pose is not None:
        data["pose"] = arm.reading.pose
    if balance_inertia:
        data["balance_inertia"] = True
    held = {name: q / deg for name, q in arm.reading.angles.items()}
    try:
        scene, rigid = _with_motion(data, kind, arm, start, end, held, changes)
    except InputError:
        own = pose or any(key.startswith("trajectory.start_deg") for key in changes)
        bent = [] if own or not by_tool else bent_starts(arm, start)
        # a stretched arm cannot move its tool in every direction: try bent starts
        for other in bent:
            with suppress(InputError):
                scene, rigid = _with_motion(data, kind, arm, other, end, held, changes)
                break
        else:
            raise
    single = drives_by_joint(drives, rigid)
    if common is not None:
        data["defaults"] |= {"drive": common}
        choice = {}
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the run repeats these warnings
            choice = choose_drives(rigid, trajectory_of(scene, rigid))
    named = {joint: one.drive for joint, one in choice.items()} | single
    if named:
        data["joints"] = {joint: {"drive": name} for joint, name in named.items()}
    where = f"scene of {reference}"
    scene = Scene.from_data(data, where=where, overrides=changes)
    check_drives(scene, drives, single, changes)
    assumed = _add_rotors(data, scene, rigid.joints, common, changes)
    scene = Scene.from_data(data, where=where, overrides=changes)
    if not changes.keys() & {"simulation", "simulation.step_s"}:
        data["simulation"]["step_s"] = resolving_step(scene, rigid)
        scene = Scene.from_data(data, where=where, overrides=changes)
    kept = {
        joint: one
        for joint, one in choice.items()
        if joint not in single and scene.joint_settings(joint).drive == one.drive
    }
    return ArmScene(scene=scene, drive_choice=kept, assumed_rotors=assumed)


def _with_motion(
    data: dict[str, Any],
    kind: str,
    arm: RigidArm,
    start: Array,
    end: Array,
    held: dict[str, float],
    changes: Mapping[str, Any],
) -> tuple[Scene, RigidArm]:
    """Add the first motion of a kind that the arm can follow without a collision.

    If all candidates collide, the first one that the arm can follow is used.

    Args:
        data: Tables of the scene; changed in place.
        kind: Kind of the trajectory.
        arm: The arm.
        start: Joint angles at the start [rad]. Shape (n_joints,).
        end: Joint angles at the end of a sweep [rad]. Shape (n_joints,).
        held: Angles of held hinges by name [deg].
        changes: The user's changes of the scene.

    Returns:
        The scene, which has no drives yet, and its arm with its payload.

    Raises:
        InputError: If the arm can follow none of the candidates.
    """
    where = f"scene of {data['arm']}"
    tables, duration = tables_of(kind, arm, start, end)
    data["simulation"] = {"duration_s": duration}
    reachable: dict[str, Any] | None = None
    refused: InputError | None = None
    for candidate in tables:
        candidate["start_deg"] |= held
        data["trajectory"] = candidate
        scene = Scene.from_data(data, where=where, overrides=changes)
        rigid = arm
        if scene.payload is not None or kind in TOOL_MOTIONS or _read_anew(scene, arm):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the run repeats these warnings
                rigid = rigid_arm_of(scene)
        try:
            path = trajectory_of(scene, rigid)
        except InputError as exc:
            refused = refused or exc
            continue
        if not _collides(rigid, path.position, start):
            return scene, rigid
        reachable = reachable or candidate
    if reachable is None:
        raise InputError(
            f"{refused}; or another start: --pose NAME, --set"
            " trajectory.start_deg.JOINT=ANGLE"
        )
    data["trajectory"] = reachable
    return Scene.from_data(data, where=where, overrides=changes), rigid


def _read_anew(scene: Scene, arm: RigidArm) -> bool:
    """Whether the user's changes require that the arm is read again."""
    there, here = scene.reading, arm.reading
    return scene.arm != arm.reference or (
        there.driven,
        there.pose,
        there.balance_inertia,
    ) != (here.driven, here.pose, here.balance_inertia)


def rigid_arm_of(scene: Scene) -> RigidArm:
    """The arm of a scene with its payload."""
    arm, _ = arms_of(scene)
    return arm


def _collides(arm: RigidArm, path: Array, start: Array) -> bool:
    """Whether bodies that are apart at the start touch during a motion."""
    before = {pair[:2] for pair in arm.contacts(start[None])}
    few = path[:: max(1, len(path) // 100)]
    return any(pair[:2] not in before for pair in arm.contacts(few))


def _as_mapping(
    overrides: Mapping[str, Any] | Iterable[str] | None,
) -> dict[str, Any]:
    """Overrides as a mapping from dotted keys to values."""
    if isinstance(overrides, Mapping):
        return dict(overrides)
    return dict(parse_override(text) for text in overrides or ())


def _started(arm: RigidArm, start: Array, changes: Mapping[str, Any]) -> Array:
    """Start angles with those that the user stated [rad]; the scene reports faults."""
    start = start.copy()
    for key, value in changes.items():
        table, _, name = key.rpartition(".")
        if (
            table == "trajectory.start_deg"
            and name in arm.joints
            and isinstance(value, int | float)
        ):
            start[arm.joints.index(name)] = value * deg
    return start


def _say_once(recorded: list[warnings.WarningMessage]) -> None:
    """Issue recorded warnings about the start; the run repeats those about the file."""
    for one in recorded:
        if issubclass(one.category, StartWarning):
            warnings.warn(one.message, stacklevel=3)


def _name(path: Path) -> str:
    """Name of the scene: that of the arm's file, or of its folder for ``scene.xml``."""
    folder = path.resolve().parent.name
    return folder if path.stem.lower() == "scene" and folder else path.stem


def assumed_rotor_inertia(drive: str | None) -> float:
    """Inertia of rotor and wave generator that is assumed for a drive [kg·m²].

    It follows ratio and rated torque, see
    :func:`swgjoint.drives.rotors.rotor_inertia_of`.

    Args:
        drive: Design, map or catalogue name; None for a drive without a name, which
            gets :data:`ROTOR_INERTIA`.
    """
    known = None if drive is None else rotor_inertia_of(drive)
    return known or ROTOR_INERTIA


def _add_rotors(
    data: dict[str, Any],
    scene: Scene,
    joints: Iterable[str],
    drive: str | None,
    changes: Mapping[str, Any],
) -> tuple[str, ...]:
    """Add the rotor inertia that is assumed for the drive of every joint.

    Args:
        data: Tables of the scene; changed in place.
        scene: The scene of these tables and the user's changes.
        joints: Names of the joints.
        drive: Drive of all joints unless the changes state another; None if every joint
            has its own.
        changes: The user's changes of the scene.

    Returns:
        Joints whose rotor inertia is assumed; the user stated that of the others.
    """
    key = "rotor_inertia_kgm2"
    if drive is not None:
        data["defaults"] |= {key: assumed_rotor_inertia(drive)}
    if changes.keys() & {"joints", f"defaults.{key}"}:
        return ()
    assumed = tuple(
        joint
        for joint in joints
        if not changes.keys() & {f"joints.{joint}", f"joints.{joint}.{key}"}
    )
    for joint in assumed:
        own = scene.joint_settings(joint).drive
        if own != drive or drive is None:
            sections = data.setdefault("joints", {})
            sections.setdefault(joint, {})[key] = assumed_rotor_inertia(own)
    return assumed


def _tool(arm: RigidArm, changes: Mapping[str, Any]) -> str:
    """Name of the tool site: ``tool``, or else the end of the longest chain."""
    tool, *others = ["tool"] if arm.tool >= 0 else arm.ends
    if others and "tool_site" not in changes:
        warnings.warn(
            f"{arm.path}: tool errors are those of {tool}; other ends:"
            f" {', '.join(others)}; accepted: --set tool_site=NAME",
            stacklevel=3,
        )
    return tool

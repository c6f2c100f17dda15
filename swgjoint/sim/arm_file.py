"""A user's arm, MJCF or URDF, as the bare mechanics that a scene puts drives into."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import mujoco

from swgjoint.errors import InputError

MESHES = (".stl", ".obj", ".msh")
"""What the engine reads."""
_ON_JOINT = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmFile:
    """What a scene takes from the file of an arm."""

    spec: mujoco.MjSpec
    """Links, joints, shapes, tendons; without actuators, sensors, keyframes, limits of
    motor torque and armature, all of which are the drive's and the scene's."""
    held: dict[str, str]
    """Joints that the scene holds at their reference, and their type."""
    effort: dict[str, float]
    """Torque that the file lets motors exert on a joint, where it says so [N·m]."""


def read_arm(path: Path) -> ArmFile:
    """Read an arm and leave out what belongs to the scene.

    Joints that are no hinges are held at their reference position. Shapes of a URDF
    whose meshes are missing or of a kind that the engine does not read are left out:
    the file states the inertia. Either gives a warning of one line. Shapes of a URDF
    do not collide, for neighbours overlap and the format cannot say which may; those
    of an MJCF file do as it says.

    Raises:
        InputError: If the file is no arm, or joints of it cannot move on their own.
    """
    if path.suffix.lower() == ".xacro":
        raise InputError(
            f"{path}: a template of a URDF; accepted: what 'xacro {path.name}' makes of"
            " it, as a file ending .urdf"
        )
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as exc:
        line = " ".join(str(exc).split())
        raise InputError(f"{path}: not an MJCF arm and no URDF: {line}") from None
    if path.suffix.lower() == ".urdf":
        spec.compiler.fusestatic = False  # every link keeps its name
        spec.compiler.discardvisual = False  # what does not collide is seen, still
        _find_meshes(spec, path)
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
    for kind, elements in (("body", spec.bodies), ("joint", spec.joints)):
        named = {element.name for element in elements}
        for k, element in enumerate(elements):
            if not element.name:
                names = (f"{kind}_{j}" for j in count(k))
                element.name = next(name for name in names if name not in named)
                named.add(element.name)
    limits = _effort(spec)
    for element in [*spec.sensors, *spec.actuators, *spec.keys]:
        spec.delete(element)
    held = _hold(spec, path)
    for joint in spec.joints:
        joint.armature = 0.0
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.actfrcrange = [0.0, 0.0]
    effort = {name: limit for name, limit in limits.items() if name not in held}
    return ArmFile(spec=spec, held=held, effort=effort)


def _hold(spec: mujoco.MjSpec, path: Path) -> dict[str, str]:
    """Take out joints that are no hinges, and what ties them to each other."""
    held = {
        joint.name: mujoco.mjtJoint(joint.type).name.removeprefix("mjJNT_").lower()
        for joint in spec.joints
        if joint.type != mujoco.mjtJoint.mjJNT_HINGE
    }
    for equality in list(spec.equalities):
        tied = {equality.name1, equality.name2} - {""}
        if equality.active and not tied <= set(held):
            kind = mujoco.mjtEq(equality.type).name.removeprefix("mjEQ_").lower()
            raise InputError(
                f"{path}: equality {equality.name or kind!r} ties"
                f" {' and '.join(sorted(tied))}; accepted in a scene: joints that move"
                " on their own"
            )
        spec.delete(equality)
    for tendon in list(spec.tendons):
        joints = {
            w.target.name for w in tendon.path if w.type == mujoco.mjtWrap.mjWRAP_JOINT
        }
        if joints & set(held):
            spec.delete(tendon)
    for name in held:
        spec.delete(spec.joint(name))
    if held and spec.joints:
        which = ", ".join(f"{name} ({kind})" for name, kind in held.items())
        warnings.warn(
            f"{path}: held at the reference position, because a drive needs a hinge:"
            f" {which}",
            stacklevel=2,
        )
    return held


def _effort(spec: mujoco.MjSpec) -> dict[str, float]:
    """Largest motor torque on every joint that the file limits [N·m]."""
    limits: dict[str, float] = {}
    for actuator in spec.actuators:
        force = max(map(abs, actuator.forcerange))
        plain = actuator.biastype == mujoco.mjtBias.mjBIAS_NONE
        if not force and plain:
            force = abs(actuator.gainprm[0]) * max(map(abs, actuator.ctrlrange))
        if force and actuator.trntype in _ON_JOINT:
            limits[actuator.target] = float(force * abs(actuator.gear[0]))
    for joint in spec.joints:  # of URDF: <limit effort="...">
        if force := max(map(abs, joint.actfrcrange)):
            limits[joint.name] = float(force)
    return limits


def _find_meshes(spec: mujoco.MjSpec, path: Path) -> None:
    """Resolve ``package://`` and leave out shapes whose mesh cannot be read."""
    missing = []
    for mesh in list(spec.meshes):
        file = _mesh_file(mesh.file, path.parent, spec.meshdir)
        if file is not None:
            mesh.file = str(file)
            continue
        missing.append(mesh.file)
        for geom in [g for g in spec.geoms if g.meshname == mesh.name]:
            spec.delete(geom)
        spec.delete(mesh)
    if missing:
        warnings.warn(
            f"{path}: shapes are left out: {len(missing)} meshes not found or not of"
            f" {', '.join(MESHES)}, the first is {missing[0]}",
            stacklevel=3,
        )


def _mesh_file(reference: str, folder: Path, meshdir: str) -> Path | None:
    """Where a mesh of a URDF lies; None if nowhere or of another kind."""
    scheme, colon, rest = reference.partition("://")
    if not colon:
        candidates = [folder / meshdir / reference, folder / reference]
    elif scheme == "package":
        # a package is a folder above the file, or beside one above it
        package, _, inside = rest.partition("/")
        above = folder.resolve()
        candidates = [
            place / inside
            for parent in (above, *above.parents)
            for place in ((parent,) if parent.name == package else (parent / package,))
        ]
    else:
        candidates = [Path(rest)]
    for file in candidates:
        if file.suffix.lower() in MESHES and file.is_file():
            return file.resolve()
    return None

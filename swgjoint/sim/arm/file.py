"""Import of an arm from MJCF or URDF: links, joints and shapes, without motors."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.sim.arm.compiling import skeleton
from swgjoint.sim.arm.holding import FREE, NOT_CHOSEN, choose_held, hold
from swgjoint.sim.arm.number_checks import check_numbers
from swgjoint.sim.arm.opening import open_model
from swgjoint.sim.arm.reading import ArmReading

_ON_JOINT = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_OF_ACTUATORS = (
    *("ctrllimited", "ctrlrange", "forcelimited", "forcerange", "actlimited"),
    *("actrange", "actdim", "actearly", "inheritrange", "gear", "gaintype", "gainprm"),
    *("biastype", "biasprm", "dyntype", "dynprm", "delay", "nsample", "interp"),
    *("damping", "armature", "cranklength", "lengthrange"),
)
"""Attributes of actuators that a default class may set."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmFile:
    """Contents of an arm's file that a scene uses."""

    spec: mujoco.MjSpec
    """Links, joints that move, shapes and tendons. Actuators, sensors, keyframes,
    equalities, motor torque limits and armature are removed."""
    held: dict[str, str]
    """Held joints, each with the reason: its type, what ties it, or that it has no
    drive."""
    keyframes: dict[str, dict[str, float]]
    """Named poses of the file: angles of all hinges [rad]."""
    effort: dict[str, float]
    """Motor torque limits of the joints for which the file states one [N·m]."""


def read_arm(path: Path, reading: ArmReading | None = None) -> ArmFile:
    """Read an arm and remove everything that drives or scene provide.

    The following cases cause a one-line warning each:

    - Joints that are not hinges, or that an equality ties to others, are held in the
      pose of ``reading``.
    - Shapes of a URDF file are dropped if their meshes are missing or in a format that
      the engine does not read. This does not affect the inertias, which the file
      states.
    - Gravity compensation (``gravcomp``) is removed, because the drives carry the
      weight.

    Shapes of a URDF file do not collide, because adjacent links overlap and the format
    cannot exclude such contacts. Shapes of an MJCF file collide as the file states.

    Args:
        path: MJCF or URDF file.
        reading: Hinges that move, and pose of held joints; None moves every hinge.

    Returns:
        The contents of the file that a scene uses.

    Raises:
        InputError: If the file is not an arm, or if all its hinges are tied to others.
    """
    try:
        return _arm_of(path, reading or ArmReading())
    except UnicodeDecodeError as error:  # the engine accepts names of any bytes
        byte = error.object[error.start]
        raise InputError(
            f"{path}: a name in the file has the byte 0x{byte:02x}, which is not UTF-8;"
            " accepted: text in UTF-8"
        ) from None


def _arm_of(path: Path, reading: ArmReading) -> ArmFile:
    """The arm in a file, see :func:`read_arm`."""
    spec = open_model(path)
    if reading.balance_inertia:
        _balance_inertia(spec, path)
    _check_references(spec, path)
    limits = _effort(spec)
    for name, limit in limits.items():
        if np.isnan(limit):
            raise InputError(
                f"{path}: torque limit {limit} N·m of joint {name[:60]!r}; accepted: a"
                " number, or none"
            )
    for element in [*spec.sensors, *spec.actuators]:
        spec.delete(element)
    for key in spec.keys:
        key.ctrl, key.act = [], []  # the actuators that they refer to are removed
    bones = skeleton(spec, where=str(path))
    check_numbers(bones, where=str(path))
    keyframes = _keyframes(bones)
    if reading.pose is not None and reading.pose not in keyframes:
        known = ", ".join(keyframes) or "none in this file"
        raise InputError(f"{path}: no keyframe {reading.pose!r}; accepted: {known}")
    holding = choose_held(spec, reading, path)
    hold(spec, holding, reading, bones, path)
    for key in list(spec.keys):
        spec.delete(key)
    _tell_held(holding.held, reading, path, moves=bool(spec.joints))
    _let_weigh(spec, path)
    _solve_well(spec)
    _forget_actuators(spec)
    for joint in spec.joints:
        joint.armature = 0.0
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        joint.actfrcrange = [0.0, 0.0]
    effort = {
        name: limit
        for name, limit in limits.items()
        if name not in holding.held and np.isfinite(limit)  # inf means no limit
    }
    return ArmFile(spec=spec, held=holding.held, keyframes=keyframes, effort=effort)


def _check_references(spec: mujoco.MjSpec, path: Path) -> None:
    """Reject tendons, equalities and pairs that refer to elements missing in the file.

    The engine would reject them, too, but only after the held joints are removed.
    """
    tendons = [
        (f"tendon {tendon.name!r}", wrap.target)
        for tendon in spec.tendons
        for wrap in tendon.path
        if wrap.type != mujoco.mjtWrap.mjWRAP_PULLEY
    ]
    equalities = [
        (f"equality {equality.name!r}", _tied_element(spec, equality, name))
        for equality in spec.equalities
        for name in (equality.name1, equality.name2)
        if name
    ]
    pairs = [
        (f"contact pair {pair.name!r}", spec.geom(name))
        for pair in spec.pairs
        for name in (pair.geomname1, pair.geomname2)
    ]
    for element, target in [*tendons, *equalities, *pairs]:
        if target is None:
            raise InputError(
                f"{path}: {element} refers to an element that is not in the file;"
                " accepted: joints, sites, bodies, geoms and tendons of the file"
            )


def _tied_element(
    spec: mujoco.MjSpec, equality: mujoco.MjsEquality, name: str
) -> object:
    """Element to which an equality refers by name; None if it is missing.

    For kinds of equality that :func:`choose_held` rejects, the name itself is returned.
    """
    if equality.type == mujoco.mjtEq.mjEQ_JOINT:
        return spec.joint(name)
    if equality.type == mujoco.mjtEq.mjEQ_TENDON:
        return spec.tendon(name)
    if equality.type not in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
        return name
    on_site = equality.objtype == mujoco.mjtObj.mjOBJ_SITE
    return spec.site(name) if on_site else spec.body(name)


def _forget_actuators(spec: mujoco.MjSpec) -> None:
    """Reset the actuator defaults of the file, so that the scene's motors are plain."""
    fresh = mujoco.MjSpec()
    own, plain = spec.default.actuator, fresh.default.actuator
    for key in _OF_ACTUATORS:
        setattr(own, key, getattr(plain, key))


def _balance_inertia(spec: mujoco.MjSpec, path: Path) -> None:
    """Replace the moments of inertia of impossible rigid bodies.

    Their mean replaces the moments; a body that has a mass alone becomes a solid sphere
    with the density of water, which a warning states.
    """
    # the compiler replaces moments that violate the triangle inequality; the loop
    # replaces inertia tensors that are zero or not positive definite
    spec.compiler.balanceinertia = True
    spheres = []
    for body in spec.bodies:
        full = np.array(body.fullinertia)
        if not np.isfinite(full).all():  # the file states principal moments, or none
            if body.explicitinertial and body.mass > 0.0 and not any(body.inertia):
                body.inertia = 3 * [_sphere_inertia(body.mass)]
                spheres.append(body)
            continue
        xx, yy, zz, xy, xz, yz = full
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if body.mass > 0.0 and not full.any():
            body.fullinertia = [*3 * [_sphere_inertia(body.mass)], 0.0, 0.0, 0.0]
            spheres.append(body)
        elif (xx + yy + zz) > 0.0 and np.linalg.eigvalsh(tensor)[0] <= 0.0:
            body.fullinertia = [*3 * [(xx + yy + zz) / 3.0], 0.0, 0.0, 0.0]
    if spheres:
        which = ", ".join(
            f"{body.name} ({_sphere_inertia(body.mass):.3g} kg·m²)" for body in spheres
        )
        warnings.warn(
            f"{path}: moments of inertia of solid spheres of water are assumed for"
            f" bodies with a mass alone: {which}",
            stacklevel=3,
        )


def _sphere_inertia(mass: float) -> float:
    """Moment of inertia of a solid sphere with the density of water [kg·m²]."""
    radius = (max(mass, 0.0) / (4.0 / 3.0 * np.pi * 1000.0)) ** (1.0 / 3.0)
    return float(0.4 * mass * radius**2)


def _keyframes(model: mujoco.MjModel) -> dict[str, dict[str, float]]:
    """Hinge angles of all keyframes [rad]."""
    hinges = [model.joint(j) for j in range(model.njnt)]
    hinges = [j for j in hinges if j.type[0] == mujoco.mjtJoint.mjJNT_HINGE]
    return {
        model.key(k).name: {
            j.name: float(model.key_qpos[k, j.qposadr[0]]) for j in hinges
        }
        for k in range(model.nkey)
    }


def _tell_held(
    held: dict[str, str], reading: ArmReading, path: Path, *, moves: bool
) -> None:
    """Warn in one line about joints that are held for a reason other than ``driven``.

    There is no warning if no joint moves, because the caller then raises an error.
    """
    reported = {name: why for name, why in held.items() if why != NOT_CHOSEN}
    if not reported or not moves:
        return
    where = "the reference position"
    if reading.pose is not None:
        where = f"keyframe {reading.pose!r}"
    hangs = ""
    if FREE in reported.values():
        hangs = "; a robot without its free joint hangs and does not touch the floor"
    which = ", ".join(f"{name} ({why})" for name, why in reported.items())
    warnings.warn(
        f"{path}: held at {where}, because a drive needs a hinge that moves"
        f" independently: {which}{hangs}",
        stacklevel=3,
    )


def _let_weigh(spec: mujoco.MjSpec, path: Path) -> None:
    """Remove gravity compensation, which would carry weight instead of the drives."""
    carried = [body for body in spec.bodies if body.gravcomp]
    for body in carried:
        body.gravcomp = 0.0
    if carried:
        warnings.warn(
            f"{path}: gravcomp of {len(carried)} bodies is ignored, because the drives"
            f" carry the weight: {', '.join(body.name for body in carried)}",
            stacklevel=3,
        )


def _effort(spec: mujoco.MjSpec) -> dict[str, float]:
    """Motor torque limits of the joints for which the file states one [N·m]."""
    limits: dict[str, float] = {}
    for actuator in spec.actuators:
        force = max(map(abs, actuator.forcerange))
        plain = actuator.biastype == mujoco.mjtBias.mjBIAS_NONE
        if not force and plain:
            force = abs(actuator.gainprm[0]) * max(map(abs, actuator.ctrlrange))
        if force and actuator.trntype in _ON_JOINT:
            limits[actuator.target] = float(force * abs(actuator.gear[0]))
    for joint in spec.joints:  # from URDF: <limit effort="...">
        if force := max(map(abs, joint.actfrcrange)):
            limits[joint.name] = float(force)
    return limits


def _solve_well(spec: mujoco.MjSpec) -> None:
    """Set the solver effort to at least the engine's defaults.

    Files made for reinforcement learning limit the solver to a few iterations. The
    drives are part of the system that the solver solves in every step. If it does not
    converge, their torques are wrong.
    """
    usual = mujoco.MjSpec().option
    option = spec.option
    option.solver = usual.solver
    option.noslip_iterations = usual.noslip_iterations
    for name in ("iterations", "ls_iterations"):
        setattr(option, name, max(getattr(option, name), getattr(usual, name)))
    for name in ("tolerance", "ls_tolerance"):
        setattr(option, name, min(getattr(option, name), getattr(usual, name)))

"""Put a drive on a hinge of any MuJoCo model by editing its MjSpec."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.joint import plugin
from swgjoint.joint.drive import JointDrive, UnresolvedOrder, prune
from swgjoint.maps.drive_map import DriveMap
from swgjoint.units import deg

LEVELS = ("rigid", "linear", "full")
ROTOR_MASS = 1e-9
"""Mass of the rotor body [kg]; the arm's model already holds the motor's mass."""

_INTEGRATOR = mujoco.mjtIntegrator


def attach(
    spec: mujoco.MjSpec,
    *,
    joint: str,
    drive: DriveMap,
    level: str = "full",
    rotor_inertia: float,
    damping_ratio: float | None = None,
    max_input_speed: float | None = None,
    max_phase_step: float = 0.5,
) -> JointDrive:
    """Turn a hinge into the output of a strain wave gear.

    ``rigid`` gives the joint the reflected inertia i²J as armature. ``linear`` and
    ``full`` add a rotor (body ``<joint>_rotor`` with a hinge of the same name, beside
    the link under the same parent) and a tendon ``<joint>_drive`` with the length
    theta/i - psi: a native spring and damper, or the carrier of the engine plugin's
    instance of the same name, which evaluates ``drive``. The rotor takes the place of
    the joint's own armature, which is set to 0. Keyframes grow by the rotor, at the
    position without torsion.

    No actuator is added and none is changed. The motor belongs on the rotor::

        got = attach(spec, joint="elbow", drive=drive, rotor_inertia=4e-5)
        motor = spec.add_actuator(name="elbow_motor", target=got.rotor or got.joint)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gear[0] = 1.0 if got.rotor else got.ratio     # rigid: on the joint

    ``linear`` and ``full`` replace MuJoCo's default integrator Euler by ``discrete``;
    another one is kept: RK4 is the reference below its step limit. Under ``discrete``
    the native spring of ``linear`` is damped by the step itself, about h w/2 of
    critical at a torsion frequency w; ``full`` is not. Set the timestep first.

    Args:
        spec: Model to edit.
        joint: Name of a hinge, the first joint of its body.
        drive: Map of the drive.
        level: ``rigid``, ``linear`` or ``full``.
        rotor_inertia: Rotor and wave generator about their axis [kg·m²].
        damping_ratio: Share of critical damping of rotor against link with the link
            inertia at qpos0, the other joints held; that of the map if None [-].
        max_input_speed: Largest speed of the rotor [rad/s]; harmonics that the step
            cannot carry at it are left out. None keeps all.
        max_phase_step: Largest phase step h n |theta rate| that is kept [rad].

    Raises:
        InputError: If the joint, the level or a value cannot be used; the spec is
            then unchanged.
        ComputationError: If the plugin cannot be loaded or the engine does not take
            its metric.
    """
    if level not in LEVELS:
        raise InputError(f"level {level!r} unknown; accepted: {', '.join(LEVELS)}")
    _positive("rotor_inertia", rotor_inertia, "kg·m²")
    if damping_ratio is None:
        damping_ratio = drive.damping_ratio
    if not (np.isfinite(damping_ratio) and 0.0 <= damping_ratio < 1.0):
        raise InputError(
            f"damping_ratio {damping_ratio} of {joint!r}; accepted: 0 to 1"
        )
    if max_input_speed is not None:
        _positive("max_input_speed", max_input_speed, "rad/s")
    _positive("max_phase_step", max_phase_step, "rad")
    if level != "rigid":
        _check_option(spec, level)
    place = _find_place(spec, joint, rotor_inertia)

    ratio = drive.ratio
    stiffness = drive.mean_stiffness
    reflected = ratio**2 * rotor_inertia
    reduced = reflected * place.inertia / (reflected + place.inertia)
    damping = 2.0 * damping_ratio * float(np.sqrt(stiffness * reduced))
    unresolved: tuple[UnresolvedOrder, ...] = ()
    if level == "full":
        plugin.load()
        if spec.option.integrator in (
            _INTEGRATOR.mjINT_EULER,
            _INTEGRATOR.mjINT_DISCRETE,
        ):
            plugin.require_metric()
        if max_input_speed is not None:
            drive, unresolved = prune(
                drive,
                timestep=float(spec.option.timestep),
                max_input_speed=max_input_speed,
                max_phase_step=max_phase_step,
            )

    # nothing can fail from here on: the spec is edited whole or not at all
    names: dict[str, str | None] = {"rotor": None, "tendon": None, "plugin": None}
    if level == "rigid":
        place.joint.armature = reflected
        damping = 0.0
    else:
        names["rotor"] = rotor = f"{joint}_rotor"
        names["tendon"] = tendon = f"{joint}_drive"
        body = _add_rotor(spec, place, rotor, rotor_inertia, ratio)
        if level == "linear":
            _add_tendon(
                spec, tendon, rotor, joint, ratio, (stiffness, 0.0, 0.0), damping
            )
        else:
            names["plugin"] = tendon
            _add_tendon(spec, tendon, rotor, joint, ratio, plugin.TENDON_STIFFNESS, 0.0)
            spec.activate_plugin(plugin.NAME)
            instance = spec.add_plugin(
                name=tendon, plugin_name=plugin.NAME, active=True
            )
            instance.config = plugin.config(drive, damping=damping)
            # an instance that no body refers to is lost when a spec is copied
            body.plugin = instance
            body.plugin.name = tendon
            body.plugin.plugin_name = plugin.NAME
            body.plugin.active = True
        if spec.option.integrator == _INTEGRATOR.mjINT_EULER:
            spec.option.integrator = _INTEGRATOR.mjINT_DISCRETE
    return JointDrive(
        joint=joint,
        rotor=names["rotor"],
        tendon=names["tendon"],
        plugin=names["plugin"],
        level=level,
        ratio=ratio,
        rotor_inertia=float(rotor_inertia),
        link_inertia=place.inertia,
        stiffness=stiffness,
        damping=damping,
        drive=drive,
        unresolved=unresolved,
    )


def _positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"{name} {value} {unit}; accepted: a finite number > 0")


def _check_option(spec: mujoco.MjSpec, level: str) -> None:
    """Refuse or warn about options under which a drive does not hold."""
    integrator = _INTEGRATOR(spec.option.integrator)
    name = integrator.name.removeprefix("mjINT_").lower()
    if integrator in (_INTEGRATOR.mjINT_EULER, _INTEGRATOR.mjINT_DISCRETE):
        if spec.option.solver == mujoco.mjtSolver.mjSOL_PGS:
            raise InputError(
                "solver PGS leaves tendons out of the discrete integrator's metric and "
                "would integrate the drive explicitly; accepted: Newton, CG"
            )
        if spec.option.noslip_iterations > 0:
            warnings.warn(
                "noslip_iterations > 0 solves contacts without the drives' stiffness; "
                "set it to 0 with drives",
                stacklevel=3,
            )
    elif integrator != _INTEGRATOR.mjINT_RK4:
        what = (
            "drops the rotor-link terms of the tendon's damping"
            if level == "linear"
            else "integrates the drive explicitly"
        )
        warnings.warn(
            f"integrator {name} {what}; use discrete, or RK4 as the reference",
            stacklevel=3,
        )


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where a joint stands in the compiled model."""

    joint: Any
    parent: Any
    pos: NDArray[np.float64]
    quat: NDArray[np.float64]
    axis: NDArray[np.float64]
    ref: float
    inertia: float


def _check_compiler(spec: mujoco.MjSpec, rotor_inertia: float) -> None:
    """Refuse compiler settings that would change the rotor's inertia."""
    compiler = spec.compiler
    if compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        raise InputError(
            "compiler inertiafromgeom is true, so a rotor without geoms would have no "
            "inertia; accepted: auto, false"
        )
    if compiler.settotalmass > 0.0:
        raise InputError(
            f"compiler settotalmass {compiler.settotalmass} kg scales the rotor's "
            "inertia too; accepted: not set"
        )
    if compiler.boundinertia > rotor_inertia:
        raise InputError(
            f"compiler boundinertia {compiler.boundinertia} kg·m² is above the rotor's "
            f"inertia {rotor_inertia} kg·m²; accepted: at most that"
        )


def _find_place(spec: mujoco.MjSpec, name: str, rotor_inertia: float) -> _Place:
    found = spec.joint(name)
    if found is None:
        known = ", ".join(j.name for j in spec.joints if j.name) or "none"
        raise InputError(f"joint {name!r} is not in the model; its joints: {known}")
    if found.type != mujoco.mjtJoint.mjJNT_HINGE:
        kind = mujoco.mjtJoint(found.type).name.removeprefix("mjJNT_").lower()
        raise InputError(f"joint {name!r} is a {kind} joint; a drive needs a hinge")
    for taken in (f"{name}_rotor", f"{name}_drive"):
        if spec.body(taken) or spec.joint(taken) or spec.tendon(taken):
            raise InputError(
                f"joint {name!r} has a drive already: {taken!r} is in the model"
            )
    _check_compiler(spec, rotor_inertia)
    body = found.parent
    if body.joints[0].name != name:
        raise InputError(
            f"joint {name!r} is not the first joint of body {body.name!r}; give it a "
            "body of its own"
        )
    copy = spec.copy()
    copy.compiler.fusestatic = False  # keeps every body where the spec has it
    try:
        model = copy.compile()
    except ValueError as error:
        raise InputError(f"the model does not compile: {error}") from error
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    j = int(model.joint(name).id)
    b, dof = int(model.jnt_bodyid[j]), int(model.jnt_dofadr[j])
    offset = np.zeros(3)
    mujoco.mju_rotVecQuat(offset, model.jnt_pos[j], model.body_quat[b])
    return _Place(
        joint=found,
        parent=body.parent,
        pos=model.body_pos[b] + offset,
        quat=model.body_quat[b].copy(),
        axis=model.jnt_axis[j].copy(),
        ref=float(model.qpos0[model.jnt_qposadr[j]]),
        inertia=float(mass[dof, dof] - model.dof_armature[dof]),
    )


def _add_rotor(
    spec: mujoco.MjSpec, place: _Place, name: str, inertia: float, ratio: float
) -> Any:
    """Rotor body and hinge at the joint's place, nothing inherited from defaults."""
    body = place.parent.add_body(name=name, pos=place.pos, quat=place.quat)
    body.explicitinertial = True
    body.mass = ROTOR_MASS
    body.ipos = np.zeros(3)  # unset, it is not written to XML
    # a ball: the spin about the axis is what counts, and no axis needs aligning
    body.inertia = np.full(3, inertia)
    hinge = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE)
    hinge.pos = np.zeros(3)
    hinge.axis = place.axis
    hinge.stiffness = np.zeros(3)
    hinge.damping = np.zeros(3)
    hinge.springdamper = np.zeros(2)
    hinge.springyield = 0.0
    hinge.armature = 0.0
    hinge.frictionloss = 0.0
    hinge.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    hinge.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    hinge.ref = place.ref * ratio / (deg if spec.compiler.degree else 1.0)
    place.joint.armature = 0.0
    _extend_keys(spec, name, place.joint.name, ratio)
    return body


def _add_tendon(
    spec: mujoco.MjSpec,
    name: str,
    rotor: str,
    link: str,
    ratio: float,
    stiffness: tuple[float, float, float],
    damping: float,
) -> None:
    """Fixed tendon of length theta/i - psi, nothing inherited from defaults."""
    tendon = spec.add_tendon(name=name)
    tendon.stiffness = np.array(stiffness)
    tendon.damping = np.array([damping, 0.0, 0.0])
    tendon.springlength = np.zeros(2)
    tendon.springyield = 0.0
    tendon.armature = 0.0
    tendon.frictionloss = 0.0
    tendon.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    tendon.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    tendon.wrap_joint(rotor, 1.0 / ratio)
    tendon.wrap_joint(link, -1.0)


def _extend_keys(spec: mujoco.MjSpec, rotor: str, link: str, ratio: float) -> None:
    """Give every keyframe the rotor's position and velocity, without torsion."""
    if not any(len(key.qpos) or len(key.qvel) for key in spec.keys):
        return
    bare = spec.copy()
    for key in list(bare.keys):
        bare.delete(key)
    model = bare.compile()
    m, j = model.joint(rotor), model.joint(link)
    for field, old, new in (
        ("qpos", int(j.qposadr[0]), int(m.qposadr[0])),
        ("qvel", int(j.dofadr[0]), int(m.dofadr[0])),
    ):
        size = model.nq if field == "qpos" else model.nv
        # addresses after the rotor have moved up by one
        source = old - (old > new)
        for key in spec.keys:
            values = list(getattr(key, field))
            if len(values) == size - 1:
                values.insert(new, ratio * values[source])
                setattr(key, field, values)

"""Whether and where a model takes a drive: the checks before a spec is edited."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.joint.obstacles import actuators_on, driven_joint


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where a joint stands in the compiled model."""

    joint: Any
    parent: Any
    model: mujoco.MjModel
    """The model before the drive."""
    index: int
    """Of the joint in it."""
    pos: NDArray[np.float64]
    quat: NDArray[np.float64]
    axis: NDArray[np.float64]
    ref: float
    armature: float
    """Of the joint and of the actuators on it [kg·m²]."""
    inertia: float
    """At qpos0, the other joints held, without armature [kg·m²]."""
    free_inertia: float
    """At qpos0, the other joints free, with armature [kg·m²]."""


def check_option(spec: mujoco.MjSpec, level: str) -> None:
    """Refuse or warn about options under which a drive does not hold.

    Raises:
        InputError: For a solver that leaves the drive's stiffness out.
    """
    integrator = mujoco.mjtIntegrator(spec.option.integrator)
    name = integrator.name.removeprefix("mjINT_").lower()
    if integrator in (
        mujoco.mjtIntegrator.mjINT_EULER,
        mujoco.mjtIntegrator.mjINT_DISCRETE,
    ):
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
    elif integrator != mujoco.mjtIntegrator.mjINT_RK4:
        what = (
            "drops the rotor-link terms of the tendon's damping"
            if level in ("linear", "native")
            else "integrates the drive explicitly"
        )
        warnings.warn(
            f"integrator {name} {what}; use discrete, or RK4 as the reference",
            stacklevel=3,
        )


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


def find_place(spec: mujoco.MjSpec, name: str, rotor_inertia: float) -> Place:
    """Find a hinge that can take a drive, from a compiled copy of the spec.

    Raises:
        InputError: If the joint is unknown or cannot take a drive.
    """
    found = driven_joint(spec, name)
    _check_compiler(spec, rotor_inertia)
    copy = spec.copy()
    copy.compiler.fusestatic = False  # keeps every body where the spec has it
    try:
        model = copy.compile()
    except ValueError as error:
        line = " ".join(str(error).split())
        raise InputError(f"the model does not compile: {line}") from error
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    j = int(model.joint(name).id)
    b, dof = int(model.jnt_bodyid[j]), int(model.jnt_dofadr[j])
    if model.jnt_actgravcomp[j] and model.body_gravcomp.any():
        raise InputError(
            f"joint {name!r} has actuatorgravcomp, a torque on the link past the drive;"
            " accepted: false"
        )
    motors = list(actuators_on(spec, name))
    armature = float(model.dof_armature[dof]) + float(
        model.actuator_armature[motors] @ model.actuator_gear[motors, 0] ** 2
    )
    offset = np.zeros(3)
    mujoco.mju_rotVecQuat(offset, model.jnt_pos[j], model.body_quat[b])
    return Place(
        joint=found,
        parent=found.parent.parent,
        model=model,
        index=j,
        pos=model.body_pos[b] + offset,
        quat=model.body_quat[b].copy(),
        axis=model.jnt_axis[j].copy(),
        ref=float(model.qpos0[model.jnt_qposadr[j]]),
        armature=armature,
        inertia=float(mass[dof, dof]) - armature,
        free_inertia=float(1.0 / np.linalg.inv(mass)[dof, dof]),
    )

"""Whether and where a model takes a drive: the checks before a spec is edited."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where a joint stands in the compiled model."""

    joint: Any
    parent: Any
    pos: NDArray[np.float64]
    quat: NDArray[np.float64]
    axis: NDArray[np.float64]
    ref: float
    inertia: float


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
    return Place(
        joint=found,
        parent=body.parent,
        pos=model.body_pos[b] + offset,
        quat=model.body_quat[b].copy(),
        axis=model.jnt_axis[j].copy(),
        ref=float(model.qpos0[model.jnt_qposadr[j]]),
        inertia=float(mass[dof, dof] - model.dof_armature[dof]),
    )

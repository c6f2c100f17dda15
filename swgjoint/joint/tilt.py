"""Tilt hinges of output bearings in a MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import Any

import mujoco
import numpy as np

from swgjoint.gear.bearing.output_bearing import OutputBearing
from swgjoint.joint.elements import has_positions

DIRECTIONS = ("x", "y")
"""Ends of the names of the two tilt hinges of a joint."""


def tilt_names(joint: str) -> tuple[str, ...]:
    """Names of the two tilt hinges of a joint."""
    return tuple(f"{joint}_tilt_{direction}" for direction in DIRECTIONS)


def add_tilt_hinges(spec: mujoco.MjSpec, bearings: Mapping[str, OutputBearing]) -> None:
    """Let output bearings tilt: two elastic hinges per joint, perpendicular to it.

    The hinges follow the joint in the link, at the centre of the bearing, and turn with
    the link. Their damping refers to the inertia at qpos0 with the other joints locked.
    Keyframes gain untilted bearings. The integrator ``discrete`` treats the springs
    implicitly, so that stiff bearings need no shorter step.

    Args:
        spec: Model with attached drives, which is changed.
        bearings: Bearings by joint; without any, the model remains unchanged.
    """
    if not bearings:
        return
    hinges: dict[str, Any] = {}
    for joint, bearing in bearings.items():
        hinge = spec.joint(joint)
        axis = np.asarray(hinge.axis, float) / np.linalg.norm(hinge.axis)
        across = np.eye(3)[int(np.abs(axis).argmin())]
        first = np.cross(axis, across)
        first /= np.linalg.norm(first)
        for name, direction in zip(
            tilt_names(joint), (first, np.cross(axis, first)), strict=True
        ):
            tilt = hinge.parent.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE)
            tilt.pos = np.asarray(hinge.pos, float) + bearing.centre * axis
            tilt.axis = direction
            # an explicit value for everything that a default class could set
            tilt.stiffness = np.array([bearing.tilt_stiffness, 0.0, 0.0])
            tilt.damping = np.zeros(3)
            tilt.springdamper = np.zeros(2)
            tilt.springref = tilt.ref = tilt.springyield = 0.0
            tilt.armature = tilt.frictionloss = 0.0
            tilt.actgravcomp = False
            tilt.limited = mujoco.mjtLimited.mjLIMITED_FALSE
            tilt.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
            tilt.userdata = np.zeros(0)
            hinges[name] = tilt
    model = _compile_without_keys(spec)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    for joint, bearing in bearings.items():
        for name in tilt_names(joint):
            dof = int(model.joint(name).dofadr[0])
            critical = 2.0 * sqrt(bearing.tilt_stiffness * full[dof, dof])
            hinges[name].damping = np.array(
                [bearing.damping_ratio * critical, 0.0, 0.0]
            )
    _extend_keys(spec, model, tuple(hinges))


def _compile_without_keys(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a copy of a spec whose keyframes may have an old number of positions."""
    bare = spec.copy()
    for key in list(bare.keys):
        bare.delete(key)
    return bare.compile()


def _extend_keys(
    spec: mujoco.MjSpec, model: mujoco.MjModel, names: tuple[str, ...]
) -> None:
    """Add untilted bearings to all keyframes with positions or velocities."""
    if not has_positions(spec):
        return
    for field, size, address in (
        ("qpos", model.nq, "qposadr"),
        ("qvel", model.nv, "dofadr"),
    ):
        new = [int(getattr(model.joint(name), address)[0]) for name in names]
        old = np.setdiff1d(np.arange(size), new)
        for key in spec.keys:
            values = np.asarray(getattr(key, field), float)
            if len(values) == len(old):
                full = np.zeros(size)
                full[old] = values
                setattr(key, field, full.tolist())

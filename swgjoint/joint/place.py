"""Joints that get drives, checked and measured in one compiled copy of the spec."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import InputError
from swgjoint.joint.obstacles import Surroundings
from swgjoint.typing import Array

ROTOR_MASS = 1e-9
"""Mass of the rotor body [kg]; the model's links already include the motor mass."""
LUMPED_INERTIA = 1e-12
"""Body inertia of a lumped rotor [kg·m²]; the engine requires a positive value."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivePlace:
    """A joint in the compiled model: its frame, inertia, actuators and sensors."""

    joint: Any
    """Hinge in the spec."""
    parent: Any
    """Parent body of the link, which gets the rotor."""
    model: mujoco.MjModel
    """Compiled model without drives."""
    index: int
    """Index of the joint in the model."""
    actuators: dict[int, Any]
    """Actuators that act on the joint, by index in the model."""
    sensors: tuple[Any, ...]
    """Sensors of the actuator torque at the joint."""
    pos: Array
    """Position of the joint in the frame of the parent body, shape (3,) [m]."""
    quat: Array
    """Orientation of the joint's body in the parent frame, shape (4,) [-]."""
    axis: Array
    """Unit vector of the joint axis in the frame of its body, shape (3,) [-]."""
    ref: float
    """Joint angle at qpos0 [rad]."""
    armature: float
    """Armature of the joint and of the actuators on it [kg·m²]."""
    inertia: float
    """Inertia at qpos0 without armature, with the other joints locked [kg·m²]."""
    has_damping_ratio: bool
    """Whether an actuator on the joint states its damping as a ratio."""


class Compiled:
    """A compiled copy of a spec at qpos0, from which the joints are read."""

    def __init__(self, spec: mujoco.MjSpec, around: Surroundings) -> None:
        copy = spec.copy()
        copy.compiler.fusestatic = False  # keeps every body of the spec
        try:
            self.model = copy.compile()
        except ValueError as error:
            line = " ".join(str(error).split())
            raise InputError(f"the model does not compile: {line}") from error
        self.around = around
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    @cached_property
    def mass(self) -> Array:
        """Mass matrix with armature [kg·m²]. Shape (nv, nv)."""
        mass = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, mass)
        return mass

    def place(self, joint: Any) -> DrivePlace:
        """Frame, inertia, actuators and sensors of a hinge that can take a drive."""
        model, name = self.model, joint.name
        j = int(model.joint(name).id)
        b, dof = int(model.jnt_bodyid[j]), int(model.jnt_dofadr[j])
        actuators = dict(self.around.actuators.get(name, {}))
        k = list(actuators)
        armature = float(model.dof_armature[dof]) + float(
            model.actuator_armature[k] @ model.actuator_gear[k, 0] ** 2
        )
        offset = np.zeros(3)
        mujoco.mju_rotVecQuat(offset, model.jnt_pos[j], model.body_quat[b])
        return DrivePlace(
            joint=joint,
            parent=joint.parent.parent,
            model=model,
            index=j,
            actuators=actuators,
            sensors=tuple(self.around.sensors.get(name, ())),
            pos=model.body_pos[b] + offset,
            quat=model.body_quat[b].copy(),
            axis=model.jnt_axis[j].copy(),
            ref=float(model.qpos0[model.jnt_qposadr[j]]),
            armature=armature,
            inertia=float(self.mass[dof, dof]) - armature,
            has_damping_ratio=any(
                actuators[i].biasprm[2] > 0.0 > model.actuator_biasprm[i, 2] for i in k
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Rotor:
    """Inertia and type of the rotor of a drive."""

    inertia: float
    """Rotor inertia about its axis [kg·m²]."""
    ratio: float
    """Signed ratio i of the drive [-]."""
    lumped: bool
    """Whether the rotor rotates only relative to its parent link, see
    :func:`swgjoint.joint.attach.attach`."""
    own: bool
    """Whether the rotor has its own joint; otherwise it is armature of the link joint.
    """

    @property
    def body(self) -> float:
        """Isotropic inertia of the rotor body, which its parent carries [kg·m²]."""
        return min(LUMPED_INERTIA, 1e-3 * self.inertia) if self.lumped else self.inertia

    @property
    def reflected(self) -> float:
        """Rotor inertia reflected to the link, i²J [kg·m²]."""
        return self.ratio**2 * self.inertia


def free_inertias(
    compiled: Compiled, places: Mapping[str, DrivePlace], rotors: Mapping[str, Rotor]
) -> dict[str, tuple[float, float]]:
    """Inertias about joints with the other joints free, without and with other drives.

    The first inertia is that of the model without drives. The second includes the
    drives of all joints that precede the joint in the model, but neither a drive nor
    armature of the joint itself. Only joints whose actuators state a damping ratio are
    listed.

    Args:
        compiled: Model without drives.
        places: Joints that get a drive, by name and in the order of the model.
        rotors: Rotors of the same joints, by name.

    Returns:
        Both inertias by joint name [kg·m²].
    """
    if not any(place.has_damping_ratio for place in places.values()):
        return {}
    model, data = compiled.model, compiled.data
    mass, inertias = compiled.mass.copy(), {}
    before = np.linalg.inv(mass).diagonal()
    for name, place in places.items():
        dof, rotor = int(model.jnt_dofadr[place.index]), rotors[name]
        if place.has_damping_ratio:
            now = 1.0 / float(np.linalg.inv(mass)[dof, dof]) - place.armature
            inertias[name] = 1.0 / float(before[dof]), now
        mass[dof, dof] -= place.armature
        if not rotor.own:
            mass[dof, dof] += rotor.reflected
            continue
        # the rotor body moves with its parent; eliminate the free rotor hinge
        linear, angular = np.zeros((2, 3, model.nv))
        parent = int(model.body_parentid[model.jnt_bodyid[place.index]])
        anchor = data.xanchor[place.index]
        mujoco.mj_jac(model, data, linear, angular, anchor, parent)
        spin = data.xaxis[place.index] @ angular
        mass += ROTOR_MASS * linear.T @ linear + rotor.body * angular.T @ angular
        mass -= rotor.body**2 / rotor.inertia * np.outer(spin, spin)
    return inertias


def find_places(
    spec: mujoco.MjSpec, rotors: Mapping[str, float]
) -> tuple[Compiled, dict[str, DrivePlace]]:
    """Find the hinges that get a drive, in the order of the model.

    Args:
        spec: Model; unchanged.
        rotors: Rotor inertia by joint name [kg·m²].

    Returns:
        The compiled model without drives, and the joints by name.

    Raises:
        InputError: If a joint is unknown or cannot take a drive, with one line for
            each, if the model does not compile, or if compiler settings would change
            the rotor inertia.
    """
    around = Surroundings(spec)
    hinges, wrong = {}, []
    for name in rotors:
        try:
            hinges[name] = around.driven_joint(name)
        except InputError as error:
            wrong.append(str(error))
    if wrong:
        raise InputError("\n".join(wrong))
    _check_compiler(spec, min(rotors.values()))
    compiled = Compiled(spec, around)
    ordered = sorted(hinges, key=lambda name: int(compiled.model.joint(name).id))
    return compiled, {name: compiled.place(hinges[name]) for name in ordered}


def _check_compiler(spec: mujoco.MjSpec, rotor_inertia: float) -> None:
    """Reject compiler settings that would change the rotor inertia."""
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
            f"compiler boundinertia {compiler.boundinertia} kg·m² is above the rotor "
            f"inertia; accepted: at most {rotor_inertia} kg·m²"
        )

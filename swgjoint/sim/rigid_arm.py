"""The arm without drives: torques, inertia and poses on a commanded motion."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.models_path import find

Array = NDArray[np.float64]


class RigidArm:
    """One MJCF arm with ideal joints; the reference for control and errors.

    Attributes:
        path: The MJCF file.
        model: The compiled arm as the file has it.
        joints: Names of its joints, in the order of all arrays.
    """

    def __init__(self, reference: str, *, tool_site: str = "tool") -> None:
        """Load an arm, given as a path or as the name of a bundled one.

        Raises:
            InputError: If the file is missing, not MJCF, or has a joint that is not a
                hinge.
        """
        self.path: Path = find(reference, "arms", ".xml", what="arm")
        self.model = compile_spec(self.spec(), where=str(self.path))
        model = self.model
        self.joints = tuple(model.joint(j).name for j in range(model.njnt))
        if not self.joints:
            raise InputError(f"{self.path}: the arm has no joint; needed: hinge joints")
        for name, kind in zip(self.joints, model.jnt_type, strict=True):
            if kind != mujoco.mjtJoint.mjJNT_HINGE:
                word = mujoco.mjtJoint(kind).name.removeprefix("mjJNT_").lower()
                raise InputError(
                    f"{self.path}: joint {name!r} is of type {word}; accepted in a"
                    " scene: hinge joints"
                )
        self.tool = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, tool_site)
        if self.tool < 0 and tool_site != "tool":
            sites = [model.site(k).name for k in range(model.nsite)]
            raise InputError(
                f"{self.path}: site {tool_site!r} does not exist; accepted:"
                f" {', '.join(sites) or 'none in this arm'}"
            )
        self._data = mujoco.MjData(model)

    def spec(self) -> mujoco.MjSpec:
        """A fresh editable copy of the arm."""
        try:
            return mujoco.MjSpec.from_file(str(self.path))
        except ValueError as exc:
            raise InputError(f"{self.path}: not an MJCF arm: {_line(exc)}") from None

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques that the motion needs, gravity included [N·m].

        Args:
            position: [rad]. Shape (n, n_joints).
            velocity: [rad/s]. Shape (n, n_joints).
            acceleration: [rad/s²]. Shape (n, n_joints).
        """
        data, out = self._data, np.empty_like(position)
        for row, q, v, a in zip(out, position, velocity, acceleration, strict=True):
            data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
            mujoco.mj_inverse(self.model, data)
            row[:] = data.qfrc_inverse
        return out

    def gravity(self, position: Array) -> Array:
        """Joint torques that carry the weight at rest [N·m]. Shapes (n, n_joints)."""
        zero = np.zeros_like(position)
        return self.torques(position, zero, zero)

    def inertia(self, position: Array) -> Array:
        """Inertia about every joint, the others locked [kg·m²]. Shape (n_joints,)."""
        data, nv = self._data, self.model.nv
        data.qpos[:], data.qvel[:] = position, 0.0
        mujoco.mj_forward(self.model, data)
        full = np.zeros((nv, nv))
        mujoco.mj_fullM(self.model, data, full)
        return np.diag(full).copy()

    def tool_positions(self, position: Array) -> Array:
        """Tool in the world [m]. Shape (n, 3); empty rows where the arm has none."""
        if self.tool < 0:
            return np.empty((len(position), 0))
        data, out = self._data, np.empty((len(position), 3))
        for row, q in zip(out, position, strict=True):
            data.qpos[:] = q
            mujoco.mj_kinematics(self.model, data)
            row[:] = data.site_xpos[self.tool]
        return out

    def body_poses(self, position: Array) -> tuple[Array, Array]:
        """World positions [m] and quaternions (w, x, y, z) of all bodies.

        Returns:
            Shapes (n, n_bodies, 3) and (n, n_bodies, 4), the world body first.
        """
        data, count = self._data, len(position)
        places = np.empty((count, self.model.nbody, 3))
        turns = np.empty((count, self.model.nbody, 4))
        for place, turn, q in zip(places, turns, position, strict=True):
            data.qpos[:] = q
            mujoco.mj_kinematics(self.model, data)
            place[:], turn[:] = data.xpos, data.xquat
        return places, turns


def compile_spec(spec: mujoco.MjSpec, *, where: str) -> mujoco.MjModel:
    """Compile, with a failure as one line."""
    try:
        return spec.compile()
    except ValueError as exc:
        raise InputError(f"{where}: MuJoCo cannot compile it: {_line(exc)}") from None


def _line(exc: Exception) -> str:
    return " ".join(str(exc).split())

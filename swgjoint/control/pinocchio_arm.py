"""Rigid arm in Pinocchio, as the model for the feed-forward of a controller.

Pass a :class:`PinocchioArm` to :func:`swgjoint.run_scene` as ``known_arm``. It then
computes the link torques (weight and inertia) on which every plan is based, instead of
MuJoCo's inverse dynamics. A compiled MuJoCo model is converted value by value, because
MuJoCo writes MJCF with only six digits. A Pinocchio model, for instance from a URDF
file or an identification, is used unchanged. The joints may have viscous damping, dry
friction and, in a MuJoCo model, linear springs. MuJoCo models with polynomial springs
or damping are rejected.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from swgjoint.errors import InputError, MissingExtraError
from swgjoint.typing import Array


class PinocchioArm:
    """Inverse dynamics of an arm with hinge joints.

    Attributes:
        model: The ``pinocchio.Model``.
        joints: Joint names, in the order of the last axis of all arrays.
    """

    def __init__(self, model: Any) -> None:
        """Convert a MuJoCo model or use a Pinocchio model.

        A conversion copies the tree with its inertias, gravity, armature, damping, dry
        friction and springs.

        Args:
            model: MuJoCo model, for instance
                ``swgjoint.sim.arm.rigid_arm.RigidArm("ur5e").model``, or Pinocchio
                model.

        Raises:
            InputError: If a joint is not a hinge, if a body has several joints, or if a
                spring or damper is not linear.
            MissingExtraError: If Pinocchio is not installed.
        """
        self._pin = _pinocchio()
        is_mujoco = isinstance(model, mujoco.MjModel)
        self.model: Any = _tree(self._pin, model) if is_mujoco else model
        self.joints: tuple[str, ...] = tuple(self.model.names)[1:]  # 0: the universe
        if self.model.nv != len(self.joints):
            raise InputError(
                "arm with joints that are not hinges; accepted: hinges only"
            )
        self._data = self.model.createData()
        self._zero = self._pin.neutral(self.model)
        self._damping = np.array(self.model.damping)
        self._friction = (
            np.array(self.model.lowerDryFrictionLimit),
            np.array(self.model.upperDryFrictionLimit),
        )
        none = np.zeros(len(self.joints))
        self._spring = _springs(model, self.joints) if is_mujoco else (none, none)

    def torques(self, position: Array, velocity: Array, acceleration: Array) -> Array:
        """Joint torques of a motion, including gravity and joint losses [N·m].

        Dry friction acts only on moving joints.

        Args:
            position: Joint angles [rad]. Shape (n, n_joints).
            velocity: Joint speeds [rad/s]. Same shape.
            acceleration: Joint accelerations [rad/s²]. Same shape.

        Returns:
            Joint torques [N·m]. Same shape.
        """
        out = np.empty_like(position)
        rnea, model, data = self._pin.rnea, self.model, self._data
        for row, q, v, a in zip(out, position, velocity, acceleration, strict=True):
            row[:] = rnea(model, data, self._place(q), v, a)
        low, high = self._friction
        stiffness, centre = self._spring
        dry = np.where(velocity > 0.0, high, np.where(velocity < 0.0, low, 0.0))
        spring = stiffness * (position - centre)
        return np.asarray(out + self._damping * velocity + dry + spring)

    def inertia(self, position: Array) -> Array:
        """Inertia about every joint while the others are locked [kg·m²].

        Args:
            position: Joint angles [rad]. Shape (n_joints,).

        Returns:
            Inertias including armature [kg·m²]. Shape (n_joints,).
        """
        full = self._pin.crba(self.model, self._data, self._place(position))
        return np.diag(full).copy()

    def _place(self, angles: Array) -> Array:
        """Configuration vector, with cosine and sine for joints without limits."""
        return np.asarray(self._pin.integrate(self.model, self._zero, angles))


def _tree(pin: Any, model: mujoco.MjModel) -> Any:
    """Pinocchio model with the joints and bodies of a compiled MuJoCo model."""
    if (model.jnt_type != mujoco.mjtJoint.mjJNT_HINGE).any():
        raise InputError("arm with joints that are not hinges; accepted: hinges only")
    if (model.body_jntnum > 1).any():
        raise InputError("arm with two or more hinges on one body; accepted: one")
    other = pin.Model()
    other.gravity.linear = model.opt.gravity
    # joint that carries each body, and pose of the body frame in the joint frame
    holder = {0: (0, pin.SE3.Identity())}
    for b in range(1, model.nbody):
        joint, place = holder[int(model.body_parentid[b])]
        place = place * _pose(pin, model.body_pos[b], model.body_quat[b])
        if model.body_jntnum[b]:
            j = int(model.body_jntadr[b])
            anchor = pin.SE3(np.eye(3), model.jnt_pos[j])
            hinge = pin.JointModelRevoluteUnaligned(model.jnt_axis[j])
            joint = other.addJoint(joint, hinge, place * anchor, model.joint(j).name)
            dof = other.joints[joint].idx_v
            other.armature[dof] = model.dof_armature[j]
            other.damping[dof] = model.dof_damping[j]
            other.lowerDryFrictionLimit[dof] = -model.dof_frictionloss[j]
            other.upperDryFrictionLimit[dof] = model.dof_frictionloss[j]
            place = anchor.inverse()
        holder[b] = joint, place
        inertia = pin.Inertia(
            float(model.body_mass[b]), np.zeros(3), np.diag(model.body_inertia[b])
        )
        centre = place * _pose(pin, model.body_ipos[b], model.body_iquat[b])
        other.appendBodyToJoint(joint, inertia, centre)
    return other


def _springs(model: mujoco.MjModel, joints: tuple[str, ...]) -> tuple[Array, Array]:
    """Stiffness [N·m/rad] and rest angle [rad] of the joint springs."""
    for what, higher in (
        ("spring", model.jnt_stiffnesspoly),
        ("damping", model.dof_dampingpoly),
    ):
        nonlinear = [model.joint(k).name for k in np.flatnonzero(higher.any(axis=1))]
        if nonlinear:
            raise InputError(
                f"arm with a polynomial {what} in joint {', '.join(nonlinear)};"
                f" accepted: a linear {what}"
            )
    order = [int(model.joint(name).id) for name in joints]
    return model.jnt_stiffness[order].copy(), model.qpos_spring[order].copy()


def _pose(pin: Any, position: Array, quaternion: Array) -> Any:
    """Pose from a position [m] and a quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), position)


def _pinocchio() -> Any:
    try:
        import pinocchio
    except ImportError:
        raise MissingExtraError(
            "PinocchioArm needs the package pin: pip install 'swgjoint[control]'"
        ) from None
    return pinocchio
